"""Corrections that agree: form them, exclude what disagrees, form them again.

What is excluded leaves the clock's common set and the means, and the rest is formed and judged again, until nothing
fails. One thing goes at a time, the worst first: a single bad channel shifts its receiver's clock and with it all the
receiver's corrections, which must not be blamed for it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import CLOCK_GROUPS, N_SATS, SAT_IDS
from gbas_ground.corrections.kernels import consistency as kernels
from gbas_ground.exclusions import Latch, exclude, initial_latch
from gbas_ground.monitors.monitor_table import MonitorSummary, Summaries
from gbas_ground.params import GroundParams
from gbas_ground.prepared import PreparedStation
from gbas_msgs_py.codes import ExclusionCause, Signal
from gbas_msgs_py.monitors import B_VALUE, CORRECTION_LIMITS

_TESTS: Final = (B_VALUE.key("b"), CORRECTION_LIMITS.key("prc"), CORRECTION_LIMITS.key("rrc"))
# comparing arrays with members of an enumeration is slow
_B_VALUE: Final = int(ExclusionCause.B_VALUE)
_BY_BASELINES: Final = int(ExclusionCause.RECEIVER_BASELINES)


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
    sigma_m : (k, N) array
        What the sigmas are made of (:func:`~gbas_ground.corrections.kernels.consistency.broadcast_sigmas_m`) [m].
    """

    correction_m: FloatArray
    previous_m: FloatArray
    dt_s: float
    settled: BoolArray
    judged: BoolArray
    elevation_rad: FloatArray
    sigma_m: FloatArray


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


@dataclass(frozen=True, eq=False)
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
    sigmas_m : (3, N) array
        In the order of :class:`~gbas_ground.corrections.sigma.Sigmas` [m].
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
    sigmas_m: FloatArray
    channel_sigma_m: FloatArray


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One exclusion made: what, why, and by how much."""

    subject: str
    cause: ExclusionCause
    value: float
    threshold: float


class Checks(NamedTuple):
    """What the monitors of corrections say of B values, PRC and RRC, in this order, each ``(3, N)``.

    Attributes
    ----------
    statistic, threshold : (3, N) arrays
        Of the comparison that is furthest over its threshold, or nearest to it.
    failed, due : (3, N) bool arrays
    n_failed : int
        How many of them fail.
    """

    statistic: FloatArray
    threshold: FloatArray
    failed: BoolArray
    due: BoolArray
    n_failed: int

    def summaries(self, signal: Signal = Signal.L1) -> Summaries:
        """What they say of each satellite."""
        rows = zip(_TESTS, self.statistic, self.threshold, self.failed, self.due, strict=True)
        return {key: MonitorSummary(value, limit, failed, due, signal) for key, value, limit, failed, due in rows}


def form_corrections(
    correction_inputs: CorrectionInputs, exclusions: Exclusions, station: PreparedStation
) -> tuple[Corrections, Checks]:
    """Corrections from everything that is not excluded, and what their monitors say."""
    settings, given = station.consistency, correction_inputs
    usable = kernels.usable_channels(given.settled, given.judged, exclusions.channels.cause, exclusions.receivers.cause)
    made = Corrections(*kernels.form_corrections(
        given.correction_m, given.previous_m, given.dt_s, usable, exclusions.satellites.cause, given.elevation_rad,
        given.sigma_m, settings,
    ))  # fmt: skip
    checks = kernels.summarise_corrections(
        made.used, made.count, made.prc_m, made.rrc_mps, made.b_m, made.channel_sigma_m, settings
    )
    return made, Checks(*checks)


def resolve_consistency(
    correction_inputs: CorrectionInputs, exclusions: Exclusions, station: PreparedStation
) -> tuple[Corrections, Checks, Exclusions, tuple[Finding, ...]]:
    """Exclude what disagrees, one thing at a time, until the rest agrees.

    Returns
    -------
    corrections : Corrections
        Formed from what is left.
    checks : Checks
        Of these.
    exclusions : Exclusions
    findings : tuple of Finding
        What was excluded, in that order.
    """
    findings: list[Finding] = []
    while True:
        corrections, checks = form_corrections(correction_inputs, exclusions, station)
        step = _worst(corrections, exclusions, station) if checks.n_failed else None
        if step is None:
            return corrections, checks, exclusions, tuple(findings)
        exclusions, finding = step
        findings.append(finding)


_Step = tuple[Exclusions, Finding]


def _worst(corrections: Corrections, exclusions: Exclusions, station: PreparedStation) -> _Step | None:
    """Exclude what fails worst: a B value first, then a size."""
    return _worst_b_value(corrections, exclusions, station) or _worst_limit(corrections, exclusions, station)


def _worst_b_value(corrections: Corrections, exclusions: Exclusions, station: PreparedStation) -> _Step | None:
    count, params = corrections.count, station.params
    receiver, satellite, value, threshold = kernels.worst_b_value(
        corrections.used, count, corrections.b_m, corrections.channel_sigma_m, exclusions.satellites.cause,
        station.consistency,
    )  # fmt: skip
    if satellite < 0:
        return None
    if count[satellite] < 3:
        latch = exclude(exclusions.satellites, np.arange(N_SATS) == satellite, ExclusionCause.B_VALUE)
        finding = Finding(subject=SAT_IDS[satellite], cause=ExclusionCause.B_VALUE, value=value, threshold=threshold)
        return replace(exclusions, satellites=latch), finding
    mask = np.zeros(exclusions.channels.cause.shape, dtype=bool)
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


def _worst_limit(corrections: Corrections, exclusions: Exclusions, station: PreparedStation) -> _Step | None:
    kind, satellite, value, threshold = kernels.worst_limit(
        corrections.count, corrections.prc_m, corrections.rrc_mps, exclusions.satellites.cause, station.consistency
    )
    if satellite < 0:
        return None
    cause = (ExclusionCause.PRC_LIMIT, ExclusionCause.RRC_LIMIT)[kind]
    latch = exclude(exclusions.satellites, np.arange(N_SATS) == satellite, cause)
    finding = Finding(subject=SAT_IDS[satellite], cause=cause, value=value, threshold=threshold)
    return replace(exclusions, satellites=latch), finding


@dataclass(frozen=True, kw_only=True, eq=False)
class ReadmissionState:
    """How what is excluded would do: masks of what was seen to pass, for :func:`gbas_ground.exclusions.advance`."""

    channels: BoolArray
    receivers: BoolArray
    satellites: BoolArray


class SeenToPass(NamedTuple):
    """What the monitors before this stage say, by which an exclusion may end.

    Attributes
    ----------
    channels : (R, N) bool array
        Channels that are tracked and pass the monitors of single channels.
    receivers_quiet : (R,) array
        1 where a receiver would do on its baselines, 0 where not, NaN where nobody can tell.
    satellites : (N,) bool array
        Satellites that the monitors of signals were seen to pass.
    """

    channels: BoolArray
    receivers_quiet: FloatArray
    satellites: BoolArray


def readmission_state(
    correction_inputs: CorrectionInputs,
    corrections: Corrections,
    checks: Checks,
    exclusions: Exclusions,
    seen: SeenToPass,
    station: PreparedStation,
) -> ReadmissionState:
    """Judge what is not used against the corrections it has no part in.

    Parameters
    ----------
    correction_inputs, corrections, checks, exclusions
        As they are after :func:`resolve_consistency`.
    seen : SeenToPass
    station : PreparedStation

    Notes
    -----
    A channel excluded by its B value has to be seen to agree. A channel excluded for another reason passes while its
    own monitor does, unless it is seen to disagree: there may be nothing to compare it with, and its B value is tested
    when it comes back. A receiver must not be seen to be wrong on its baselines; one that was excluded by them has to
    be seen to be right.

    "To agree" is to be within `readmission_share` of the threshold: what is excluded just above it must
    not come back just below it.

    When the exclusions leave a constellation without a clock, nothing can be compared with anything, and no exclusion
    would ever end. Then everything is judged together as if nothing were excluded, and passes together or not at all.
    """
    settings = station.consistency
    channel_ok, receivers_quiet, satellite_ok = seen
    residual_m = kernels.residual_m(
        correction_inputs.correction_m, correction_inputs.settled, corrections.common, corrections.prc_m, settings
    )
    agrees, disagrees = kernels.compare_unused(
        residual_m, correction_inputs.settled, corrections.used, corrections.count, corrections.channel_sigma_m,
        settings,
    )  # fmt: skip
    needs_comparison = exclusions.channels.cause == _B_VALUE
    channels = channel_ok & np.where(needs_comparison, agrees, ~disagrees)
    receivers = (agrees.sum(axis=1) >= settings.min_common) & ~disagrees.any(axis=1)
    by_baselines = exclusions.receivers.cause == _BY_BASELINES
    fits = (receivers_quiet == 1.0) | (np.isnan(receivers_quiet) & ~by_baselines)

    consistent = checks.due[2] & ~np.logical_or.reduce(checks.failed)
    by_b = exclusions.satellites.cause == _B_VALUE
    satellites = satellite_ok & consistent & (~by_b | (corrections.count >= 2))

    together = _together(correction_inputs, corrections, channel_ok, station)
    return ReadmissionState(
        channels=channels | (channel_ok & together.channels),
        receivers=fits & (receivers | (together.receivers & ~disagrees.any(axis=1))),
        satellites=satellites | (satellite_ok & together.satellites),
    )


def _together(
    correction_inputs: CorrectionInputs, corrections: Corrections, channel_ok: BoolArray, station: PreparedStation
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
        trial, checks = form_corrections(free, no_exclusions(station.params), station)
        failed = np.logical_or.reduce(checks.failed)
        for k, group in enumerate(CLOCK_GROUPS):
            if stuck[k] and trial.common[k].any() and not np.any(failed & group):
                channels = channels | (trial.used & group)
                receivers = receivers | trial.in_use[k]
    return ReadmissionState(channels=channels, receivers=receivers, satellites=np.asarray(channels.any(axis=0)))
