"""Multipath from a scene: rays reflected once, and what the loops of a receiver make of them.

A scene is flat: a ground plane and rectangular or triangular facets, in a local frame with east, north, up axes. A
signal arrives as a plane wave; by the method of images it reaches the antenna from a facet as it would reach the
antenna's mirror image, if the way crosses the facet and nothing is in it. Reflections carry the facet's Fresnel
coefficients and the antenna's gains for both circular polarisations. Diffraction and second reflections are left out.

Sources: Sabatini, Moore, Hill, WASET 7 (2013), eq (25) to (28); Hannah, Modelling and simulation of GPS multipath
propagation, QUT (2001), ch. 3 and 4; Recommendations ITU-R P.2040 and P.527 (materials). What the loops make of it:
:mod:`gbas_core.signal.discriminator`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import BoolArray, FloatArray
from gbas_core.signal.antenna import AntennaPattern
from gbas_core.signal.discriminator import discriminator_errors
from gbas_core.signal.surfaces import MATERIALS, ComplexArray, Facet, circular_reflection
from gbas_core.signal.tracking_loops import MODULATIONS, SIGNALS, per_signal
from gbas_core.signals import FREQUENCY_HZ, L1, L5, N_BANDS, WAVELENGTH_M

IndexArray = NDArray[np.intp]

_BANDS: Final = (L1, L5)
_EDGE: Final = 1e-9
_CLEAR_M: Final = 1e-6  # a facet does not hide what touches it


class Rays(NamedTuple):
    """Reflections at the antennas; K is the largest number of them at any antenna from any satellite.

    Attributes
    ----------
    visible : (R, S) bool array
        Whether the direct ray reaches the antenna.
    delay_m : (K, R, S) array
        Path of each reflection less that of the direct signal [m]; 0 where there is none.
    amplitude : (K, R, N_BANDS, S) complex array
        Reflection over direct signal at the antenna's output, without the phase of the delay; 0 where there is none.
    """

    visible: BoolArray
    delay_m: FloatArray
    amplitude: ComplexArray


@parameters
class Scene:
    """What reflects and hides."""

    facets: tuple[Facet, ...] = ()
    ground: Annotated[
        str | None,
        Parameter("material of the plane at height 0; none: the sky goes down to the nadir", choices=tuple(MATERIALS)),
    ] = "ground"

    @cached_property
    def _planes(self) -> Planes:
        return Planes.of(self.facets, self.ground is not None)

    @cached_property
    def _materials(self) -> FloatArray:
        """Permittivity, conductivity and roughness of facets and ground, (3, K)."""
        names = [facet.material for facet in self.facets] + ([] if self.ground is None else [self.ground])
        found = [MATERIALS[name] for name in names]
        return np.array([[each.permittivity, each.conductivity_spm, each.roughness_m] for each in found]).T

    def trace(self, antenna_m: FloatArray, los: FloatArray, pattern: AntennaPattern) -> Rays:
        """Reflections towards antennas from plane waves.

        Parameters
        ----------
        antenna_m : (R, 3) array
            East, north, up [m]; up is above the ground plane.
        los : (R, 3, S) array
            Unit vectors from antenna to satellite, east, north, up; NaN is no satellite.
        pattern : AntennaPattern
            Its axis is up.
        """
        planes = self._planes
        towards = np.ascontiguousarray(np.swapaxes(los, 1, 2))
        origin = np.broadcast_to(antenna_m[:, np.newaxis, :], towards.shape)
        visible = np.isfinite(towards[..., 2]) & ~planes.meet(origin, towards, np.inf).any(axis=-1)
        if self.ground is not None:
            visible &= towards[..., 2] > 0.0
        echoes = Echoes.of(planes, origin, towards, above_ground=self.ground is not None)
        places = echoes.rank.max(initial=-1) + 1
        delay_m = np.zeros((places, *visible.shape))
        amplitude = np.zeros((places, visible.shape[0], N_BANDS, visible.shape[1]), dtype=np.complex128)
        delay_m[echoes.rank, echoes.row, echoes.satellite] = echoes.delay_m
        if places:
            materials = self._materials[:, echoes.plane]
            for band in _BANDS:
                strength = echoes.amplitude(materials, pattern, float(FREQUENCY_HZ[band]))
                amplitude[echoes.rank, echoes.row, band, echoes.satellite] = strength
        return Rays(visible=visible, delay_m=delay_m, amplitude=amplitude)


@dataclass(frozen=True, kw_only=True, eq=False)
class Echoes:
    """Single reflections, ``(E,)`` of them: whose they are, in which plane, and what they are like.

    Attributes
    ----------
    plane, row, satellite : array
        Plane it comes from, antenna and satellite it belongs to.
    rank : array
        Its number among those of the same antenna and satellite.
    delay_m : array
        Its path less that of the direct signal [m].
    sine : array
        Sine of its grazing angle.
    arrival_up, direct_up : array
        Upward components of the directions it and the direct signal arrive from.
    """

    plane: IndexArray
    row: IndexArray
    satellite: IndexArray
    rank: IndexArray
    delay_m: FloatArray
    sine: FloatArray
    arrival_up: FloatArray
    direct_up: FloatArray

    @classmethod
    def of(cls, planes: Planes, origin: FloatArray, towards: FloatArray, *, above_ground: bool) -> Echoes:
        """Image method: the antenna's image is 2 h below it along the normal, the extra path 2 h sin(grazing angle).

        Source: Sabatini et al., eq (25) to (28), with dot products, for a satellite at infinity.
        """
        normal = planes.normal[:, np.newaxis, np.newaxis, :]
        height = _dot(origin - planes.corner[:, np.newaxis, np.newaxis, :], normal)
        sine = _dot(towards, normal)
        possible = (height > _CLEAR_M) & (sine > _EDGE)
        arrival = towards - 2.0 * sine[..., np.newaxis] * normal
        way = np.where(possible, height, 0.0) / np.where(possible, sine, 1.0)
        point = origin + way[..., np.newaxis] * arrival
        there = possible & planes.contain(point)
        if above_ground:
            there &= point[..., 2] >= -_EDGE
        plane, row, satellite = np.nonzero(there)
        there[plane, row, satellite] = _free(
            planes, plane, origin[row, satellite], point[there], towards[row, satellite]
        )
        plane, row, satellite = np.nonzero(there)
        return cls(
            plane=plane,
            row=row,
            satellite=satellite,
            rank=(np.cumsum(there, axis=0) - 1)[there],
            delay_m=2.0 * height[there] * sine[there],
            sine=sine[there],
            arrival_up=arrival[..., 2][there],
            direct_up=towards[row, satellite, 2],
        )

    def amplitude(self, materials: FloatArray, pattern: AntennaPattern, frequency_hz: float) -> ComplexArray:
        """Reflection over direct signal at the antenna's output, ``(E,)``."""
        arrival_rad, direct_rad = (np.arcsin(np.clip(each, -1.0, 1.0)) for each in (self.arrival_up, self.direct_up))
        direct_dbic = pattern.gain_at_dbic(direct_rad)
        same = 10.0 ** (0.05 * (pattern.gain_at_dbic(arrival_rad) - direct_dbic))
        other = 10.0 ** (0.05 * (pattern.cross_at_dbic(arrival_rad) - direct_dbic))
        right, left = circular_reflection(materials[0], materials[1], materials[2], self.sine, frequency_hz)
        return np.asarray(right * same + left * other)


def _free(planes: Planes, plane: IndexArray, start: FloatArray, point: FloatArray, towards: FloatArray) -> BoolArray:
    """Whether no facet but the reflecting one is on the ways to the antenna and to the satellite."""
    way = point - start
    length = np.sqrt(_dot(way, way))
    hidden = planes.meet(start, way / length[:, np.newaxis], length) | planes.meet(point, towards, np.inf)
    hidden[np.arange(plane.size), plane] = False
    return np.asarray(~hidden.any(axis=-1))


@dataclass(frozen=True, kw_only=True, eq=False)
class Planes:
    """Facets, and the ground last if there is one, as arrays (K, 3); the ground has no edges and hides nothing."""

    corner: FloatArray
    normal: FloatArray
    first_dual: FloatArray
    second_dual: FloatArray
    triangle: BoolArray
    endless: BoolArray

    @classmethod
    def of_triangles(cls, corners_m: FloatArray) -> Planes:
        """Triangles (K, 3 corners, 3) that reflect on the side from which their corners go counter-clockwise [m]."""
        corner = corners_m[:, 0]
        every = np.ones(len(corners_m), dtype=bool)
        return cls._spanned(corner, corners_m[:, 1] - corner, corners_m[:, 2] - corner, every, ~every)

    @classmethod
    def of(cls, facets: tuple[Facet, ...], ground: bool) -> Planes:
        corner, first, second = (
            np.array([getattr(each, key) for each in facets] + [flat] * ground, dtype=np.float64).reshape(-1, 3)
            for key, flat in (
                ("corner_m", (0.0, 0.0, 0.0)),
                ("first_m", (1.0, 0.0, 0.0)),
                ("second_m", (0.0, 1.0, 0.0)),
            )
        )
        triangle = np.array([each.triangle for each in facets] + [False] * ground, dtype=bool)
        endless = np.array([False] * len(facets) + [True] * ground, dtype=bool)
        return cls._spanned(corner, first, second, triangle, endless)

    @classmethod
    def _spanned(
        cls, corner: FloatArray, first: FloatArray, second: FloatArray, triangle: BoolArray, endless: BoolArray
    ) -> Planes:
        """By a corner and two edges each."""
        area = np.cross(first, second)
        square = _dot(area, area)[:, np.newaxis]
        return cls(
            corner=corner,
            normal=area / np.sqrt(square),
            # Their products with a point of the plane, from the corner, are its shares of both edges.
            first_dual=np.cross(second, area) / square,
            second_dual=np.cross(area, first) / square,
            triangle=triangle,
            endless=endless,
        )

    def contain(self, point_m: FloatArray) -> BoolArray:
        """Whether points ``(K, R, S, 3)``, of one plane each, are on the facet."""
        away = point_m - self.corner[:, np.newaxis, np.newaxis, :]
        first, second = (_dot(away, dual[:, np.newaxis, np.newaxis, :]) for dual in (self.first_dual, self.second_dual))
        return _on_facet(first, second, *(each[:, np.newaxis, np.newaxis] for each in (self.triangle, self.endless)))

    def meet(self, origin_m: FloatArray, direction: FloatArray, length_m: ArrayLike) -> BoolArray:
        """Which facets rays ``(..., 3)`` of given length ``(...)`` meet, their ends left out, ``(..., K)``.

        Source: Moller and Trumbore, "Fast, minimum storage ray/triangle intersection", J. Graphics Tools 2 (1997).
        """
        start = origin_m[..., np.newaxis, :] - self.corner
        along = direction[..., np.newaxis, :]
        steep = _dot(along, self.normal)
        crossing = np.abs(steep) > _EDGE
        way = -_dot(start, self.normal) / np.where(crossing, steep, 1.0)
        crossing &= (way > _CLEAR_M) & (way < np.asarray(length_m)[..., np.newaxis] - _CLEAR_M) & ~self.endless
        place = start + way[..., np.newaxis] * along
        on_facet = _on_facet(_dot(place, self.first_dual), _dot(place, self.second_dual), self.triangle, self.endless)
        return np.asarray(crossing & on_facet)


def _on_facet(first: FloatArray, second: FloatArray, triangle: BoolArray, endless: BoolArray) -> BoolArray:
    """Whether shares of both edges are on the parallelogram, the triangle or the endless plane."""
    inside = (first >= -_EDGE) & (second >= -_EDGE) & (first <= 1.0 + _EDGE) & (second <= 1.0 + _EDGE)
    return np.asarray(endless | (inside & (~triangle | (first + second <= 1.0 + _EDGE))))


def _dot(one: FloatArray, other: FloatArray) -> FloatArray:
    """Scalar product along the last axis, the sum always in the same order."""
    product = one * other
    return np.asarray(product[..., 0] + product[..., 1] + product[..., 2])


class RayErrors(NamedTuple):
    """What reflections do to a receiver's measurements, ``(R, N_BANDS, N_SATS)``; 0 without reflections and on L2.

    Attributes
    ----------
    code_m, carrier_m : array
        Added to code and carrier range [m].
    cn0_db : array
        Change of the power of the prompt correlator [dB].
    """

    code_m: FloatArray
    carrier_m: FloatArray
    cn0_db: FloatArray


def ray_errors(rays: Rays, spacing_chips: tuple[float, float, float]) -> RayErrors:
    """Errors of loops in lock with the direct signal and its reflections.

    Parameters
    ----------
    rays : Rays
        With S = N_SATS.
    spacing_chips : (float, float, float)
        Early to late, for :data:`gbas_core.signal.tracking_loops.SIGNALS` [chips].
    """
    if len(spacing_chips) != len(SIGNALS):
        raise ValueError(f"rays: spacing_chips = {spacing_chips!r} is not three numbers ({', '.join(SIGNALS)})")
    reached = np.zeros((rays.visible.shape[0], N_BANDS, rays.visible.shape[1]), dtype=bool)
    reached[:, _BANDS] = (rays.visible & (rays.delay_m > 0.0).any(axis=0))[:, np.newaxis]
    row, band, satellite = np.nonzero(reached)
    delay_m = rays.delay_m[:, row, satellite]
    chip_m, wavelength_m = _CHIP_M[band, satellite], WAVELENGTH_M[band]
    found = discriminator_errors(
        delay_m / chip_m,
        rays.amplitude[:, row, band, satellite] * np.exp(-2j * np.pi * delay_m / wavelength_m),
        per_signal(spacing_chips)[band, satellite],
        boc=_IS_BOC[band, satellite],
    )
    errors = RayErrors(*(np.zeros(reached.shape) for _ in range(3)))
    errors.code_m[reached] = found.code_chips * chip_m
    errors.carrier_m[reached] = -found.phase_rad * wavelength_m / (2.0 * np.pi)
    errors.cn0_db[reached] = found.power_db
    return errors


_CHIP_M: Final[FloatArray] = per_signal((MODULATIONS[0].chip_m, MODULATIONS[1].chip_m, MODULATIONS[2].chip_m))
_IS_BOC: Final[BoolArray] = per_signal((0.0, 1.0, 0.0)) == 1.0
