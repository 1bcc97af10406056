"""What each reference receiver should measure, from its surveyed position and the broadcast ephemerides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.frames import rot_enu_ecef
from gbas_core.gnss.orbits import rotated_range, transmit_place
from gbas_core.record import FloatArray
from gbas_core.signals import L1
from gbas_ground.params import GroundParams

# Pseudorange assumed for the elevation of a satellite whose range is not known: it moves the satellite by less than
# 70 m, that is the elevation by less than 0.0002 degrees.
_MEAN_RANGE_M: Final = 23.0e6


@dataclass(frozen=True, kw_only=True, eq=False)
class Site:
    """Positions a station computes with; made once from the parameters.

    Attributes
    ----------
    positions_m : (R + 1, 3) array
        Reference receivers and, last, the reference point, ECEF [m].
    enu : (3, 3) array
        Unit vectors east, north and up at the reference point, ECEF.
    """

    positions_m: FloatArray
    enu: FloatArray


def site_of(params: GroundParams) -> Site:
    """Positions of a station."""
    positions = np.concatenate([params.receiver_positions_m(), params.reference_point_m()[np.newaxis]])
    return Site(positions_m=positions, enu=rot_enu_ecef(params.station.latitude_rad, params.station.longitude_rad))


class PredictedRanges(NamedTuple):
    """Expected ranges and clocks ``(R, N)`` [m], [s]; elevations and azimuths at the reference point ``(N,)`` [rad]."""

    range_m: FloatArray
    clock_s: FloatArray
    elevation_rad: FloatArray
    azimuth_rad: FloatArray


def predict_ranges(
    ephemeris: Ephemeris, gps_week: int, tow_s: float, code_m: FloatArray, site: Site, band: int = L1
) -> PredictedRanges:
    """Geometric ranges with Earth rotation, satellite clocks, elevations and azimuths.

    Parameters
    ----------
    ephemeris : Ephemeris
    gps_week, tow_s
        Time tag of the observations.
    code_m : (R, N) array
        Raw pseudoranges: the time of transmission follows from them, whatever the receiver clock [m]. Where there is
        none, range and clock are those of a mean flight time, of no use but for the elevation.
    site : Site
    band : int
        Band of the pseudoranges.
    """
    own = np.concatenate([code_m, np.full((1, code_m.shape[-1]), np.nan)])
    state = transmit_place(ephemeris, gps_week, tow_s, np.where(np.isfinite(own), own, _MEAN_RANGE_M), band)
    range_m, los = rotated_range(site.positions_m, state.position_m)
    east, north, up = (los[-1, 0] * axis[0] + los[-1, 1] * axis[1] + los[-1, 2] * axis[2] for axis in site.enu)
    return PredictedRanges(range_m[:-1], state.clock_s[:-1], np.arcsin(up), np.arctan2(east, north))
