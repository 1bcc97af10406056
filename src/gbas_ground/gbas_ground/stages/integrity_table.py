"""The integrity record: what may be broadcast, and why the rest may not."""

from __future__ import annotations

from typing import Final

from gbas_core.record import BoolArray
from gbas_ground.params import GroundParams
from gbas_ground.stages.decide import Decided
from gbas_ground.stages.kernels.integrity import claims_of_usable, corrections_of_usable, rows_of
from gbas_msgs_py.products import PRODUCTS
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS, IntegrityEpoch

_N_PRODUCTS: Final = len(PRODUCTS)


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
