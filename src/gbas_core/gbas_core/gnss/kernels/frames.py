# mypy: disable-error-code="no-untyped-call"
"""The formulas of :mod:`gbas_core.gnss.frames`, on single numbers and vectors."""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_core.compiled import compiled

# Source: WGS 84, NGA.STND.0036 table 3.1.
WGS84_A_M: Final = 6_378_137.0
WGS84_F: Final = 1.0 / 298.257223563
WGS84_E2: Final = WGS84_F * (2.0 - WGS84_F)
WGS84_B_M: Final = WGS84_A_M * (1.0 - WGS84_F)

_GEODETIC_ITERATIONS: Final = 3  # of Bowring's formula; the error is below 1e-9 m up to 50 000 km


@compiled
def geodetic(x_m, y_m, z_m):  # type: ignore[no-untyped-def]
    """Latitude, longitude [rad] and height [m] of an ECEF position; see ``geodetic_from_ecef``."""
    horizontal = np.hypot(x_m, y_m)
    sin_b, cos_b = z_m, (1.0 - WGS84_F) * horizontal
    norm = np.hypot(sin_b, cos_b)
    up = out = np.nan
    for _ in range(_GEODETIC_ITERATIONS):
        sin_b, cos_b = sin_b / norm, cos_b / norm
        up = z_m + WGS84_E2 / (1.0 - WGS84_E2) * WGS84_B_M * sin_b**3
        out = horizontal - WGS84_E2 * WGS84_A_M * cos_b**3
        sin_b, cos_b = (1.0 - WGS84_F) * up, out
        norm = np.hypot(sin_b, cos_b)
    latitude = np.arctan2(up, out)
    sin_lat, cos_lat = np.sin(latitude), np.cos(latitude)
    height_m = horizontal * cos_lat + z_m * sin_lat - WGS84_A_M * np.sqrt(1.0 - WGS84_E2 * sin_lat**2)
    return latitude, np.arctan2(y_m, x_m), height_m


@compiled
def fill_enu(latitude, longitude, rot):  # type: ignore[no-untyped-def]
    """Fill in the rotation (3, 3) from ECEF to ENU axes."""
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    rot[0, 0], rot[0, 1], rot[0, 2] = -sin_lon, cos_lon, 0.0
    rot[1, 0], rot[1, 1], rot[1, 2] = -sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat
    rot[2, 0], rot[2, 1], rot[2, 2] = cos_lat * cos_lon, cos_lat * sin_lon, sin_lat


@compiled
def azimuth_elevation(rot_enu, x, y, z):  # type: ignore[no-untyped-def]
    """Azimuth and elevation [rad] of a direction in the frame that ``rot_enu`` (3, 3) rotates from."""
    east = rot_enu[0, 0] * x + rot_enu[0, 1] * y + rot_enu[0, 2] * z
    north = rot_enu[1, 0] * x + rot_enu[1, 1] * y + rot_enu[1, 2] * z
    up = rot_enu[2, 0] * x + rot_enu[2, 1] * y + rot_enu[2, 2] * z
    return np.arctan2(east, north), np.arctan2(up, np.hypot(east, north))


@compiled
def all_geodetic(xyz_m):  # type: ignore[no-untyped-def]
    """Latitudes, longitudes and heights ``(3, n)`` of positions ``(n, 3)``."""
    result = np.empty((3, xyz_m.shape[0]))
    for i in range(xyz_m.shape[0]):
        result[0, i], result[1, i], result[2, i] = geodetic(xyz_m[i, 0], xyz_m[i, 1], xyz_m[i, 2])
    return result


@compiled
def all_enu(latitude, longitude):  # type: ignore[no-untyped-def]
    """Rotations ``(n, 3, 3)`` from ECEF to ENU axes."""
    rot = np.empty((latitude.shape[0], 3, 3))
    for i in range(latitude.shape[0]):
        fill_enu(latitude[i], longitude[i], rot[i])
    return rot
