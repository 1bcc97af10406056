"""The standard atmosphere from below sea level to 20 km.

Height above the ellipsoid stands for height above the sea: the geoid is left out, as it is nowhere else in the suite.

Source: ICAO Doc 7488/3, Manual of the ICAO Standard Atmosphere (1993), equations (8) to (14) and table A to D.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from gbas_core.record import FloatArray

# Known: primary constants of Doc 7488/3, tables A, B and D.
SEA_LEVEL_TEMPERATURE_K: Final = 288.15
SEA_LEVEL_PRESSURE_PA: Final = 101_325.0
SEA_LEVEL_DENSITY_KGPM3: Final = 1.225
STANDARD_GRAVITY_MPS2: Final = 9.80665
GAS_CONSTANT_JPKGK: Final = 287.05287
HEAT_RATIO: Final = 1.4
LAPSE_KPM: Final = 0.0065
TROPOPAUSE_M: Final = 11_000.0
EARTH_RADIUS_M: Final = 6_356_766.0
HIGHEST_M: Final = 20_000.0
"""Highest geopotential height for which the formulas here hold [m]."""

_EXPONENT: Final = STANDARD_GRAVITY_MPS2 / (GAS_CONSTANT_JPKGK * LAPSE_KPM)
_TROPOPAUSE_K: Final = SEA_LEVEL_TEMPERATURE_K - LAPSE_KPM * TROPOPAUSE_M
_SCALE_M: Final = GAS_CONSTANT_JPKGK * _TROPOPAUSE_K / STANDARD_GRAVITY_MPS2


@dataclass(frozen=True, kw_only=True, eq=False)
class Air:
    """Air at heights (...).

    Attributes
    ----------
    temperature_k, pressure_pa, density_kgpm3, sound_mps : (...) arrays
        Temperature [K], pressure [Pa], density [kg/m3], speed of sound [m/s].
    """

    temperature_k: FloatArray
    pressure_pa: FloatArray
    density_kgpm3: FloatArray
    sound_mps: FloatArray


def geopotential_m(height_m: FloatArray) -> FloatArray:
    """Geopotential height [m] of a geometric height [m]. Source: Doc 7488/3, equation (8)."""
    result: FloatArray = EARTH_RADIUS_M * height_m / (EARTH_RADIUS_M + height_m)
    return result


def standard_air(height_m: FloatArray) -> Air:
    """Standard air at geometric heights (...) [m], see :func:`air_at_geopotential`."""
    return air_at_geopotential(geopotential_m(height_m))


def air_at_geopotential(geopotential_height_m: FloatArray) -> Air:
    """Standard air at geopotential heights.

    Parameters
    ----------
    geopotential_height_m : (...) array
        From -5000 to 20 000 [m]; above, the temperature stays at that of the lower stratosphere.

    Returns
    -------
    Air

    Source: ICAO Doc 7488/3, equations (11) to (14), the troposphere's with its height limited to the tropopause times
    the isothermal layer's.
    """
    temperature = SEA_LEVEL_TEMPERATURE_K - LAPSE_KPM * np.minimum(geopotential_height_m, TROPOPAUSE_M)
    above = np.maximum(geopotential_height_m - TROPOPAUSE_M, 0.0)
    ratio = (temperature / SEA_LEVEL_TEMPERATURE_K) ** _EXPONENT * np.exp(-above / _SCALE_M)
    pressure = SEA_LEVEL_PRESSURE_PA * ratio
    gas = GAS_CONSTANT_JPKGK * temperature
    return Air(
        temperature_k=temperature,
        pressure_pa=pressure,
        density_kgpm3=pressure / gas,
        sound_mps=np.sqrt(HEAT_RATIO * gas),
    )
