# mypy: disable-error-code="no-untyped-call"
"""What each reference receiver should measure, from its surveyed position and the broadcast ephemerides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.frames import rot_enu_ecef
from gbas_core.gnss.kernels.orbits import predicted_ranges
from gbas_core.ranging.predicted_ranges import PredictedRanges
from gbas_core.record import FloatArray
from gbas_core.signals import L1
from gbas_ground.params import GroundParams


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
    band_code_m = np.ascontiguousarray(code_m)
    expected, directions = predicted_ranges(
        ephemeris.values, int(gps_week), float(tow_s), band_code_m, site.positions_m, site.enu, int(band)
    )
    return PredictedRanges(*expected, *directions)
