"""Echoes of the airframe and of flat ground at an antenna, by the method of images.

Every triangle of the mesh is a flat mirror. Amplitudes are upper bounds: a curved surface spreads what it reflects, and
a triangle smaller than the first Fresnel zone (a metre at a few metres) sends back less than a mirror.

Source: Sabatini, Moore, Hill, WASET 7 (2013), eq (25) to (30), (34), (35).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbas_airborne.abia.airframe.aircraft import Antenna
from gbas_airborne.abia.airframe.mask_table import body_direction
from gbas_airborne.abia.airframe.mesh import Airframe
from gbas_core.record import FloatArray, IntArray
from gbas_core.signal.antenna import AntennaPattern
from gbas_core.signal.discriminator import discriminator_errors
from gbas_core.signal.rays import Echoes, Planes
from gbas_core.signal.surfaces import MATERIALS, circular_reflection
from gbas_core.signal.tracking_loops import Modulation
from gbas_core.signals import FREQUENCY_HZ, L1, SPEED_OF_LIGHT_MPS

ComplexArray = NDArray[np.complex128]
L1_HZ: Final = float(FREQUENCY_HZ[L1])
_LEAST_AREA_M2: Final = 1e-8
_AT_ONCE: Final = 2_000_000
"""Triangles times directions looked at in one go."""


class AirframeEchoes(NamedTuple):
    """Echoes ``(E,)``, of all directions asked for.

    Attributes
    ----------
    direction : int array
        Which of the directions each belongs to.
    part : list of str
        What reflects.
    delay_m : array
        Extra path [m].
    amplitude : complex array
        Over the direct signal, at the antenna's output, without the phase of the delay.
    """

    direction: IntArray
    part: list[str]
    delay_m: FloatArray
    amplitude: ComplexArray

    def with_phase(self, wavelength_m: float) -> ComplexArray:
        """Amplitudes with the phase of the delay."""
        return np.asarray(self.amplitude * np.exp(-2j * np.pi * self.delay_m / wavelength_m))


def airframe_echoes(
    mesh: Airframe,
    antenna: Antenna,
    pattern: AntennaPattern,
    directions: tuple[ArrayLike, ArrayLike],
    *,
    frequency_hz: float = L1_HZ,
) -> AirframeEchoes:
    """Single reflections that reach an antenna, nothing in their way.

    Parameters
    ----------
    mesh : Airframe
    antenna : Antenna
    pattern : AntennaPattern
        About the antenna's axis.
    directions : (azimuth, elevation)
        Of satellites in the body frame, ``(N,)`` each [rad]; one that is not finite has no echo.
    frequency_hz : float
        Carrier.

    Raises
    ------
    AirframeError
        For an antenna inside the body, or off it.
    """
    mesh.refuse_place(antenna.place_m)
    azimuth, elevation = (np.atleast_1d(np.asarray(each, dtype=np.float64)) for each in directions)
    # The core's scenes have their antennas look along the third axis.
    to_antenna = _along_third(np.asarray(antenna.axis))
    corners = mesh.corners_m - np.asarray(antenna.place_m)
    spanned = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    kept = np.flatnonzero(np.linalg.norm(spanned, axis=1) > 2.0 * _LEAST_AREA_M2)
    planes = Planes.of_triangles(corners[kept] @ to_antenna.T)
    towards = body_direction(azimuth, elevation) @ to_antenna.T
    known = np.flatnonzero(np.isfinite(towards).all(axis=1))
    found: list[tuple[IntArray, IntArray, FloatArray, ComplexArray]] = []
    metal = MATERIALS["metal"]
    for chosen in np.array_split(known, max(1, math.ceil(len(known) * len(kept) / _AT_ONCE))):
        rays = towards[chosen][np.newaxis]
        echoes = Echoes.of(planes, np.zeros_like(rays), rays, above_ground=False)
        material = np.array([[metal.permittivity], [metal.conductivity_spm], [metal.roughness_m]])
        amplitude = echoes.amplitude(material, pattern, frequency_hz)
        found.append((chosen[echoes.satellite], kept[echoes.plane], echoes.delay_m, amplitude))
    direction, face, delay_m, amplitude = (np.concatenate(each) for each in zip(*found, strict=True))
    return AirframeEchoes(direction, mesh.part_of(face), delay_m, amplitude)


def _along_third(axis: FloatArray) -> FloatArray:
    """A rotation that takes an axis to the third one, (3, 3)."""
    beside = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = np.cross(beside, axis)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first), axis])


# --- ground


class GroundEcho(NamedTuple):
    """The echo of flat ground, (...): extra path [m] and amplitude over the direct signal, as in AirframeEchoes."""

    delay_m: FloatArray
    amplitude: ComplexArray


def ground_echo(
    height_m: ArrayLike, elevation_rad: ArrayLike, pattern: AntennaPattern, *, material: str = "ground"
) -> GroundEcho:
    """Of an antenna that looks up, at a height above flat ground; NaN for a satellite below the horizon.

    Source: Sabatini et al., eq (34).
    """
    height, elevation = np.broadcast_arrays(
        np.asarray(height_m, dtype=np.float64), np.asarray(elevation_rad, dtype=np.float64)
    )
    above = elevation > 0.0
    sine = np.sin(np.where(above, elevation, 0.5 * math.pi))
    ground = MATERIALS[material]
    right, left = circular_reflection(ground.permittivity, ground.conductivity_spm, ground.roughness_m, sine, L1_HZ)
    direct = pattern.gain_at_dbic(elevation)
    same = 10.0 ** (0.05 * (pattern.gain_at_dbic(-elevation) - direct))
    other = 10.0 ** (0.05 * (pattern.cross_at_dbic(-elevation) - direct))
    amplitude = np.where(above, right * same + left * other, np.nan)
    return GroundEcho(np.where(above, 2.0 * height * sine, np.nan), amplitude)


def reached_by_ground_m(chip_rate_hz: float, elevation_rad: ArrayLike) -> FloatArray:
    """Height above flat ground below which its echo is within 1.5 chips of the direct signal [m].

    Source: Sabatini et al., eq (35) with (34): h sin(E) below 0.75 chips, 220 m for C/A; the paper gives the delay of
    1.5 microseconds itself, 449.7 m (not 448.5), as the bound of h sin(E).
    """
    return np.asarray(0.75 * SPEED_OF_LIGHT_MPS / chip_rate_hz / np.sin(elevation_rad))


# --- what loops make of one echo


class Envelope(NamedTuple):
    """Largest and least errors over all phases of one echo, (N,): code [m] and phase [rad]."""

    code_highest_m: FloatArray
    code_lowest_m: FloatArray
    phase_largest_rad: FloatArray


def error_envelope(
    delay_m: ArrayLike, amplitude: ArrayLike, modulation: Modulation, spacing_chips: float, *, phases: int = 72
) -> Envelope:
    """Errors of an early-late loop with one echo of given delays and amplitudes (N,), over the echo's phase.

    Source: Sabatini et al., eq (22), and :mod:`gbas_core.signal.discriminator`.
    """
    delay, strength = np.broadcast_arrays(
        np.atleast_1d(np.asarray(delay_m, dtype=np.float64)), np.abs(np.asarray(amplitude))
    )
    turns = np.exp(2j * np.pi * np.arange(phases) / phases)
    copies = (strength[:, np.newaxis] * turns).reshape(1, -1)
    delays = np.repeat(delay / modulation.chip_m, phases)[np.newaxis]
    errors = discriminator_errors(delays, copies, np.full(delays.shape[1], spacing_chips), boc=modulation.boc)
    code = (errors.code_chips * modulation.chip_m).reshape(len(delay), phases)
    phase = errors.phase_rad.reshape(len(delay), phases)
    return Envelope(code.max(axis=1), code.min(axis=1), np.abs(phase).max(axis=1))
