# mypy: disable-error-code="no-untyped-call"
"""Earth-fixed frames: geodetic coordinates, local axes, lines of sight and elevations.

ECEF is WGS 84 (for Galileo GTRF, which agrees within centimetres). Receiver positions are ``(..., 3)``; vectors to
satellites are ``(..., 3, n_sats)``: the xyz axis comes before the satellite axis. ENU is east, north, up.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.gnss.kernels.frames import WGS84_A_M, WGS84_B_M, WGS84_E2, WGS84_F, all_enu, all_geodetic
from gbas_core.record import FloatArray

__all__ = [
    "EARTH_RATE_RADPS",
    "GM_GALILEO_M3PS2",
    "GM_GPS_M3PS2",
    "WGS84_A_M",
    "WGS84_B_M",
    "WGS84_E2",
    "WGS84_F",
    "azimuth_elevation",
    "ecef_from_geodetic",
    "geodetic_from_ecef",
    "los_and_range",
    "rot_enu_ecef",
]

# Source: IS-GPS-200N table 20-IV; Galileo OS SIS ICD 2.1, 5.1.1 (the same rate).
EARTH_RATE_RADPS: Final = 7.292_115_146_7e-5
GM_GPS_M3PS2: Final = 3.986_005e14
GM_GALILEO_M3PS2: Final = 3.986_004_418e14


def ecef_from_geodetic(lat_rad: ArrayLike, lon_rad: ArrayLike, height_m: ArrayLike) -> FloatArray:
    """ECEF position of geodetic coordinates.

    Parameters
    ----------
    lat_rad, lon_rad, height_m : (...) arrays
        Geodetic latitude and longitude [rad], height above the ellipsoid [m].

    Returns
    -------
    (..., 3) array
        Position [m].
    """
    lat = np.asarray(lat_rad, dtype=np.float64)
    lon = np.asarray(lon_rad, dtype=np.float64)
    height = np.asarray(height_m, dtype=np.float64)
    sin_lat, cos_lat = np.sin(lat), np.cos(lat)
    prime_vertical = WGS84_A_M / np.sqrt(1.0 - WGS84_E2 * sin_lat**2)
    horizontal = (prime_vertical + height) * cos_lat
    z = (prime_vertical * (1.0 - WGS84_E2) + height) * sin_lat
    return np.stack(np.broadcast_arrays(horizontal * np.cos(lon), horizontal * np.sin(lon), z), axis=-1)


def geodetic_from_ecef(xyz_m: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Geodetic latitude [rad], longitude [rad] and height [m] of ECEF positions ``(..., 3)``.

    Source: Bowring, Transformation from spatial to geographical coordinates, Survey Review 23 (1976), iterated a fixed
    number of times on the reduced latitude.
    """
    xyz = np.ascontiguousarray(xyz_m, dtype=np.float64)
    lat, lon, height = all_geodetic(xyz.reshape(-1, 3)).reshape(3, *xyz.shape[:-1])
    return lat, lon, height


def rot_enu_ecef(lat_rad: ArrayLike, lon_rad: ArrayLike) -> FloatArray:
    """Rotation from ECEF to ENU axes at a geodetic latitude and longitude [rad], shape ``(..., 3, 3)``."""
    lat, lon = np.broadcast_arrays(np.asarray(lat_rad, dtype=np.float64), np.asarray(lon_rad, dtype=np.float64))
    rot: FloatArray = all_enu(np.array(lat).ravel(), np.array(lon).ravel()).reshape(*lat.shape, 3, 3)
    return rot


def los_and_range(receiver_xyz_m: FloatArray, sat_xyz_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit vectors from receivers to satellites, and distances, in one frame (no Earth rotation in flight).

    Parameters
    ----------
    receiver_xyz_m : (..., 3) array
        Receiver positions [m].
    sat_xyz_m : (..., 3, n_sats) array
        Satellite positions [m]; leading axes broadcast against the receivers'.

    Returns
    -------
    los : (..., 3, n_sats) array
        Unit vectors, from receiver to satellite.
    range_m : (..., n_sats) array
        Distances [m].
    """
    delta = sat_xyz_m - np.asarray(receiver_xyz_m, dtype=np.float64)[..., :, np.newaxis]
    range_m = np.sqrt(delta[..., 0, :] ** 2 + delta[..., 1, :] ** 2 + delta[..., 2, :] ** 2)
    return delta / range_m[..., np.newaxis, :], range_m


def azimuth_elevation(los_enu: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Azimuth (clockwise from north, -pi to pi) and elevation [rad] of ENU unit vectors ``(..., 3, n_sats)``."""
    east, north, up = los_enu[..., 0, :], los_enu[..., 1, :], los_enu[..., 2, :]
    return np.arctan2(east, north), np.arctan2(up, np.hypot(east, north))
