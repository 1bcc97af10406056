"""Corrections that agree: form them, exclude what disagrees, form them again.

What is excluded leaves the clock's common set and the means, and the rest is formed and judged again, until nothing
fails. One thing goes at a time, the worst first: a single bad channel shifts its receiver's clock and with it all the
receiver's corrections, which must not be blamed for it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import CLOCK_GROUPS, N_SATS, SAT_IDS
from gbas_ground.corrections import formation as form
from gbas_ground.corrections.sigma import Sigmas, broadcast_sigmas
from gbas_ground.exclusions import Latch, exclude, initial_latch
from gbas_ground.monitors.correction_limits import check_correction
from gbas_ground.monitors.monitor_table import MonitorSummary, summarise
from gbas_ground.monitors.multiple_reference import channel_sigma_m, check_b_values, check_unused
from gbas_ground.monitors.result import MonitorResult
from gbas_ground.params import GroundParams
from gbas_msgs_py.codes import ExclusionCause


@dataclass(frozen=True, kw_only=True, eq=False)
class CorrectionInputs:
    """What the corrections are formed from at one epoch.

    Attributes
    ----------
    correction_m : (tau, R, N) array
        PR_sc, with the receiver clocks [m].
    previous_m : (tau, R, N) array
        PR_sc of the epoch before with today's ephemerides [m].
    dt_s : float
        Time since then [s]; NaN when there was none.
    settled : (R, N) bool array
        Channels whose smoothing filters have run long enough.
    judged : (N,) bool array
        Satellites that every required monitor of signals could judge.
    elevation_rad : (N,) array
    """

    correction_m: FloatArray
    previous_m: FloatArray
    dt_s: float
    settled: BoolArray
    judged: BoolArray
    elevation_rad: FloatArray

    @property
    def ready(self) -> BoolArray:
        """Channels that may be used unless something excludes them, ``(R, N)``."""
        return self.settled & self.judged


@dataclass(frozen=True, kw_only=True, eq=False)
class Exclusions:
    """The latches of a station: channels ``(R, N)``, receivers ``(R,)``, satellites ``(N,)``."""

    channels: Latch
    receivers: Latch
    satellites: Latch

    def usable_channels(self) -> BoolArray:
        """Channels that neither are excluded nor belong to an excluded receiver, ``(R, N)``."""
        return ~self.channels.excluded & ~self.receivers.excluded[:, np.newaxis]


def no_exclusions(params: GroundParams) -> Exclusions:
    """Nothing is excluded."""
    return Exclusions(
        channels=initial_latch(params.n_receivers, N_SATS),
        receivers=initial_latch(params.n_receivers),
        satellites=initial_latch(N_SATS),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Corrections:
    """Corrections of one epoch; a satellite that is excluded has them too, for its own monitoring.

    Attributes
    ----------
    in_use : (k, R) bool array
        Receivers in use, by constellation.
    common : (k, N) bool array
        Satellites the clocks are removed with.
    weights : (k, N) array
    used : (R, N) bool array
        Channels behind each correction; `count` ``(N,)`` is their number.
    prc_m, rrc_mps : (tau, N) arrays
    b_m : (tau, R, N) array
    sigmas : Sigmas
    channel_sigma_m : (tau, N) array
        One receiver's sigma, for the thresholds [m].
    """

    in_use: BoolArray
    common: BoolArray
    weights: FloatArray
    used: BoolArray
    count: FloatArray
    prc_m: FloatArray
    rrc_mps: FloatArray
    b_m: FloatArray
    sigmas: Sigmas
    channel_sigma_m: FloatArray


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One exclusion made: what, why, and by how much."""

    subject: str
    cause: ExclusionCause
    value: float
    threshold: float


def form_corrections(correction_inputs: CorrectionInputs, exclusions: Exclusions, params: GroundParams) -> Corrections:
    """Corrections from everything that is not excluded."""
    usable = correction_inputs.ready & exclusions.usable_channels()
    in_use, common = form.common_satellites(
        usable & ~exclusions.satellites.excluded,
        min_common=params.monitors.min_common_satellites,
        min_receivers=params.receivers.minimum,
    )
    elevation = None if params.monitors.clock_weighting == "plain" else correction_inputs.elevation_rad
    weights = form.clock_weights(common, elevation)
    adjusted = correction_inputs.correction_m - form.receiver_clock_m(correction_inputs.correction_m, weights)
    used = usable & in_use[0][:, np.newaxis] & CLOCK_GROUPS[0] | usable & in_use[1][:, np.newaxis] & CLOCK_GROUPS[1]
    used = used & np.isfinite(adjusted).all(axis=0)
    count = used.sum(axis=0).astype(np.float64)
    sigmas = broadcast_sigmas(params, correction_inputs.elevation_rad, count)
    return Corrections(
        in_use=in_use,
        common=common,
        weights=weights,
        used=used,
        count=count,
        prc_m=form.average_m(adjusted, used),
        rrc_mps=_rates(correction_inputs, used, weights, params),
        b_m=form.b_values_m(adjusted, used),
        sigmas=sigmas,
        channel_sigma_m=channel_sigma_m(np.stack([sigmas.gnd_d_m, sigmas.gnd_30_m]), count, weights),
    )


def _rates(
    correction_inputs: CorrectionInputs, used: BoolArray, weights: FloatArray, params: GroundParams
) -> FloatArray:
    """RRC from the channels that were there at the epoch before too, ``(tau, N)``."""
    both = used & np.isfinite(correction_inputs.previous_m).all(axis=0)
    if not np.array_equal(both, used):
        of_clock = both & (weights > 0.0).any(axis=0)
        _, common = form.common_satellites(of_clock, min_common=params.monitors.min_common_satellites, min_receivers=1)
        weights = form.clock_weights(
            common, None if params.monitors.clock_weighting == "plain" else correction_inputs.elevation_rad
        )
        both = both & np.isfinite(form.receiver_clock_m(correction_inputs.correction_m, weights)).all(axis=0)
    return form.rate_mps(
        correction_inputs.correction_m, correction_inputs.previous_m, correction_inputs.dt_s, weights, both
    )


def b_value_check(corrections: Corrections, params: GroundParams) -> MonitorResult:
    """B values of both smoothing constants, ``(tau, R, N)``."""
    return check_b_values(corrections.b_m, corrections.channel_sigma_m, corrections.used, params.b_value.k_b)


def limit_checks(corrections: Corrections, params: GroundParams) -> tuple[tuple[ExclusionCause, MonitorResult], ...]:
    """Sizes of PRC and, where there is one, RRC, ``(tau, N)`` each."""
    has = corrections.count > 0
    has_rate = has & np.isfinite(corrections.rrc_mps).all(axis=0)
    return (
        (ExclusionCause.PRC_LIMIT, check_correction(corrections.prc_m, has, params.correction_limits.max_prc_m)),
        (
            ExclusionCause.RRC_LIMIT,
            check_correction(corrections.rrc_mps, has_rate, params.correction_limits.max_rrc_mps),
        ),
    )


def consistency_summaries(corrections: Corrections, params: GroundParams) -> dict[str, MonitorSummary]:
    """What the monitors of the corrections say of each satellite."""
    has = corrections.count > 0
    limits = {
        cause.word.removesuffix("_limit"): summarise(result, has) for cause, result in limit_checks(corrections, params)
    }
    return {
        "b_value": summarise(b_value_check(corrections, params), corrections.used & (corrections.count >= 2)),
        **limits,
    }


def resolve_consistency(
    correction_inputs: CorrectionInputs, exclusions: Exclusions, params: GroundParams
) -> tuple[Corrections, Exclusions, tuple[Finding, ...]]:
    """Exclude what disagrees, one thing at a time, until the rest agrees.

    Returns
    -------
    corrections : Corrections
        Formed from what is left.
    exclusions : Exclusions
    findings : tuple of Finding
        What was excluded, in that order.
    """
    findings: list[Finding] = []
    while True:
        corrections = form_corrections(correction_inputs, exclusions, params)
        step = _worst_b_value(corrections, exclusions, params) or _worst_limit(corrections, exclusions, params)
        if step is None:
            return corrections, exclusions, tuple(findings)
        exclusions, finding = step
        findings.append(finding)


_Step = tuple[Exclusions, Finding]


def _ratio(result: MonitorResult) -> FloatArray:
    """Statistic over threshold where the monitor failed, else 0; a missing statistic is infinitely bad."""
    ratio = np.where(result.failed, result.statistic / result.threshold, 0.0)
    return np.where(np.isnan(ratio), np.inf, ratio)


def _worst_b_value(corrections: Corrections, exclusions: Exclusions, params: GroundParams) -> _Step | None:
    result = b_value_check(corrections, params)
    if not result.failed.any():
        return None
    # Two receivers do not tell which is wrong: then it is the satellite, once.
    actionable = (corrections.count >= 3) | ~exclusions.satellites.excluded
    ratio = np.where(actionable, _ratio(result), 0.0)
    tau, receiver, satellite = (int(place) for place in np.unravel_index(int(ratio.argmax()), ratio.shape))
    if ratio[tau, receiver, satellite] == 0.0:
        return None
    value, threshold = result.at(tau, receiver, satellite)
    if corrections.count[satellite] < 3:
        failed = np.arange(ratio.shape[-1]) == satellite
        latch = exclude(exclusions.satellites, failed, ExclusionCause.B_VALUE)
        finding = Finding(subject=SAT_IDS[satellite], cause=ExclusionCause.B_VALUE, value=value, threshold=threshold)
        return replace(exclusions, satellites=latch), finding
    mask = np.zeros(ratio.shape[1:], dtype=bool)
    mask[receiver, satellite] = True
    channels = exclude(exclusions.channels, mask, ExclusionCause.B_VALUE)
    faults = int((channels.cause[receiver] == ExclusionCause.B_VALUE).sum())
    if faults >= params.monitors.receiver_fault_channels:
        latch = exclude(exclusions.receivers, np.arange(len(mask)) == receiver, ExclusionCause.RECEIVER_FAULT)
        finding = Finding(
            subject=f"rr{receiver + 1}",
            cause=ExclusionCause.RECEIVER_FAULT,
            value=float(faults),
            threshold=float(params.monitors.receiver_fault_channels),
        )
        return replace(exclusions, channels=channels, receivers=latch), finding
    subject = f"rr{receiver + 1}/{SAT_IDS[satellite]}"
    finding = Finding(subject=subject, cause=ExclusionCause.B_VALUE, value=value, threshold=threshold)
    return replace(exclusions, channels=channels), finding


def _worst_limit(corrections: Corrections, exclusions: Exclusions, params: GroundParams) -> _Step | None:
    best: tuple[float, ExclusionCause, MonitorResult, tuple[int, ...]] | None = None
    for cause, result in limit_checks(corrections, params):
        if not result.failed.any():
            continue
        ratio = np.where(exclusions.satellites.excluded, 0.0, _ratio(result))
        place = tuple(int(each) for each in np.unravel_index(int(ratio.argmax()), ratio.shape))
        if ratio[place] > (best[0] if best else 0.0):
            best = (float(ratio[place]), cause, result, place)
    if best is None:
        return None
    _, cause, result, (tau, satellite) = best
    latch = exclude(exclusions.satellites, np.arange(corrections.count.shape[-1]) == satellite, cause)
    value, threshold = result.at(tau, satellite)
    return replace(exclusions, satellites=latch), Finding(
        subject=SAT_IDS[satellite], cause=cause, value=value, threshold=threshold
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ReadmissionState:
    """How what is excluded would do: masks of what was seen to pass, for :func:`gbas_ground.exclusions.advance`."""

    channels: BoolArray
    receivers: BoolArray
    satellites: BoolArray


def readmission_state(
    correction_inputs: CorrectionInputs,
    corrections: Corrections,
    exclusions: Exclusions,
    channel_ok: BoolArray,
    receivers_quiet: FloatArray,
    satellite_ok: BoolArray,
    params: GroundParams,
) -> ReadmissionState:
    """Judge what is not used against the corrections it has no part in.

    Parameters
    ----------
    correction_inputs, corrections, exclusions
        As they are after :func:`resolve_consistency`.
    channel_ok : (R, N) bool array
        Channels that are tracked and pass the monitors of single channels.
    receivers_quiet : (R,) array
        1 where a receiver would do on its baselines, 0 where not, NaN where nobody can tell.
    satellite_ok : (N,) bool array
        Satellites that the monitors of signals were seen to pass.
    params : GroundParams

    Notes
    -----
    A channel excluded by its B value has to be seen to agree. A channel excluded for another reason passes while its
    own monitor does, unless it is seen to disagree: there may be nothing to compare it with, and its B value is tested
    when it comes back. A receiver must not be seen to be wrong on its baselines; one that was excluded by them has to
    be seen to be right.

    "To agree" is to be within `params.monitors.readmission_share` of the threshold: what is excluded just above it must
    not come back just below it.

    When the exclusions leave a constellation without a clock, nothing can be compared with anything, and no exclusion
    would ever end. Then everything is judged together as if nothing were excluded, and passes together or not at all.
    """
    unused = correction_inputs.settled & ~corrections.used
    result = check_unused(
        _residual_m(correction_inputs, corrections, params),
        corrections.channel_sigma_m,
        corrections.count,
        params.b_value.k_b,
    )
    judged = unused & np.isfinite(result.statistic).all(axis=0) & (corrections.count > 0)
    near = result.statistic <= params.monitors.readmission_share * result.threshold
    agrees, disagrees = judged & near.all(axis=0), judged & result.failed.any(axis=0)
    needs_comparison = exclusions.channels.cause == ExclusionCause.B_VALUE
    channels = channel_ok & np.where(needs_comparison, agrees, ~disagrees)
    receivers = (agrees.sum(axis=1) >= params.monitors.min_common_satellites) & ~disagrees.any(axis=1)
    by_baselines = exclusions.receivers.cause == ExclusionCause.RECEIVER_BASELINES
    fits = (receivers_quiet == 1.0) | (np.isnan(receivers_quiet) & ~by_baselines)

    seen = (corrections.count > 0) & np.isfinite(corrections.rrc_mps).all(axis=0)
    within = ~np.asarray(np.any([result.failed.any(axis=0) for _, result in limit_checks(corrections, params)], axis=0))
    consistent = ~b_value_check(corrections, params).failed.any(axis=(0, 1))
    by_b = exclusions.satellites.cause == ExclusionCause.B_VALUE
    satellites = satellite_ok & seen & within & consistent & (~by_b | (corrections.count >= 2))

    together = _together(correction_inputs, corrections, channel_ok, params)
    return ReadmissionState(
        channels=channels | (channel_ok & together.channels),
        receivers=fits & (receivers | (together.receivers & ~disagrees.any(axis=1))),
        satellites=satellites | (satellite_ok & together.satellites),
    )


def _together(
    correction_inputs: CorrectionInputs, corrections: Corrections, channel_ok: BoolArray, params: GroundParams
) -> ReadmissionState:
    """What passes in constellations without a clock when nothing is excluded there."""
    channels, receivers = np.zeros_like(channel_ok), np.zeros(len(channel_ok), dtype=bool)
    tracked = np.logical_or.reduce(channel_ok, axis=0)
    stuck = ~np.logical_or.reduce(corrections.common, axis=1) & np.logical_or.reduce(tracked & CLOCK_GROUPS, axis=1)
    if stuck.any():
        # Monitors that average over receivers could judge nothing while all of these were excluded.
        free = replace(
            correction_inputs,
            settled=correction_inputs.settled & channel_ok,
            judged=np.ones_like(correction_inputs.judged),
        )
        trial = form_corrections(free, no_exclusions(params), params)
        results = [b_value_check(trial, params).failed.any(axis=0), *(r.failed for _, r in limit_checks(trial, params))]
        failed = np.logical_or.reduce(np.concatenate(results), axis=0)
        for k, group in enumerate(CLOCK_GROUPS):
            if stuck[k] and trial.common[k].any() and not np.any(failed & group):
                channels = channels | (trial.used & group)
                receivers = receivers | trial.in_use[k]
    return ReadmissionState(channels=channels, receivers=receivers, satellites=np.asarray(channels.any(axis=0)))


def _residual_m(correction_inputs: CorrectionInputs, corrections: Corrections, params: GroundParams) -> FloatArray:
    """PR_sc less PRC, with each receiver's clock estimated against the PRC of the common satellites it has."""
    against = correction_inputs.correction_m - corrections.prc_m[:, np.newaxis, :]
    usable = correction_inputs.settled & np.isfinite(against).all(axis=0) & corrections.common.any(axis=0)
    residual = np.full(against.shape, np.nan)
    for group in CLOCK_GROUPS:
        own = usable & group
        number = own.sum(axis=1)
        total = np.where(own, against, 0.0).sum(axis=-1)
        clock = np.where(number >= params.monitors.min_common_satellites, total / np.maximum(number, 1), np.nan)
        residual = np.where(group, against - clock[..., np.newaxis], residual)
    return residual
