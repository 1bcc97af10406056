"""The troposphere: refractivity that falls exponentially with height, the same over the whole site; and weather.

For this atmosphere the correction a GBAS receiver applies between the station's height and its own is exact, when the
station broadcasts its refractivity and scale height; what remains is that aircraft and station see a satellite at
different elevations. Delays are the same on code and carrier and on all frequencies.

Weather that the correction knows nothing of is a :class:`WeatherBox`: a body of air of another refractivity.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal

import numpy as np

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_sim.atmosphere.paths import Delay, SignalPaths

# Known: obliquity 1 / sqrt(0.002 + sin^2 E). Source: ICAO Annex 10 Vol. I, App. B 3.6.5.3.
_OBLIQUITY: Final = 0.002

# Known: constants of refractivity. Source: Smith and Weintraub, Proc. IRE 41 (1953), pp. 1035-1037.
_DRY_K_PER_HPA: Final = 77.6
_WET_K2_PER_HPA: Final = 3.73e5


REFRACTIVITY: Final = Parameter("at the reference height; 0 is a vacuum", "N units", 0.0, 800.0)
SCALE_HEIGHT: Final = Parameter("height over which refractivity falls to 1/e", "m", 100.0, 30_000.0)
REFERENCE_HEIGHT: Final = Parameter("reference height above the ellipsoid", "m", -1000.0, 20_000.0)


@parameters
class Troposphere:
    """Exponential refractivity."""

    refractivity: Annotated[float, REFRACTIVITY] = 0.0
    scale_height_m: Annotated[float, SCALE_HEIGHT] = 7900.0
    reference_height_m: Annotated[float, REFERENCE_HEIGHT] = 0.0

    @classmethod
    def from_weather(
        cls,
        *,
        pressure_hpa: float,
        temperature_k: float,
        relative_humidity: float,
        latitude_rad: float,
        reference_height_m: float,
    ) -> Troposphere:
        """The exponential troposphere with the refractivity and the total zenith delay of given weather.

        Parameters
        ----------
        pressure_hpa, temperature_k, relative_humidity : float
            At the reference height [hPa], [K], [0 to 1].
        latitude_rad, reference_height_m : float
            Of the station [rad], [m].

        Notes
        -----
        The scale height is what makes the integral of the refractivity equal :func:`saastamoinen_zenith_m`.
        """
        vapour_hpa = relative_humidity * saturation_hpa(temperature_k)
        refractivity = _DRY_K_PER_HPA * pressure_hpa / temperature_k + _WET_K2_PER_HPA * vapour_hpa / temperature_k**2
        zenith_m = saastamoinen_zenith_m(pressure_hpa, temperature_k, vapour_hpa, latitude_rad, reference_height_m)
        return cls(
            refractivity=refractivity,
            scale_height_m=zenith_m / (1e-6 * refractivity),
            reference_height_m=reference_height_m,
        )

    def delay_m(self, height_m: FloatArray, elevation_rad: FloatArray) -> FloatArray:
        """Delay ``(..., N_SATS)`` at heights ``(...)`` and elevations ``(..., N_SATS)`` [m].

        Source: the integral of 1e-6 N exp(-(h - h_ref) / h_0) over height from the receiver up, times the obliquity.
        """
        zenith_m = self.vertical_m(height_m)
        return np.asarray(zenith_m[..., np.newaxis] / np.sqrt(_OBLIQUITY + np.sin(elevation_rad) ** 2))

    def vertical_m(self, height_m: FloatArray) -> FloatArray:
        """Refractivity integrated over height from ``height_m`` ``(...)`` up [m]."""
        above = (height_m - self.reference_height_m) / self.scale_height_m
        return np.asarray(1e-6 * self.refractivity * self.scale_height_m * np.exp(-above))

    def delay(self, paths: SignalPaths) -> Delay:
        """Slant delay and its rate; NaN for satellites below the horizon."""
        sine = np.where(paths.sin_elevation > 0.0, paths.sin_elevation, np.nan)
        squared = _OBLIQUITY + sine**2
        delay_m = self.vertical_m(paths.height_m)[..., np.newaxis] / np.sqrt(squared)
        thinning = (paths.climb_mps / self.scale_height_m)[..., np.newaxis]
        return Delay(delay_m=delay_m, rate_mps=-delay_m * (thinning + sine * paths.sin_elevation_rate / squared))


@parameters
class WeatherBox:
    """A body of air between two heights and two vertical walls, of another refractivity than its surroundings.

    A weather wall reaches from the ground up and moves over the station; a duct is a thin layer above the ground that
    does not end. Air and ground are in one horizontal plane: over 20 km the Earth falls away from it by 31 m.

    Notes
    -----
    Source of the threat: van Graas and Zhu, "Tropospheric delay threats for the Ground Based Augmentation System", ION
    ITM 2011 (weather wall). Rays are straight; the delay is 1e-6 N over the length of each ray within the body.
    """

    kind: Annotated[Literal["weather"], Parameter("kind of the threat")] = "weather"
    excess_refractivity: Annotated[float, Parameter("over that of the surroundings", "N units", -200.0, 200.0)] = 30.0
    base_m: Annotated[float, Parameter("lower end above the station's horizontal plane", "m", -1000.0, 20_000.0)] = 0.0
    top_m: Annotated[float, Parameter("upper end above that plane", "m", -1000.0, 20_000.0)] = 3000.0
    direction_rad: Annotated[
        float, Parameter("azimuth of motion and across the walls, clockwise from north", "deg", -360.0, 360.0)
    ] = 0.0
    start_m: Annotated[
        float, Parameter("distance of the front wall from the station in that direction", "m", -1.0e7, 1.0e7)
    ] = 0.0
    start_s: Annotated[float, Parameter("when it is there, since the start", "s", -1.0e6, 1.0e6)] = 0.0
    thickness_m: Annotated[float, Parameter("from the front wall back to the other", "m", 1.0, 1.0e7)] = 1.0e6
    speed_mps: Annotated[float, Parameter("speed of the motion", "m/s", 0.0, 100.0)] = 0.0

    def __post_init__(self) -> None:
        if self.top_m <= self.base_m:
            raise ValueError(f"top_m = {self.top_m!r} is not above base_m = {self.base_m!r}")

    def delay(self, paths: SignalPaths) -> Delay:
        """Slant delay and its rate; NaN for satellites below the horizon.

        Notes
        -----
        Each pair of planes is crossed at two distances along the ray, with rates; the ray is within the body between
        the later entry and the earlier exit.
        """
        axis, axis_up = paths.station.towards(self.direction_rad), paths.station.axes[2]
        front_m = self.start_m + self.speed_mps * (paths.each(paths.since_start_s) - self.start_s)
        low, high = _crossings(paths, axis_up, self.base_m, self.top_m, 0.0)
        back, front = _crossings(paths, axis, front_m - self.thickness_m, front_m, self.speed_mps)
        start = (np.zeros_like(low[0]), np.zeros_like(low[0]))
        enter = _later(_later(low, back), start)
        leave = _negative(_later(_negative(high), _negative(front)))
        within = leave[0] > enter[0]
        risen = np.where(paths.sin_elevation > 0.0, 1e-6 * self.excess_refractivity, np.nan)
        return Delay(
            delay_m=risen * np.where(within, leave[0] - enter[0], 0.0),
            rate_mps=risen * np.where(within, leave[1] - enter[1], 0.0),
        )


_Crossing = tuple[FloatArray, FloatArray]


def _crossings(
    paths: SignalPaths, axis: FloatArray, near_m: FloatArray | float, far_m: FloatArray | float, moving_mps: float
) -> tuple[_Crossing, _Crossing]:
    """Where rays enter and leave the space between two planes across an axis: distances along the rays, and rates."""
    place = np.sum((paths.position_m - paths.station.position_m) * axis, axis=-1)[..., np.newaxis]
    place_mps = np.sum(paths.velocity_mps * axis, axis=-1)[..., np.newaxis]
    slope = np.sum(paths.los * axis[:, np.newaxis], axis=-2)
    slope_rate = np.sum(paths.los_rate * axis[:, np.newaxis], axis=-2)
    slope = np.where(np.abs(slope) < 1e-12, 1e-12, slope)  # a ray along the planes meets them far away
    pairs = []
    for plane_m in (near_m, far_m):
        length = (plane_m - place) / slope
        pairs.append((length, (moving_mps - place_mps - length * slope_rate) / slope))
    (near, near_rate), (far, far_rate) = pairs
    forward = slope > 0.0
    enter = np.where(forward, near, far), np.where(forward, near_rate, far_rate)
    leave = np.where(forward, far, near), np.where(forward, far_rate, near_rate)
    return enter, leave


def _later(first: _Crossing, second: _Crossing) -> _Crossing:
    later = second[0] > first[0]
    return np.where(later, second[0], first[0]), np.where(later, second[1], first[1])


def _negative(crossing: _Crossing) -> _Crossing:
    return -crossing[0], -crossing[1]


def saturation_hpa(temperature_k: float) -> float:
    """Pressure of saturated water vapour over water [hPa].

    Source: Bolton, Monthly Weather Review 108 (1980), pp. 1046-1053, eq (10).
    """
    celsius = temperature_k - 273.15
    return 6.112 * math.exp(17.67 * celsius / (celsius + 243.5))


def saastamoinen_zenith_m(
    pressure_hpa: float, temperature_k: float, vapour_hpa: float, latitude_rad: float, height_m: float
) -> float:
    """Total zenith delay above a place with given weather [m].

    Parameters
    ----------
    pressure_hpa, temperature_k, vapour_hpa : float
        Total pressure [hPa], temperature [K] and pressure of water vapour [hPa] at the place.
    latitude_rad, height_m : float
        Of the place [rad], [m].

    Source: Saastamoinen, "Atmospheric correction for the troposphere and stratosphere in radio ranging of satellites",
    Geophysical Monograph 15 (1972), pp. 247-251; gravity as in Davis et al., Radio Science 20 (1985), pp. 1593-1607.
    """
    gravity = 1.0 - 0.00266 * math.cos(2.0 * latitude_rad) - 0.28e-6 * height_m
    return 0.0022768 * (pressure_hpa + (1255.0 / temperature_k + 0.05) * vapour_hpa) / gravity
