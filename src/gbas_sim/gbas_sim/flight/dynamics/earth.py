"""The Earth under the aircraft: radii of curvature, gravity, and what its turning does to velocities seen from it.

Source: WGS 84, NGA.STND.0036 (2014), chapters 3 and 4; Groves, Principles of GNSS, Inertial, and Multisensor Integrated
Navigation Systems, 2nd edition (2013), 2.3 and 5.4.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_core.gnss.frames import EARTH_RATE_RADPS, WGS84_A_M, WGS84_B_M, WGS84_E2, WGS84_F
from gbas_core.record import FloatArray

# Known: normal gravity at the equator, Somigliana's constant, and m = omega^2 a^2 b / GM (NGA.STND.0036 table 3.5-3.7).
_GRAVITY_EQUATOR_MPS2: Final = 9.780_325_3359
_SOMIGLIANA: Final = 0.001_931_852_652_41
_GM_M3PS2: Final = 3.986_004_418e14
_M: Final = EARTH_RATE_RADPS**2 * WGS84_A_M**2 * WGS84_B_M / _GM_M3PS2


def radii_of_curvature_m(lat_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Radii of curvature of the ellipsoid, in the meridian and across it [m], at geodetic latitudes (...) [rad].

    Source: Groves, equations (2.105) and (2.106).
    """
    shrink = 1.0 - WGS84_E2 * np.sin(lat_rad) ** 2
    transverse = WGS84_A_M / np.sqrt(shrink)
    return transverse * (1.0 - WGS84_E2) / shrink, transverse


def gravity_mps2(lat_rad: FloatArray, height_m: FloatArray) -> FloatArray:
    """Normal gravity [m/s2], attraction and centrifugal acceleration together, along the ellipsoid's normal.

    Parameters
    ----------
    lat_rad, height_m : (...) arrays
        Geodetic latitude [rad], height above the ellipsoid [m].

    Notes
    -----
    Its direction is taken as the ellipsoid's normal at any height; at 10 km it is 8e-6 rad off.

    Source: NGA.STND.0036, equations (4-1) and (4-3).
    """
    sin2 = np.sin(lat_rad) ** 2
    surface = _GRAVITY_EQUATOR_MPS2 * (1.0 + _SOMIGLIANA * sin2) / np.sqrt(1.0 - WGS84_E2 * sin2)
    relative = height_m / WGS84_A_M
    result: FloatArray = surface * (
        1.0 - 2.0 * (1.0 + WGS84_F + _M - 2.0 * WGS84_F * sin2) * relative + 3.0 * relative**2
    )
    return result


def turning_acceleration(
    lat_rad: FloatArray, height_m: FloatArray, east_mps: FloatArray, north_mps: FloatArray, up_mps: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Change of the east, north and up components of a velocity over the ground, with no force acting [m/s2].

    Coriolis acceleration and the turning of the local axes as the aircraft moves: ``-(2 w_ie + w_el) x v``.

    Parameters
    ----------
    lat_rad, height_m, east_mps, north_mps, up_mps : (...) arrays
        Geodetic latitude [rad], height [m], velocity over the ground [m/s].

    Notes
    -----
    The equations of the paper leave these out. At 200 m/s they come to 0.03 m/s2: a bank of 0.2 degrees, and a straight
    flight that is not a rhumb line.

    Source: Groves, equations (5.41) to (5.43) and (5.54).
    """
    meridian, transverse = radii_of_curvature_m(lat_rad)
    sin_lat, cos_lat = np.sin(lat_rad), np.cos(lat_rad)
    # Rates of rotation: twice the Earth's, and that of the local axes over the Earth.
    over_east = -north_mps / (meridian + height_m)
    turn_north = east_mps / (transverse + height_m)
    over_north = 2.0 * EARTH_RATE_RADPS * cos_lat + turn_north
    over_up = 2.0 * EARTH_RATE_RADPS * sin_lat + turn_north * sin_lat / cos_lat
    return (
        over_up * north_mps - over_north * up_mps,
        over_east * up_mps - over_up * east_mps,
        over_north * east_mps - over_east * north_mps,
    )
