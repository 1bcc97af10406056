"""Correct: corrections of everything that is not excluded, formed again until they agree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.record import BoolArray, FloatArray
from gbas_core.signals import L1
from gbas_ground.channels.predicted_ranges import Site, predict_ranges
from gbas_ground.consistency import (
    Checks,
    CorrectionInputs,
    Corrections,
    Exclusions,
    Finding,
    SeenToPass,
    readmission_state,
    resolve_consistency,
)
from gbas_ground.corrections.formation import range_correction_m
from gbas_ground.corrections.sigma import measured_sigma_m
from gbas_ground.exclusions import advance
from gbas_ground.long_term import monitor_sigmas
from gbas_ground.monitors.monitor_table import Summaries
from gbas_ground.monitors.sigma_monitor import SigmaMonitorState
from gbas_ground.params import GroundParams
from gbas_ground.prepared import PreparedStation
from gbas_ground.stages.monitor import Monitored
from gbas_ground.stages.track import Tracked


@dataclass(frozen=True, kw_only=True, eq=False)
class PreviousEpoch:
    """What the range rate corrections need of the epoch before.

    Attributes
    ----------
    gps_week, tow_s
    code_m : (R, N) array
        Raw pseudoranges.
    smoothed_m : (tau, R, N) array
    correction_m : (tau, R, N) array
        PR_sc.
    """

    gps_week: int
    tow_s: float
    code_m: FloatArray
    smoothed_m: FloatArray
    correction_m: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class CorrectState:
    """Memory of this stage: the epoch before, and the monitor of B values over time."""

    previous: PreviousEpoch | None
    sigmas: SigmaMonitorState


class Corrected(NamedTuple):
    """Record of this stage.

    Attributes
    ----------
    monitored : Monitored
    inputs : CorrectionInputs
    corrections : Corrections
        Those that agree.
    summaries : mapping from the numbers of a test to MonitorSummary
        Of the monitors of corrections.
    findings : tuple of Finding
        Satellites, channels and receivers that were excluded, those of the monitors of signals first.
    exclusions : Exclusions
        Those of this epoch, and the clear time of the others.
    """

    monitored: Monitored
    inputs: CorrectionInputs
    corrections: Corrections
    summaries: Summaries
    findings: tuple[Finding, ...]
    exclusions: Exclusions


def correct(state: CorrectState, monitored: Monitored, station: PreparedStation) -> tuple[CorrectState, Corrected]:
    """Form corrections, exclude what does not agree, and watch the B values."""
    tracked, params = monitored.tracked, station.params
    dt_s = tracked.received.now.dt_s
    inputs = _correction_inputs(state.previous, monitored, station)
    corrections, checks, exclusions, of_corrections = resolve_consistency(inputs, monitored.exclusions, station)
    sigmas, exclusions, of_sigmas, sigma_summaries = monitor_sigmas(state.sigmas, corrections, exclusions, dt_s, params)
    corrected = Corrected(
        monitored=monitored,
        inputs=inputs,
        corrections=corrections,
        summaries={**checks.summaries(), **sigma_summaries},
        findings=(*monitored.findings, *of_corrections, *of_sigmas),
        exclusions=advanced(exclusions, inputs, corrections, checks, _seen(monitored, params), station),
    )
    return CorrectState(previous=_previous(tracked), sigmas=sigmas), corrected


def _previous(tracked: Tracked) -> PreviousEpoch:
    """What the next epoch needs of this one."""
    now = tracked.received.now
    return PreviousEpoch(
        gps_week=now.gps_week,
        tow_s=now.tow_s,
        code_m=tracked.raw.code_m[:, L1],
        smoothed_m=tracked.tracks.smoothed_of(L1),
        correction_m=tracked.correction_m,
    )


def _correction_inputs(
    previous: PreviousEpoch | None, monitored: Monitored, station: PreparedStation
) -> CorrectionInputs:
    """What the corrections are formed from."""
    tracked = monitored.tracked
    received, dt_s = tracked.received, tracked.received.now.dt_s
    recent = previous if dt_s <= station.params.smoothing.max_gap_s else None
    shape = tracked.correction_m.shape
    return CorrectionInputs(
        correction_m=tracked.correction_m,
        previous_m=previous_corrections(recent, received.known.current, received.changed, shape, station.site),
        dt_s=dt_s,
        settled=tracked.settled,
        judged=monitored.signals.ready,
        elevation_rad=tracked.predicted.elevation_rad,
        sigma_m=measured_sigma_m(station.params, tracked.predicted.elevation_rad),
    )


def previous_corrections(
    previous: PreviousEpoch | None, current: Ephemeris, changed: BoolArray, shape: tuple[int, ...], site: Site
) -> FloatArray:
    """PR_sc of the epoch before, as today's ephemerides would have made it."""
    if previous is None:
        return np.full(shape, np.nan)
    if not changed.any():
        return previous.correction_m
    predicted = predict_ranges(current, previous.gps_week, previous.tow_s, previous.code_m, site)
    again = range_correction_m(predicted.range_m, previous.smoothed_m, predicted.clock_s)
    return np.where(changed, again, previous.correction_m)


def _seen(monitored: Monitored, params: GroundParams) -> Callable[[], SeenToPass]:
    """What the monitors of signals were seen to pass."""
    signals = monitored.signals
    return lambda: SeenToPass(
        monitored.tracked.channel_ok, signals.receivers_quiet, signals.passed(params.monitors.readmission_share)
    )


def advanced(
    exclusions: Exclusions,
    inputs: CorrectionInputs,
    corrections: Corrections,
    checks: Checks,
    seen: Callable[[], SeenToPass],
    station: PreparedStation,
) -> Exclusions:
    """Count the clear time of everything that is excluded; what was seen is asked for only where anything is."""
    latches = (exclusions.channels, exclusions.receivers, exclusions.satellites)
    if not any(latch.remembers for latch in latches):
        return exclusions
    max_gap_s = station.params.smoothing.max_gap_s
    passed = readmission_state(inputs, corrections, checks, exclusions, seen(), station)
    return Exclusions(
        channels=advance(exclusions.channels, passed.channels, inputs.dt_s, max_gap_s),
        receivers=advance(exclusions.receivers, passed.receivers, inputs.dt_s, max_gap_s),
        satellites=advance(exclusions.satellites, passed.satellites, inputs.dt_s, max_gap_s),
    )
