"""Sigmas of the broadcast corrections."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from gbas_core.models.error_models import sigma_pr_gnd
from gbas_core.record import FloatArray
from gbas_ground.params import GroundParams

MAX_SIGMA_M: Final = 5.08
"""Largest sigma a message can carry. Source: ICAO Annex 10 vol. I, table B-63."""


class Sigmas(NamedTuple):
    """Sigmas ``(N,)`` [m], NaN where there is none.

    `gnd_m` and `gnd_d_m` belong to the 100 s corrections, the former with inflation for anomalous ionosphere;
    `gnd_30_m` belongs to the 30 s corrections.
    """

    gnd_m: FloatArray
    gnd_d_m: FloatArray
    gnd_30_m: FloatArray


def broadcast_sigmas(params: GroundParams, elevation_rad: FloatArray, count: FloatArray) -> Sigmas:
    """Sigmas for the number of receivers actually behind each correction.

    Parameters
    ----------
    params : GroundParams
        Designator, or a measured table of one receiver's sigma, which is interpolated in elevation, held beyond its
        last node and divided by sqrt(M).
    elevation_rad : (N,) array
    count : (N,) array
        Receivers used on each satellite, M_i.

    Source: curves, :func:`gbas_core.models.error_models.sigma_pr_gnd`; composition, ICAO Annex 10 vol. I, B.3.6.4.2.4
    (known). The factor of the 30 s corrections, sqrt(100/30), is that of white noise through the two filters:
    uncertain, ours.
    """
    if params.accuracy.sigma_elevation_rad:
        single = np.interp(elevation_rad, params.accuracy.sigma_elevation_rad, params.accuracy.sigma_m)
        low = elevation_rad < params.monitors.elevation_mask_rad
        base = np.where((count > 0) & ~low, single / np.sqrt(np.maximum(count, 1)), np.nan)
    else:
        base = sigma_pr_gnd(
            params.accuracy.designator, elevation_rad, count, mask_rad=params.monitors.elevation_mask_rad
        )
    gnd_d = params.accuracy.inflation * base
    return Sigmas(params.accuracy.inflation_iono * gnd_d, gnd_d, params.accuracy.factor_30s * gnd_d)
