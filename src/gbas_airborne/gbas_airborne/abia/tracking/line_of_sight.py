"""Motion along the lines of sight to satellites, of a flown or planned path.

Source: Sabatini, Moore, Hill, WASET 7 (2013), section IV.G; Savitzky and Golay, Anal. Chem. 36 (1964), p. 1627.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.signal import savgol_filter

from gbas_airborne.abia.visibility.satellites_in_view import Path
from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.orbits import predicted_state, rotated_range
from gbas_core.record import FloatArray
from gbas_core.signal.doppler import doppler_hz
from gbas_core.signal.loop_thresholds import Motion

_DEGREE: Final = 4
"""Of the polynomials: one more than the derivative of jerk needs, so that its ends are not crooked."""
_UNEVEN: Final = 1e-3
"""Of the spacing of instants, as a share of it."""


class UnevenPathError(ValueError):
    """A path whose instants are not evenly spaced; one line."""


def motion_of_path(ephemeris: Ephemeris, path: Path, *, window_s: float = 2.0) -> Motion:
    """Velocity, acceleration and jerk along each line of sight, positive when the range grows, (T, N_SATS) each.

    NaN for a satellite that is not known at every instant.

    Parameters
    ----------
    ephemeris : Ephemeris
    path : Path
        With instants evenly spaced; a gap would look like a jump.
    window_s : float
        Length of the polynomials fitted to the ranges: longer is quieter, and blunter.

    Raises
    ------
    UnevenPathError
        For a path with gaps, or shorter than the window.
    """
    spacing_s = _spacing_s(path)
    count = max(_DEGREE + 1, round(window_s / spacing_s)) | 1
    if len(path.tow_s) < count:
        raise UnevenPathError(f"path: {len(path.tow_s)} instants, but {count} are in a window of {window_s:g} s")
    state = predicted_state(ephemeris, path.gps_week, path.tow_s[:, np.newaxis], path.position_m, None)
    range_m, _ = rotated_range(path.position_m, state.position_m)
    known = np.isfinite(range_m).all(axis=0)
    motion = []
    for order in (1, 2, 3):
        derivative = np.full(range_m.shape, np.nan)
        derivative[:, known] = savgol_filter(
            range_m[:, known], count, _DEGREE, deriv=order, delta=spacing_s, axis=0, mode="interp"
        )
        motion.append(derivative)
    return Motion(*motion)


def _spacing_s(path: Path) -> float:
    if len(path.tow_s) < 2:
        raise UnevenPathError("path: fewer than two instants")
    steps = np.diff(path.tow_s)
    spacing_s = float(np.median(steps))
    uneven = ~(np.abs(steps - spacing_s) <= _UNEVEN * spacing_s)
    if uneven.any() or not spacing_s > 0.0:
        first = int(np.argmax(uneven))
        raise UnevenPathError(
            f"path: instants {path.tow_s[first]:.3f} and {path.tow_s[first + 1]:.3f} s are {steps[first]:.3f} s apart, "
            f"the others {spacing_s:.3f}: a gap"
        )
    return spacing_s


def motion_of_aircraft(los: FloatArray, acceleration_mps2: FloatArray, jerk_mps3: FloatArray) -> Motion:
    """What an aircraft's own motion adds to each line of sight, (..., N): all that matters for the loops of an instant.

    Parameters
    ----------
    los : (..., 3, N) array
        Unit vectors to satellites.
    acceleration_mps2, jerk_mps3 : (..., 3) arrays
        Of the antenna, in the same axes.

    Notes
    -----
    A satellite's own acceleration along the line of sight is below 0.2 m/s^2, its jerk below 1e-4 m/s^3. The velocity,
    which no loop of second order or above feels, is left 0.
    """
    along_acceleration, along_jerk = (
        -np.einsum("...xn,...x->...n", los, each) for each in (acceleration_mps2, jerk_mps3)
    )
    return Motion(np.zeros_like(along_acceleration), along_acceleration, along_jerk)


def doppler_of_path(ephemeris: Ephemeris, path: Path, velocity_mps: FloatArray) -> FloatArray:
    """Doppler along a path with velocities (T, 3), ECEF, by a perfect clock, (T, N_BANDS, N_SATS) [Hz]."""
    state = predicted_state(ephemeris, path.gps_week, path.tow_s[:, np.newaxis], path.position_m)
    return doppler_hz(path.position_m, velocity_mps, state)
