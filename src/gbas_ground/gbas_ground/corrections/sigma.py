"""Sigmas of the broadcast corrections."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from gbas_core.models.error_models import GROUND_CURVES
from gbas_core.record import FloatArray
from gbas_core.satellites import CLOCK_GROUPS, N_SATS
from gbas_ground.corrections.kernels.consistency import Settings, broadcast_sigmas_m
from gbas_ground.params import GroundParams

MAX_SIGMA_M: Final = 5.08
"""Largest sigma a message can carry. Source: ICAO Annex 10 vol. I, table B-63."""

_NOTHING: Final[FloatArray] = np.empty((0, N_SATS))


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
    return Sigmas(
        *broadcast_sigmas_m(elevation_rad, count, measured_sigma_m(params, elevation_rad), settings_of(params))
    )


def measured_sigma_m(params: GroundParams, elevation_rad: FloatArray) -> FloatArray:
    """One receiver's measured sigma ``(1, N)`` [m]; no row where the station has a designator instead."""
    accuracy = params.accuracy
    if not accuracy.sigma_elevation_rad:
        return _NOTHING
    return np.interp(elevation_rad, accuracy.sigma_elevation_rad, accuracy.sigma_m)[np.newaxis]


def settings_of(params: GroundParams) -> Settings:
    """What the station's corrections are formed and judged with."""
    accuracy, monitors = params.accuracy, params.monitors
    curves = [(each.a0_m, each.a1_m, each.theta0_deg, each.a2_m) for each in GROUND_CURVES[accuracy.designator]]
    return Settings(
        constellation=CLOCK_GROUPS.argmax(axis=0).astype(np.int64),
        curves=np.array(curves),
        n_constellations=len(CLOCK_GROUPS),
        min_common=int(monitors.min_common_satellites),
        min_receivers=int(params.receivers.minimum),
        plain=monitors.clock_weighting == "plain",
        mask_rad=float(monitors.elevation_mask_rad),
        inflation=float(accuracy.inflation),
        inflation_iono=float(accuracy.inflation_iono),
        factor_30s=float(accuracy.factor_30s),
        k_b=float(params.b_value.k_b),
        max_prc_m=float(params.correction_limits.max_prc_m),
        max_rrc_mps=float(params.correction_limits.max_rrc_mps),
        readmission_share=float(monitors.readmission_share),
    )
