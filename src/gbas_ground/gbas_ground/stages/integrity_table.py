"""The integrity record: what may be broadcast, and why the rest may not."""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_core.record import BoolArray
from gbas_ground.claims.orbit_claim import claimed_decorrelation
from gbas_ground.params import GroundParams
from gbas_ground.stages.decide import Decided
from gbas_ground.stages.kernels.status import by_receiver, on_axis, where_row
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
    state, cause = decided.status.state, decided.status.cause
    elevation_rad = corrected.inputs.elevation_rad
    rows = where_row(np.stack([state, cause, elevation_rad, known.current.iod, known.crc]), state, cause)
    # the first products are those of the station's smoothing constants, in their order; it makes no others
    external = bool(params.ephemeris.external_monitor)
    claimed = (params.ephemeris.p, params.ephemeris.p_d or params.ephemeris.p)
    p = np.stack([claimed_decorrelation(orbit_bound, each, external) for each in claimed])
    sigma_m = np.stack([protection.inflated_m(corrections.sigmas_m[0]), corrections.sigmas_m[2]])
    b_m, receiver_used = by_receiver(corrections.b_m, used, state, cause, _N_PRODUCTS, MAX_REFERENCE_RECEIVERS)
    return IntegrityEpoch(
        gps_week=now.gps_week,
        tow_s=now.tow_s,
        n_receivers=float(n_receivers),
        sigma_vert_iono_gradient=protection.sigma_vig,
        state=rows[0],
        cause=rows[1],
        elevation_rad=rows[2],
        p_ephemeris=on_axis(p, state, _N_PRODUCTS),
        iod=rows[3],
        ephemeris_crc=rows[4],
        prc_m=on_axis(corrections.prc_m, state, _N_PRODUCTS),
        rrc_mps=on_axis(corrections.rrc_mps, state, _N_PRODUCTS),
        sigma_pr_gnd_m=on_axis(sigma_m, state, _N_PRODUCTS),
        sigma_pr_gnd_d_m=on_axis(corrections.sigmas_m[1:2], state, 1)[0],
        b_m=b_m,
        receiver_used=receiver_used,
    )
