"""The integrity record: what may be broadcast, and why the rest may not."""

from __future__ import annotations

import numpy as np

from gbas_core.record import FloatArray
from gbas_core.satellites import missing
from gbas_ground.claims.orbit_claim import claimed_decorrelation
from gbas_ground.params import GroundParams
from gbas_ground.stages.decide import Decided
from gbas_msgs_py.codes import ChannelState, ExclusionCause
from gbas_msgs_py.products import PRODUCTS
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS, IntegrityEpoch


def integrity_of(decided: Decided, params: GroundParams) -> IntegrityEpoch:
    """The record of an epoch: a row for every satellite in view, corrections where they are usable."""
    corrected, status, protection = decided.corrected, decided.status, decided.protection
    tracked, corrections = corrected.monitored.tracked, corrected.corrections
    now, known, orbit_bound = tracked.received.now, tracked.received.known, corrected.monitored.signals.orbit_bound
    usable = status.state == ChannelState.USABLE
    row = (status.state != ChannelState.NOT_TRACKED) | (status.cause != ExclusionCause.NONE)

    def of_row(values: FloatArray) -> FloatArray:
        return np.where(row, values, np.nan)

    def of_usable(values: FloatArray) -> FloatArray:
        return np.where(usable, values, np.nan)

    external = bool(params.ephemeris.external_monitor)
    # the first products are those of the station's smoothing constants, in their order; it makes no others
    made = len(corrections.prc_m)
    claimed = (params.ephemeris.p, params.ephemeris.p_d or params.ephemeris.p)
    p = [claimed_decorrelation(orbit_bound, each, external=external) for each in claimed]
    sigma_m = [protection.inflated_m(corrections.sigmas.gnd_m), corrections.sigmas.gnd_30_m]
    used = of_row((corrections.used & usable).astype(np.float64))
    return IntegrityEpoch(
        gps_week=now.gps_week,
        tow_s=now.tow_s,
        n_receivers=float((corrections.used & usable).any(axis=1).sum()),
        sigma_vert_iono_gradient=protection.sigma_vig,
        state=of_row(status.state),
        cause=of_row(status.cause),
        elevation_rad=of_row(corrected.inputs.elevation_rad),
        p_ephemeris=_on_axis(of_usable(np.array(p)), len(PRODUCTS)),
        iod=of_row(known.current.iod),
        ephemeris_crc=of_row(known.crc),
        prc_m=_on_axis(of_usable(corrections.prc_m), len(PRODUCTS)),
        rrc_mps=_on_axis(of_usable(corrections.rrc_mps), len(PRODUCTS)),
        sigma_pr_gnd_m=_on_axis(of_usable(np.array(sigma_m)), len(PRODUCTS)),
        sigma_pr_gnd_d_m=of_usable(corrections.sigmas.gnd_d_m),
        b_m=_on_axis(of_usable(corrections.b_m), len(PRODUCTS), MAX_REFERENCE_RECEIVERS),
        receiver_used=_on_axis(np.stack([used] * made), len(PRODUCTS), MAX_REFERENCE_RECEIVERS),
    )


def _on_axis(values: FloatArray, *shape: int) -> FloatArray:
    """Values of what the station has, on axes that have room for more."""
    result = missing(*shape)
    result[tuple(slice(size) for size in values.shape[:-1])] = values
    return result
