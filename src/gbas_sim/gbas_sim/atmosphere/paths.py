"""Signal paths through the atmosphere at one instant: what every atmospheric effect is computed from.

Effects are functions of :class:`SignalPaths` and of their own parameters and give a :class:`Delay`, the slant delay on
L1 with its rate. Geometry that several effects need is computed once for all of them, with its derivative against time.

The ionosphere is a thin shell on a local sphere: its centre lies on the station's vertical, one Earth radius below the
station, so that the obliquity at the station is that of the standard at the elevation the station sees; see
:func:`gbas_core.models.error_models.iono_obliquity`. Other receivers, and heights above the station, follow from
geometry.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gbas_core.gnss.frames import WGS84_A_M, WGS84_E2, geodetic_from_ecef, rot_enu_ecef
from gbas_core.models.error_models import IONO_EARTH_RADIUS_M, IONO_SHELL_HEIGHT_M
from gbas_core.record import FloatArray

Reference = Literal["baseline", "ray", "pierce", "earth"]
"""How the distance of a signal path from a station is measured, see :meth:`SignalPaths.along`."""


@dataclass(frozen=True, kw_only=True)
class Station:
    """The point distances are measured from, and the local sphere below it.

    Attributes
    ----------
    ecef_m : (float, float, float)
        [m].
    shell_height_m : float
        Height of the ionospheric shell above the local sphere [m].
    """

    ecef_m: tuple[float, float, float]
    shell_height_m: float = IONO_SHELL_HEIGHT_M

    def __post_init__(self) -> None:
        if len(self.ecef_m) != 3 or not 6.3e6 <= math.hypot(*self.ecef_m) <= 6.5e6:
            raise ValueError(f"station: ecef_m = {self.ecef_m!r} is not on the Earth")
        if not 50_000.0 <= self.shell_height_m <= 2_000_000.0:
            raise ValueError(f"station: shell_height_m = {self.shell_height_m!r} is not within 50000 to 2e+06")

    @cached_property
    def position_m(self) -> FloatArray:
        """The point as an array, (3,)."""
        return np.array(self.ecef_m, dtype=np.float64)

    @cached_property
    def axes(self) -> FloatArray:
        """East, north and up, (3, 3), ECEF."""
        latitude, longitude, _ = geodetic_from_ecef(self.position_m)
        return rot_enu_ecef(latitude, longitude)

    @cached_property
    def centre_m(self) -> FloatArray:
        """Centre of the local sphere, (3,), ECEF [m]."""
        return np.asarray(self.position_m - IONO_EARTH_RADIUS_M * self.axes[2])

    @property
    def shell_radius_m(self) -> float:
        """Radius of the shell [m]."""
        return IONO_EARTH_RADIUS_M + self.shell_height_m

    def towards(self, direction_rad: float) -> FloatArray:
        """Horizontal unit vector (3,) at an azimuth, clockwise from north, ECEF."""
        return np.asarray(math.sin(direction_rad) * self.axes[0] + math.cos(direction_rad) * self.axes[1])


@dataclass(frozen=True, kw_only=True, eq=False)
class Delay:
    """What an effect adds to the signal paths; arrays (..., R, N_SATS).

    Attributes
    ----------
    delay_m : array
        Slant delay of the code on L1 [m].
    rate_mps : array
        Its derivative against time [m/s].
    """

    delay_m: FloatArray
    rate_mps: FloatArray

    def __add__(self, other: Delay) -> Delay:
        return Delay(delay_m=self.delay_m + other.delay_m, rate_mps=self.rate_mps + other.rate_mps)


@dataclass(frozen=True, kw_only=True, eq=False)
class Shell:
    """Where signal paths pierce the shell; arrays (..., R, N_SATS), vectors (..., R, 3, N_SATS).

    Attributes
    ----------
    obliquity, obliquity_rate
        Slant delay over vertical delay [-], [1/s].
    point_m, point_mps
        Pierce points from the centre of the local sphere, ECEF axes, and their velocities.
    """

    obliquity: FloatArray
    obliquity_rate: FloatArray
    point_m: FloatArray
    point_mps: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class SignalPaths:
    """Receivers and satellites at an instant, or at several (the leading axes ``...``).

    Attributes
    ----------
    gps_week : int
    tow_s : (...) array or float
        GPS time [s].
    since_start_s : (...) array or float
        Time since the start of the simulation [s].
    station : Station
    position_m, velocity_mps : (..., R, 3) arrays
        Receivers, ECEF.
    satellite_m, satellite_mps : (..., 3, N_SATS) or (..., R, 3, N_SATS) arrays
        Satellites, ECEF. Whether the axes are those at transmission or at reception is 6 microradians: 4 m at the
        shell for all receivers alike.
    """

    gps_week: int
    tow_s: FloatArray | float
    since_start_s: FloatArray | float
    station: Station
    position_m: FloatArray
    velocity_mps: FloatArray
    satellite_m: FloatArray
    satellite_mps: FloatArray

    def __post_init__(self) -> None:
        leading = self.position_m.shape[:-2]
        sky = {(*leading, 3), (*self.position_m.shape[:-1], 3)}
        if self.position_m.shape[-1] != 3 or self.velocity_mps.shape != self.position_m.shape:
            raise ValueError(f"signal paths: position_m is {self.position_m.shape}, not (..., R, 3) as velocity_mps")
        if self.satellite_m.shape[:-1] not in sky or self.satellite_mps.shape != self.satellite_m.shape:
            raise ValueError(
                f"signal paths: satellite_m is {self.satellite_m.shape}, not (..., 3, N_SATS) or (..., R, 3, N_SATS) "
                f"as satellite_mps, for receivers {self.position_m.shape}"
            )

    def each(self, time: FloatArray | float) -> FloatArray:
        """A time ``(...)`` with axes to broadcast against ``(..., R, N_SATS)``."""
        return np.asarray(time, dtype=np.float64)[..., np.newaxis, np.newaxis]

    # --- lines of sight

    @cached_property
    def _own(self) -> tuple[FloatArray, FloatArray]:
        """Receivers ready to broadcast, (..., R, 3, 1): from the centre of the local sphere, and velocities."""
        return (self.position_m - self.station.centre_m)[..., np.newaxis], self.velocity_mps[..., np.newaxis]

    @cached_property
    def _apart(self) -> tuple[FloatArray, FloatArray]:
        """From receivers to satellites (..., R, 3, N_SATS) [m], and the rate [m/s]."""
        pairs = []
        for satellite, own in ((self.satellite_m, self.position_m), (self.satellite_mps, self.velocity_mps)):
            shared = satellite.ndim == own.ndim
            pairs.append((satellite[..., np.newaxis, :, :] if shared else satellite) - own[..., np.newaxis])
        return pairs[0], pairs[1]

    @cached_property
    def los(self) -> FloatArray:
        """Unit vectors from receivers to satellites, (..., R, 3, N_SATS)."""
        return np.asarray(self._apart[0] / self._range_m[..., np.newaxis, :])

    @cached_property
    def los_rate(self) -> FloatArray:
        """Rates of the unit vectors [1/s]."""
        moving = self._apart[1]
        across = moving - self.los * _dot(self.los, moving)[..., np.newaxis, :]
        return np.asarray(across / self._range_m[..., np.newaxis, :])

    @cached_property
    def _range_m(self) -> FloatArray:
        return np.asarray(np.sqrt(_dot(self._apart[0], self._apart[0])))

    # --- receivers

    @cached_property
    def _vertical(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Up (..., R, 3) and its rate, height (..., R) and climb of the receivers."""
        latitude, longitude, height_m = geodetic_from_ecef(self.position_m)
        axes = rot_enu_ecef(latitude, longitude)
        enu_mps = np.sum(axes * self.velocity_mps[..., np.newaxis, :], axis=-1)
        flattened = 1.0 - WGS84_E2 * np.sin(latitude) ** 2
        prime_vertical_m = WGS84_A_M / np.sqrt(flattened)
        meridian_m = prime_vertical_m * (1.0 - WGS84_E2) / flattened
        turn_east = (enu_mps[..., 0] / (prime_vertical_m + height_m))[..., np.newaxis]
        turn_north = (enu_mps[..., 1] / (meridian_m + height_m))[..., np.newaxis]
        up_rate = turn_east * axes[..., 0, :] + turn_north * axes[..., 1, :]
        return axes[..., 2, :], up_rate, height_m, enu_mps[..., 2]

    @property
    def height_m(self) -> FloatArray:
        """Heights of the receivers above the ellipsoid, (..., R) [m]."""
        return self._vertical[2]

    @property
    def climb_mps(self) -> FloatArray:
        """Rates of the heights, (..., R) [m/s]."""
        return self._vertical[3]

    @cached_property
    def sin_elevation(self) -> FloatArray:
        """Sine of the elevation at each receiver, (..., R, N_SATS)."""
        return _dot(self._vertical[0][..., np.newaxis], self.los)

    @cached_property
    def sin_elevation_rate(self) -> FloatArray:
        """Rate of the sine of the elevation [1/s]."""
        up, up_rate = self._vertical[0], self._vertical[1]
        return _dot(up[..., np.newaxis], self.los_rate) + _dot(up_rate[..., np.newaxis], self.los)

    # --- shell

    @cached_property
    def from_station(self) -> SignalPaths:
        """The paths to a receiver that stands at the station: R = 1."""
        leading = self.position_m.shape[:-2]
        each = self.satellite_m.ndim > self.position_m.ndim
        satellite_m, satellite_mps = self.satellite_m, self.satellite_mps
        return replace(
            self,
            position_m=np.broadcast_to(self.station.position_m, (*leading, 1, 3)),
            velocity_mps=np.zeros((*leading, 1, 3)),
            satellite_m=satellite_m[..., :1, :, :] if each else satellite_m,
            satellite_mps=satellite_mps[..., :1, :, :] if each else satellite_mps,
        )

    @cached_property
    def shell(self) -> Shell:
        """Where the paths pierce the shell; NaN for satellites below the horizon of the local sphere.

        Notes
        -----
        With r from the centre, b = r.e and q = sqrt(b^2 + R^2 - r^2), the pierce point is r + (q - b) e and the
        cosine of the zenith angle there is q / R.
        """
        own, own_mps = self._own
        upward = _dot(own, self.los)
        upward = np.where(upward > 0.0, upward, np.nan)
        upward_rate = _dot(own_mps, self.los) + _dot(own, self.los_rate)
        root = np.sqrt(upward**2 + self.station.shell_radius_m**2 - _dot(own, own))
        root_rate = (upward * upward_rate - _dot(own, own_mps)) / root
        length, length_rate = root - upward, root_rate - upward_rate
        obliquity = self.station.shell_radius_m / root
        along, turned = length[..., np.newaxis, :], length_rate[..., np.newaxis, :]
        return Shell(
            obliquity=obliquity,
            obliquity_rate=-obliquity * root_rate / root,
            point_m=own + along * self.los,
            point_mps=own_mps + turned * self.los + along * self.los_rate,
        )

    @cached_property
    def pierce_ecef_m(self) -> FloatArray:
        """Pierce points, (..., R, 3, N_SATS), ECEF [m]."""
        return np.asarray(self.shell.point_m + self.station.centre_m[:, np.newaxis])

    @cached_property
    def pierce_longitude(self) -> tuple[FloatArray, FloatArray]:
        """Longitude of the pierce points [rad] and its rate [rad/s], (..., R, N_SATS)."""
        x, y = self.pierce_ecef_m[..., 0, :], self.pierce_ecef_m[..., 1, :]
        x_rate, y_rate = self.shell.point_mps[..., 0, :], self.shell.point_mps[..., 1, :]
        return np.arctan2(y, x), (x * y_rate - y * x_rate) / (x**2 + y**2)

    # --- distance

    def along(self, direction_rad: float, reference: Reference) -> tuple[FloatArray, FloatArray]:
        """How far each path is from the station in a direction.

        Parameters
        ----------
        direction_rad : float
            Azimuth at the station, clockwise from north [rad].
        reference : {"baseline", "ray", "pierce", "earth"}
            ``"baseline"``: the receiver's place in the station's horizontal plane, whatever its height.
            ``"ray"``: where the path, traced on towards the ground, meets the station's horizontal plane. Receivers
            with one pierce point have one distance, and between receivers at the station's height it is the baseline.
            ``"pierce"``: the pierce point from the pierce point of the station's own path to the same satellite, over
            the shell. In the plane of the path that is less than the baseline: sin(E) over the sine of the elevation at
            the pierce point, a quarter at 5 degrees.
            ``"earth"``: the pierce point from the point of the shell above the station, over the shell.

        Returns
        -------
        distance_m, rate_mps : arrays that broadcast against (..., R, N_SATS)
            NaN for satellites below the horizon where it depends on them.

        Notes
        -----
        Over the shell, distance is that from the great circle through the reference, across the direction: it grows
        by a metre a metre everywhere.
        """
        axis = self.station.towards(direction_rad)
        if reference == "baseline":
            return self._along_ground(axis)
        if reference == "ray":
            return self._along_rays(axis)
        distance_m, rate_mps = self._along_shell(axis)
        if reference == "earth":
            return distance_m, rate_mps
        own_m, own_mps = self.from_station._along_shell(axis)
        return distance_m - own_m, rate_mps - own_mps

    def _along_ground(self, axis: FloatArray) -> tuple[FloatArray, FloatArray]:
        away = (self.position_m - self.station.position_m)[..., np.newaxis]
        return _dot(axis[:, np.newaxis], away), _dot(axis[:, np.newaxis], self.velocity_mps[..., np.newaxis])

    def _along_rays(self, axis: FloatArray) -> tuple[FloatArray, FloatArray]:
        """With r from the station, d = s - r towards the satellite: n.r - (u.r) (n.d) / (u.d)."""
        distance_m, rate_mps = self._along_ground(axis)
        up = self.station.axes[2]
        height_m, climb_mps = self._along_ground(up)
        rise, rise_rate = (_dot(up[:, np.newaxis], apart) for apart in self._apart)
        run, run_rate = (_dot(axis[:, np.newaxis], apart) for apart in self._apart)
        slope = run / np.where(rise > 0.0, rise, np.nan)
        slope_rate = (run_rate - slope * rise_rate) / rise
        return distance_m - height_m * slope, rate_mps - climb_mps * slope - height_m * slope_rate

    def _along_shell(self, axis: FloatArray) -> tuple[FloatArray, FloatArray]:
        sine = _dot(axis[:, np.newaxis], self.shell.point_m) / self.station.shell_radius_m
        rate = _dot(axis[:, np.newaxis], self.shell.point_mps)
        return self.station.shell_radius_m * np.arcsin(sine), rate / np.sqrt(1.0 - sine**2)


def masked(delay: Delay, satellites: NDArray[np.bool_] | None) -> Delay:
    """The delay for the given satellites and none for the others; None is all of them."""
    if satellites is None:
        return delay
    return Delay(delay_m=np.where(satellites, delay.delay_m, 0.0), rate_mps=np.where(satellites, delay.rate_mps, 0.0))


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Scalar products over the xyz axis, which is the last but one. In a fixed order: the same bits everywhere."""
    result: FloatArray = a[..., 0, :] * b[..., 0, :] + a[..., 1, :] * b[..., 1, :] + a[..., 2, :] * b[..., 2, :]
    return result
