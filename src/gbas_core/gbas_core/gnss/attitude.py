"""Attitude of an aircraft: from its motion through the air without sideslip, from Euler angles, and what it turns.

The lift is banked about the motion through the air; the fuselage is turned up from that by the angle of attack, in the
plane of motion and lift. Wings level, pitch is climb angle plus angle of attack; banked, the nose also points into the
turn.

Source: Stevens, Lewis and Johnson, Aircraft Control and Simulation, 3rd edition (2016), 2.3 (wind and body axes).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.record import FloatArray


def rot_body_enu(
    climb_rad: FloatArray, heading_rad: FloatArray, bank_rad: FloatArray, alpha_rad: FloatArray
) -> FloatArray:
    """Rotation from east, north, up to body axes (forward, right, down), (..., 3, 3).

    Parameters
    ----------
    climb_rad, heading_rad : (...) arrays
        Motion through the air.
    bank_rad, alpha_rad : (...) arrays
        Bank of the lift about it, and angle of attack.
    """
    sin_climb, cos_climb = np.sin(climb_rad), np.cos(climb_rad)
    sin_heading, cos_heading = np.sin(heading_rad), np.cos(heading_rad)
    motion = np.stack([sin_heading * cos_climb, cos_heading * cos_climb, sin_climb], axis=-1)
    above = np.stack([-sin_heading * sin_climb, -cos_heading * sin_climb, cos_climb], axis=-1)
    right = np.stack([cos_heading, -sin_heading, np.zeros_like(sin_heading)], axis=-1)
    sin_bank, cos_bank = np.sin(bank_rad)[..., np.newaxis], np.cos(bank_rad)[..., np.newaxis]
    sin_alpha, cos_alpha = np.sin(alpha_rad)[..., np.newaxis], np.cos(alpha_rad)[..., np.newaxis]
    lift = above * cos_bank + right * sin_bank
    return np.stack(
        [
            motion * cos_alpha + lift * sin_alpha,
            right * cos_bank - above * sin_bank,
            motion * sin_alpha - lift * cos_alpha,
        ],
        axis=-2,
    )


def euler_angles(rot: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Roll (-pi to pi), pitch and true heading (0 to 2 pi) [rad] of rotations from east, north, up to body axes."""
    forward = rot[..., 0, :]
    heading = np.mod(np.arctan2(forward[..., 0], forward[..., 1]), 2.0 * np.pi)
    pitch = np.arcsin(np.clip(forward[..., 2], -1.0, 1.0))
    return np.arctan2(-rot[..., 1, 2], -rot[..., 2, 2]), pitch, heading


def body_rates(
    angles_rad: tuple[FloatArray, FloatArray, FloatArray],
    rates_radps: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
) -> FloatArray:
    """Roll, pitch and yaw rate about body axes, relative to the local axes, (..., 3) [rad/s].

    Parameters
    ----------
    angles_rad : three (...) arrays
        Climb angle, bank and angle of attack.
    rates_radps : four (...) arrays
        Rates of climb angle, heading of the motion through the air, bank and angle of attack.
    """
    climb, bank, alpha = angles_rad
    climbing, turning, banking, pitching = rates_radps
    about_motion = banking - turning * np.sin(climb)
    about_right = climbing * np.cos(bank) + turning * np.cos(climb) * np.sin(bank)
    about_down = -climbing * np.sin(bank) + turning * np.cos(climb) * np.cos(bank)
    sine, cosine = np.sin(alpha), np.cos(alpha)
    return np.stack(
        [about_motion * cosine - about_down * sine, about_right + pitching, about_motion * sine + about_down * cosine],
        axis=-1,
    )


def rot_euler(roll_rad: ArrayLike, pitch_rad: ArrayLike, heading_rad: ArrayLike) -> FloatArray:
    """Rotation from east, north, up to body axes of an attitude, the inverse of :func:`euler_angles`, (..., 3, 3)."""
    roll, pitch, heading = np.broadcast_arrays(
        *(np.asarray(each, dtype=np.float64) for each in (roll_rad, pitch_rad, heading_rad))
    )
    return rot_body_enu(pitch, heading, roll, np.zeros_like(roll))


def body_azimuth_elevation(rot: FloatArray, los_enu: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Azimuth (from the nose clockwise seen from above, -pi to pi) and elevation above the wings' plane [rad].

    Parameters
    ----------
    rot : (..., 3, 3) array
        From east, north, up to body axes.
    los_enu : (..., 3, N) array
        Unit vectors to satellites.

    Returns
    -------
    (..., N) arrays

    Source: Sabatini, Moore, Hill, WASET 7 (2013), eq (11).
    """
    body = rot @ los_enu
    forward, right, down = body[..., 0, :], body[..., 1, :], body[..., 2, :]
    return np.arctan2(right, forward), np.arctan2(-down, np.hypot(forward, right))
