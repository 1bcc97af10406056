"""What each satellite may be used for, and the integrity record that says so."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS, missing
from gbas_ground.channels.ephemerides import EphemerisState
from gbas_ground.channels.tracking import Tracks
from gbas_ground.claims.orbit_claim import claimed_decorrelation
from gbas_ground.consistency import CorrectionInputs, Corrections, Exclusions
from gbas_ground.corrections.sigma import MAX_SIGMA_M
from gbas_ground.ionosphere.protection import Protection
from gbas_ground.params import GroundParams
from gbas_msgs_py.codes import FIRST_LATCHED, ExclusionCause
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS, ChannelState, IntegrityEpoch


@dataclass(frozen=True, kw_only=True, eq=False)
class SatelliteStatus:
    """State (:class:`ChannelState`) and cause (:class:`ExclusionCause`) of every satellite, ``(N,)``."""

    state: FloatArray
    cause: FloatArray


def satellite_status(
    tracked: BoolArray,
    tracks: Tracks,
    known: EphemerisState,
    correction_inputs: CorrectionInputs,
    corrections: Corrections,
    exclusions: Exclusions,
    params: GroundParams,
) -> SatelliteStatus:
    """Condition of every satellite; of several reasons against its use the first in the list below is told.

    Parameters
    ----------
    tracked : (R, N) bool array
        Channels with code and carrier.
    """
    seen = tracked.any(axis=0)
    visible = correction_inputs.elevation_rad >= params.monitors.elevation_mask_rad
    usable = exclusions.usable_channels()
    ready = (usable & correction_inputs.ready).sum(axis=0)
    settling = (usable & np.isfinite(tracks.age_s) & ~correction_inputs.ready).sum(axis=0)
    short = corrections.count < params.receivers.minimum
    waiting = short & (ready < params.receivers.minimum) & (ready + settling >= params.receivers.minimum)
    unmonitored = (
        waiting
        & ~correction_inputs.judged
        & ((usable & correction_inputs.settled).sum(axis=0) >= params.receivers.minimum)
    )
    channel_cause = _channel_cause(tracked, exclusions)
    no_rate = ~np.isfinite(corrections.prc_m + corrections.rrc_mps).all(axis=0)

    excluded = ChannelState.EXCLUDED
    reasons: tuple[tuple[BoolArray | np.bool, ArrayLike, ArrayLike], ...] = (
        (~seen & ~visible, ChannelState.NOT_TRACKED, ExclusionCause.NONE),
        (~seen, ChannelState.NOT_TRACKED, ExclusionCause.NOT_TRACKED),
        (np.isnan(correction_inputs.elevation_rad + known.crc), excluded, ExclusionCause.NO_EPHEMERIS),
        (~visible, excluded, ExclusionCause.BELOW_MASK),
        (exclusions.satellites.excluded, exclusions.satellites.state, exclusions.satellites.cause),
        (unmonitored, ChannelState.SETTLING, ExclusionCause.UNMONITORED),
        (waiting, ChannelState.SETTLING, ExclusionCause.SETTLING),
        (short & (channel_cause >= float(FIRST_LATCHED)), excluded, channel_cause),
        (short & (ready >= params.receivers.minimum), excluded, ExclusionCause.TOO_FEW_COMMON_SATELLITES),
        (short, excluded, ExclusionCause.TOO_FEW_RECEIVERS),
        (~_sigma_fits(corrections), excluded, ExclusionCause.SIGMA_TOO_LARGE),
        (no_rate, excluded, ExclusionCause.NO_RATE),
    )
    state: FloatArray = np.full(N_SATS, float(ChannelState.USABLE))
    cause = np.zeros(N_SATS)
    for mask, its_state, its_cause in reversed(reasons):
        if mask.any():
            state = np.where(mask, its_state, state)
            cause = np.where(mask, its_cause, cause)
    return SatelliteStatus(state=state, cause=cause)


def _channel_cause(tracked: BoolArray, exclusions: Exclusions) -> FloatArray:
    """Cause of the exclusions of a satellite's channels, ``(N,)``; the largest number where there are several."""
    by_receiver = tracked & exclusions.receivers.excluded[:, np.newaxis]
    causes = np.where(by_receiver, exclusions.receivers.cause[:, np.newaxis], exclusions.channels.cause)
    return np.asarray(causes.max(axis=0), dtype=np.float64)


def _sigma_fits(corrections: Corrections) -> BoolArray:
    sigmas = np.array(corrections.sigmas)
    return np.asarray(((sigmas > 0.0) & (sigmas <= MAX_SIGMA_M)).all(axis=0))


def withheld(status: SatelliteStatus) -> SatelliteStatus:
    """The condition when no usable satellite may be used for want of protection against ionospheric fronts."""
    usable = status.state == ChannelState.USABLE
    return SatelliteStatus(
        state=np.where(usable, float(ChannelState.EXCLUDED), status.state),
        cause=np.where(usable, float(ExclusionCause.IONOSPHERE_UNPROTECTED), status.cause),
    )


def integrity_of(
    gps_week: int,
    tow_s: float,
    known: EphemerisState,
    correction_inputs: CorrectionInputs,
    corrections: Corrections,
    status: SatelliteStatus,
    orbit_bound: FloatArray,
    protection: Protection,
    params: GroundParams,
) -> IntegrityEpoch:
    """The record of an epoch: a row for every satellite in view, corrections where they are usable.

    `orbit_bound` ``(N,)`` is what the ephemeris monitor supports, which P follows from [m/m].
    """
    usable = status.state == ChannelState.USABLE
    row = (status.state != ChannelState.NOT_TRACKED) | (status.cause != ExclusionCause.NONE)

    def of_row(values: FloatArray) -> FloatArray:
        return np.where(row, values, np.nan)

    def of_usable(values: FloatArray) -> FloatArray:
        return np.where(usable, values, np.nan)

    external = bool(params.ephemeris.external_monitor)
    n_receivers = corrections.used.shape[0]
    used, b = missing(MAX_REFERENCE_RECEIVERS), missing(MAX_REFERENCE_RECEIVERS)
    used[:n_receivers] = of_row((corrections.used & usable).astype(np.float64))
    b[:n_receivers] = of_usable(corrections.b_m[0])
    return IntegrityEpoch(
        gps_week=gps_week,
        tow_s=tow_s,
        n_receivers=float((corrections.used & usable).any(axis=1).sum()),
        sigma_vert_iono_gradient=protection.sigma_vig,
        state=of_row(status.state),
        cause=of_row(status.cause),
        elevation_rad=of_row(correction_inputs.elevation_rad),
        p_ephemeris=of_usable(claimed_decorrelation(orbit_bound, params.ephemeris.p, external=external)),
        p_ephemeris_d=of_usable(
            claimed_decorrelation(orbit_bound, params.ephemeris.p_d or params.ephemeris.p, external=external)
        ),
        iod=of_row(known.current.iod),
        ephemeris_crc=of_row(known.crc),
        prc_100_m=of_usable(corrections.prc_m[0]),
        rrc_100_mps=of_usable(corrections.rrc_mps[0]),
        prc_30_m=of_usable(corrections.prc_m[1]),
        rrc_30_mps=of_usable(corrections.rrc_mps[1]),
        sigma_pr_gnd_m=of_usable(protection.inflated_m(corrections.sigmas.gnd_m)),
        sigma_pr_gnd_d_m=of_usable(corrections.sigmas.gnd_d_m),
        sigma_pr_gnd_30_m=of_usable(corrections.sigmas.gnd_30_m),
        b_m=b,
        receiver_used=used,
    )
