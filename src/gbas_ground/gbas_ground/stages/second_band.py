# mypy: disable-error-code="no-untyped-call"
"""Second band: corrections of L5 and E5a beside those of L1 and E1, of a station that makes them.

Each band has its own smoothing filters, receiver clocks and common sets, B values, sigmas, limits and exclusions. What
a fault of one band means for the other follows from what the integrity of a correction rests on:

- The satellite's orbit and clock, and the ionosphere over the station, are the same for both: what the monitors of
  ephemerides, of gradients, of carriers over time, of common slips and of two-band divergence exclude is excluded from
  both. So is what L1's own divergence monitor excludes: an ionosphere that diverges L1 diverges L5 1.8 times as much.
- L1 is what a satellite is found, placed and timed by. One that is not usable on L1, whatever the reason, is not
  corrected on L5.
- Power, code faults (expected range), B values, their sigma over time, size of the correction and the divergence of
  L5 are of that band: they exclude it there and leave L1, whose corrections rest on L1's own monitors, alone. The same
  of single channels: a receiver's channel that L1's power or B values exclude goes on on L5; for any other cause, and
  with an excluded receiver, it is excluded from both.

Every exclusion is an event, its subject ending with ``/l5`` where it is of this band.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS, SAT_IDS
from gbas_core.signals import IONO_RATIO, L1
from gbas_ground.channels.kernels.channels import finish
from gbas_ground.consistency import (
    Checks,
    CorrectionInputs,
    Corrections,
    Exclusions,
    Finding,
    SeenToPass,
    no_exclusions,
    resolve_consistency,
)
from gbas_ground.corrections.second_band import BAND, SIGNAL, SUFFIX, SecondBandSettings
from gbas_ground.corrections.sigma import MAX_SIGMA_M
from gbas_ground.exclusions import Latch
from gbas_ground.long_term import initial_long_term, monitor_sigmas
from gbas_ground.monitors.interface import Verdict
from gbas_ground.monitors.monitor_table import Summaries, summarise
from gbas_ground.monitors.sigma_monitor import SigmaMonitorState
from gbas_ground.monitors.signal_power import check_signal_power
from gbas_ground.prepared import PreparedStation
from gbas_ground.stages.correct import PreviousEpoch, advanced, previous_corrections
from gbas_ground.stages.decide import Decided
from gbas_ground.stages.exclusion import exclude_channels, exclude_satellites, released
from gbas_ground.stages.monitor import below
from gbas_ground.stages.track import CHECKS, Tracked
from gbas_msgs_py.codes import EventKind, ExclusionCause
from gbas_msgs_py.events import EventLog
from gbas_msgs_py.monitors import TESTS

_OF_ONE_BAND: Final = (
    ExclusionCause.B_VALUE,
    ExclusionCause.SIGNAL_POWER,
    ExclusionCause.EXPECTED_POWER,
    ExclusionCause.SIGMA_MEAN,
    ExclusionCause.SIGMA_SPREAD,
)
"""Causes for which a channel of L1 is excluded and that say nothing of its other band."""
_FREE: Final[BoolArray] = np.isin(np.arange(1 + max(ExclusionCause)), (ExclusionCause.NONE, *_OF_ONE_BAND))
"""By a channel's cause on L1, whether its other band may be used."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SecondBandState:
    """Memory of this stage.

    Attributes
    ----------
    exclusions : Exclusions
        Of this band alone.
    previous : PreviousEpoch or None
    sigmas : SigmaMonitorState
    usable : (N,) bool array
        Satellites that had corrections at the epoch before.
    """

    exclusions: Exclusions
    previous: PreviousEpoch | None
    sigmas: SigmaMonitorState
    usable: BoolArray


class SecondBand(NamedTuple):
    """Record of this stage.

    Attributes
    ----------
    corrections : Corrections
    usable : (N,) bool array
        Satellites whose corrections may be used.
    sigmas_m : (2, N) array
        Broadcast sigma of each smoothing constant [m].
    summaries : mapping from the numbers of a test to MonitorSummary
    """

    corrections: Corrections
    usable: BoolArray
    sigmas_m: FloatArray
    summaries: Summaries


def initial_second_band(station: PreparedStation) -> SecondBandState | None:
    """A second band that has seen nothing; None of a station without."""
    if station.second is None:
        return None
    return SecondBandState(
        exclusions=no_exclusions(station.params),
        previous=None,
        sigmas=initial_long_term(station.params),
        usable=np.zeros(N_SATS, dtype=bool),
    )


def second_band(
    state: SecondBandState, decided: Decided, station: PreparedStation, settings: SecondBandSettings
) -> tuple[SecondBandState, SecondBand]:
    """Corrections of the second band of the satellites that are usable on the first."""
    params, monitored = station.params, decided.corrected.monitored
    tracked, signals = monitored.tracked, monitored.signals
    now = tracked.received.now
    exclusions = released(state.exclusions, params, now.events, SUFFIX)
    checks, channels_tracked, channel_ok = _channel_checks(tracked, station, settings)
    of_channels = (*checks, *(verdict for each in signals.second for verdict in each.channels))
    exclusions = exclude_channels(exclusions, of_channels, now.events, SUFFIX)
    verdicts = tuple(verdict for each in signals.second for verdict in each.satellites)
    exclusions, of_signals = exclude_satellites(exclusions, verdicts)
    inputs = _inputs(state.previous, decided, station, settings)
    corrections, agreement, exclusions, of_corrections = resolve_consistency(inputs, exclusions, station)
    sigmas, exclusions, of_sigmas, sigma_summaries = monitor_sigmas(
        state.sigmas, corrections, exclusions, now.dt_s, params
    )
    _tell((*of_signals, *of_corrections, *of_sigmas), now.events)
    sent_m = _sent_sigmas_m(corrections, decided)
    usable = _usable(corrections, sent_m, exclusions.satellites, decided.status.usable, params.receivers.minimum)
    told = {finding.subject for finding in (*of_signals, *of_corrections, *of_sigmas)}
    for satellite in np.flatnonzero(state.usable != usable) if (state.usable != usable).any() else ():
        subject = SAT_IDS[satellite]
        if usable[satellite]:
            now.events.add(EventKind.READMISSION, subject + SUFFIX, "used")
        elif decided.status.usable[satellite] and subject not in told:  # with L1 it goes without a further word
            cause = _reason(int(satellite), inputs, corrections, sent_m, exclusions, params.receivers.minimum)
            now.events.add(EventKind.EXCLUSION, subject + SUFFIX, cause.word)
    exclusions = advanced(
        exclusions, inputs, corrections, agreement,
        lambda: SeenToPass(
            channel_ok, signals.receivers_quiet, below(inputs.judged, verdicts, params.monitors.readmission_share)
        ),
        station,
    )  # fmt: skip
    after = SecondBandState(
        exclusions=exclusions,
        previous=PreviousEpoch(
            gps_week=now.gps_week,
            tow_s=now.tow_s,
            code_m=tracked.raw.code_m[:, L1],
            smoothed_m=tracked.tracks.smoothed_of(BAND),
            correction_m=inputs.correction_m,
        ),
        sigmas=sigmas,
        usable=usable,
    )
    of_sigma = {key: each._replace(signal=SIGNAL) for key, each in sigma_summaries.items()}
    said = {**_summaries(checks, channels_tracked, agreement, decided), **of_sigma}
    return after, SecondBand(corrections, usable, sent_m, said)


# --- the stage


def _channel_checks(
    tracked: Tracked, station: PreparedStation, settings: SecondBandSettings
) -> tuple[tuple[Verdict, ...], BoolArray, BoolArray]:
    """Checks of single channels as on L1; channels with code and carrier, and those that pass, each ``(R, N)``."""
    params, raw, of_range = station.params, tracked.received.raw, tracked.second_range
    assert of_range is not None
    measured = np.isfinite(raw.code_m[:, BAND] + raw.carrier_m[:, BAND])
    power = check_signal_power(
        raw.cn0_dbhz[:, BAND], measured, settings.min_cn0_dbhz, required=params.signal_power.require_cn0
    )
    checks = (of_range, Verdict(TESTS[CHECKS[1]][1].cause, power)) if params.signal_power.exclude else (of_range,)
    passing = measured
    for check in checks:
        passing = passing & ~check.result.failed
    return checks, measured, passing


def _inputs(
    previous: PreviousEpoch | None, decided: Decided, station: PreparedStation, settings: SecondBandSettings
) -> CorrectionInputs:
    """What the corrections are formed from: channels that L1 has no objection to."""
    monitored, params = decided.corrected.monitored, station.params
    tracked, predicted = monitored.tracked, monitored.tracked.predicted
    received, dt_s = tracked.received, tracked.received.now.dt_s
    correction_m, settled = finish(
        tracked.tracks.smoothed_m, tracked.tracks.age_s, tracked.tracks.bands.index(BAND), predicted.range_m,
        predicted.clock_s, predicted.elevation_rad, params.monitors.elevation_mask_rad, params.smoothing.settle_time_s,
    )  # fmt: skip
    of_l1 = decided.corrected.exclusions
    judged = decided.status.usable
    for each in monitored.signals.second:
        judged = judged if each.ready is None else judged & each.ready
    recent = previous if dt_s <= params.smoothing.max_gap_s else None
    return CorrectionInputs(
        correction_m=correction_m,
        previous_m=previous_corrections(
            recent, received.known.current, received.changed, correction_m.shape, station.site
        ),
        dt_s=dt_s,
        settled=settled & _FREE[of_l1.channels.cause] & ~of_l1.receivers.excluded[:, np.newaxis],
        judged=judged,
        elevation_rad=predicted.elevation_rad,
        sigma_m=settings.sigma_parts_m(predicted.elevation_rad),
    )


def _sent_sigmas_m(corrections: Corrections, decided: Decided) -> FloatArray:
    """Sigmas as they are broadcast, ``(2, N)`` [m].

    What anomalous ionosphere adds to the sigma of the 100 s correction of L1, in quadrature, counts on L5 with the
    ratio of the delays. That of 30 s is not inflated on L1, nor here.
    """
    of_l1, sigmas_m = decided.corrected.corrections.sigmas_m, corrections.sigmas_m[1:].copy()
    sent_m = decided.protection.inflated_m(of_l1[0])
    added_m2 = np.maximum(sent_m**2 - of_l1[1] ** 2, 0.0)
    sigmas_m[0] = np.sqrt(sigmas_m[0] ** 2 + IONO_RATIO[BAND] ** 2 * added_m2)
    return sigmas_m


def _usable(
    corrections: Corrections, sigmas_m: FloatArray, satellites: Latch, usable_l1: BoolArray, min_receivers: int
) -> BoolArray:
    """Satellites with whole corrections within what a message carries, of enough receivers, that nothing excludes."""
    whole = np.isfinite(corrections.prc_m + corrections.rrc_mps).all(axis=0)
    fits = ((sigmas_m > 0.0) & (sigmas_m <= MAX_SIGMA_M)).all(axis=0)
    return usable_l1 & whole & fits & (corrections.count >= min_receivers) & ~satellites.excluded


def _summaries(checks: tuple[Verdict, ...], measured: BoolArray, agreement: Checks, decided: Decided) -> Summaries:
    """What the tests say of this band."""
    of_channels = {key: summarise(check.result, measured, SIGNAL) for key, check in zip(CHECKS, checks, strict=False)}
    of_signals = {
        key: each for output in decided.corrected.monitored.signals.second for key, each in output.summaries.items()
    }
    return {**of_channels, **of_signals, **agreement.summaries(SIGNAL)}


# --- events


def _tell(findings: tuple[Finding, ...], events: EventLog) -> None:
    for each in findings:
        events.add(EventKind.EXCLUSION, each.subject + SUFFIX, each.cause.word, each.value, each.threshold)


def _reason(
    satellite: int,
    inputs: CorrectionInputs,
    corrections: Corrections,
    sigmas_m: FloatArray,
    exclusions: Exclusions,
    min_receivers: int,
) -> ExclusionCause:
    """Why a satellite that is usable on L1 has no corrections here; the first that holds, as on L1."""
    latched = int(exclusions.satellites.cause[satellite])
    if latched:
        return ExclusionCause(latched)
    if corrections.count[satellite] < min_receivers:
        of_channels = int(exclusions.channels.cause[:, satellite].max(initial=0))
        if of_channels:
            return ExclusionCause(of_channels)
        if np.isnan(inputs.correction_m[:, :, satellite]).all():
            return ExclusionCause.NOT_TRACKED
        if not inputs.judged[satellite]:
            return ExclusionCause.UNMONITORED
        few = np.count_nonzero(inputs.settled[:, satellite]) < min_receivers
        return ExclusionCause.TOO_FEW_RECEIVERS if few else ExclusionCause.TOO_FEW_COMMON_SATELLITES
    fits = ((sigmas_m[:, satellite] > 0.0) & (sigmas_m[:, satellite] <= MAX_SIGMA_M)).all()
    return ExclusionCause.NO_RATE if fits else ExclusionCause.SIGMA_TOO_LARGE
