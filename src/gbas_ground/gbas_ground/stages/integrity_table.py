"""The integrity record: what may be broadcast, and why the rest may not."""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_core.record import BoolArray
from gbas_ground.corrections.second_band import SecondBandSettings
from gbas_ground.params import GroundParams
from gbas_ground.stages.decide import Decided
from gbas_ground.stages.kernels.integrity import claims_of_usable, corrections_of_usable, rows_of
from gbas_ground.stages.second_band import SecondBand
from gbas_msgs_py.products import L1_30, L1_100, PRODUCTS
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS, IntegrityEpoch

_N_PRODUCTS: Final = len(PRODUCTS)
OF_L1: Final = (L1_100, L1_30)
"""Products of L1 in the order of the smoothing constants."""


def integrity_of(decided: Decided, used: BoolArray, n_receivers: int, params: GroundParams) -> IntegrityEpoch:
    """The record of an epoch: a row for every satellite in view, corrections where they are usable.

    Parameters
    ----------
    decided : Decided
    used : (R, N) bool array
        Channels behind the corrections of usable satellites, of so many receivers.
    n_receivers : int
    params : GroundParams
    """
    corrected, protection = decided.corrected, decided.protection
    tracked, corrections = corrected.monitored.tracked, corrected.corrections
    now, known, orbit_bound = tracked.received.now, tracked.received.known, corrected.monitored.signals.orbit_bound
    state, cause, elevation_rad = decided.status.state, decided.status.cause, corrected.inputs.elevation_rad
    rows = rows_of(state, cause, elevation_rad, known.current.iod, known.crc)
    claims, sent_m = params.ephemeris, protection.inflated_m(corrections.sigmas_m[0])
    p, sigma_m, sigma_d_m = claims_of_usable(
        state, orbit_bound, (claims.p, claims.p_d or claims.p), bool(claims.external_monitor), sent_m,
        corrections.sigmas_m, _N_PRODUCTS,
    )  # fmt: skip
    prc_m, rrc_mps, b_m, receiver_used = corrections_of_usable(
        state, cause, used, corrections.prc_m, corrections.rrc_mps, corrections.b_m, _N_PRODUCTS,
        MAX_REFERENCE_RECEIVERS,
    )  # fmt: skip
    return IntegrityEpoch(
        gps_week=now.gps_week,
        tow_s=now.tow_s,
        n_receivers=float(n_receivers),
        sigma_vert_iono_gradient=protection.sigma_vig,
        state=rows[0],
        cause=rows[1],
        elevation_rad=rows[2],
        p_ephemeris=p,
        iod=rows[3],
        ephemeris_crc=rows[4],
        prc_m=prc_m,
        rrc_mps=rrc_mps,
        sigma_pr_gnd_m=sigma_m,
        sigma_pr_gnd_d_m=sigma_d_m,
        b_m=b_m,
        receiver_used=receiver_used,
    )


def with_second_band(integrity: IntegrityEpoch, second: SecondBand, settings: SecondBandSettings) -> IntegrityEpoch:
    """The record with the corrections of the second band too: those that are broadcast, where they are usable.

    An orbit's error is the same on every band: P is that of the L1 correction of the same smoothing constant.
    """
    corrections, usable = second.corrections, second.usable
    count = corrections.b_m.shape[1]
    used = np.where(np.isfinite(integrity.state), np.where(usable, corrections.used, False), np.nan)
    for place, constant in zip(settings.products, settings.constants, strict=True):
        integrity.p_ephemeris[place] = np.where(usable, integrity.p_ephemeris[OF_L1[constant]], np.nan)
        integrity.prc_m[place] = np.where(usable, corrections.prc_m[constant], np.nan)
        integrity.rrc_mps[place] = np.where(usable, corrections.rrc_mps[constant], np.nan)
        integrity.sigma_pr_gnd_m[place] = np.where(usable, second.sigmas_m[constant], np.nan)
        integrity.b_m[place, :count] = np.where(usable, corrections.b_m[constant], np.nan)
        integrity.receiver_used[place, :count] = used
    return integrity
