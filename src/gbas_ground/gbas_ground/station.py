"""The ground station: reference receivers' observations in, integrity and bursts out, one epoch at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import epoch_key, seconds_between
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS, SAT_IDS, satellites_of
from gbas_core.signals import L1, SPEED_OF_LIGHT_MPS
from gbas_ground.broadcast import (
    RESTART_AFTER_REFUSED,
    BroadcastState,
    broadcast_frame,
    empty_integrity,
    highest_sent,
    refused_in_a_row,
)
from gbas_ground.channels import ephemerides
from gbas_ground.channels.ephemerides import EphemerisState, initial_ephemerides
from gbas_ground.channels.predicted_ranges import PredictedRanges, Site, predict_ranges, site_of
from gbas_ground.channels.tracking import RawEpoch, TrackGroup, Tracks, initial_tracking, stack, track
from gbas_ground.consistency import (
    CorrectionInputs,
    Corrections,
    Exclusions,
    Finding,
    consistency_summaries,
    no_exclusions,
    readmission_state,
    resolve_consistency,
)
from gbas_ground.corrections.formation import range_correction_m
from gbas_ground.exclusions import advance, exclude, release
from gbas_ground.executive.channel_table import channel_epoch
from gbas_ground.executive.event_log import EventLog
from gbas_ground.executive.satellite_status import SatelliteStatus, integrity_of, satellite_status, withheld
from gbas_ground.ionosphere.position_errors import compile_ahead
from gbas_ground.ionosphere.protection import (
    IonosphereState,
    Protection,
    Sky,
    changes,
    initial_ionosphere,
    protect,
)
from gbas_ground.long_term import initial_long_term, monitor_sigmas
from gbas_ground.monitoring import MonitoringResult, MonitoringState, MonitorInputs, initial_monitoring, run_monitors
from gbas_ground.monitors.expected_range import check_expected_range
from gbas_ground.monitors.monitor_table import MonitorSummary, monitor_epoch, summarise
from gbas_ground.monitors.result import MonitorResult
from gbas_ground.monitors.sigma_monitor import SigmaMonitorState
from gbas_ground.monitors.signal_power import check_signal_power
from gbas_ground.params import GroundParams
from gbas_msgs_py.codes import ExclusionCause
from gbas_msgs_py.events import Event, EventKind
from gbas_msgs_py.records import ChannelEpoch, ChannelState, IntegrityEpoch, MonitorEpoch
from gbas_vdb.transmission.burst import Burst

_Checks = Sequence[tuple[ExclusionCause, MonitorResult]]


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundEpoch:
    """Everything that arrived for one epoch.

    Attributes
    ----------
    gps_week, tow_s
        The epoch.
    observations : tuple of ObservationEpoch or None
        One place a reference receiver; None where nothing arrived.
    ephemerides : tuple of Ephemeris
        Received since the epoch before.
    """

    gps_week: int
    tow_s: float
    observations: tuple[ObservationEpoch | None, ...]
    ephemerides: tuple[Ephemeris, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class Monitored:
    """What the station makes of one epoch, whatever happened.

    Attributes
    ----------
    integrity : IntegrityEpoch
        Corrections, and what may be broadcast of them.
    statistics : MonitorEpoch
        What every monitor measured.
    channels : ChannelEpoch
        State and cause of every receiver's channel of every satellite.
    events : tuple of Event
    """

    integrity: IntegrityEpoch
    statistics: MonitorEpoch
    channels: ChannelEpoch
    events: tuple[Event, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class PreviousEpoch:
    """What the range rate corrections and the slip tests need of the epoch before.

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
class IntegrityState:
    """What the station remembers between epochs; from :func:`initial_monitor_state`.

    Attributes
    ----------
    key : int or None
        Last epoch processed [ms since the start of GPS time].
    refused, refused_key : int
        Epochs refused in a row, and the last of them.
    ephemerides : EphemerisState
    tracking : tuple of TrackGroup
    exclusions : Exclusions
    previous : PreviousEpoch or None
    satellites : (N,) array
        :class:`ChannelState` of each satellite at the last epoch.
    causes : (N,) array
        :class:`ExclusionCause` at the last epoch.
    present : (R,) bool array
        Receivers that delivered the last epoch.
    contributing : (R,) bool array
        Receivers behind the corrections of the last epoch.
    serving : bool
        Whether there were corrections at the last epoch.
    channels : ChannelEpoch or None
        The executive's table of the last epoch.
    monitoring : MonitoringState
        Monitors of signals.
    long_term : SigmaMonitorState
        Monitor of B values over time.
    ionosphere : IonosphereState
        Protection against ionospheric fronts.
    """

    key: int | None
    refused: int
    refused_key: int
    ephemerides: EphemerisState
    tracking: tuple[TrackGroup, ...]
    exclusions: Exclusions
    previous: PreviousEpoch | None
    satellites: FloatArray
    causes: FloatArray
    present: BoolArray
    contributing: BoolArray
    serving: bool
    channels: ChannelEpoch | None
    monitoring: MonitoringState
    long_term: SigmaMonitorState
    ionosphere: IonosphereState


def initial_monitor_state(params: GroundParams) -> IntegrityState:
    """A station that has seen nothing."""
    if params.ionosphere.protects:
        compile_ahead()
    return IntegrityState(
        key=None,
        refused=0,
        refused_key=0,
        ephemerides=initial_ephemerides(),
        tracking=initial_tracking(params),
        exclusions=no_exclusions(params),
        previous=None,
        satellites=np.full(N_SATS, float(ChannelState.NOT_TRACKED)),
        causes=np.zeros(N_SATS),
        present=np.ones(params.n_receivers, dtype=bool),
        contributing=np.zeros(params.n_receivers, dtype=bool),
        serving=False,
        channels=None,
        monitoring=initial_monitoring(params),
        long_term=initial_long_term(params),
        ionosphere=initial_ionosphere(),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class StationState:
    """State of the whole station."""

    monitor: IntegrityState
    broadcast: BroadcastState


def initial_state(params: GroundParams) -> StationState:
    """A station that has just been switched on."""
    return StationState(monitor=initial_monitor_state(params), broadcast=BroadcastState())


@lru_cache(maxsize=8)
def _constants(params: GroundParams) -> tuple[Site, BoolArray]:
    return site_of(params), satellites_of(params.station.systems)


class GroundStation:
    """The station's steps; it holds nothing itself. Nodes, the offline command and studies all use these."""

    @staticmethod
    def monitor(state: IntegrityState, epoch: GroundEpoch, params: GroundParams) -> tuple[IntegrityState, Monitored]:
        """Corrections of one epoch after monitoring.

        Parameters
        ----------
        state : IntegrityState
        epoch : GroundEpoch
            One place in `observations` for each reference receiver of `params`. An epoch not later than the last one is
            refused with an event.
        params : GroundParams

        Returns
        -------
        state : IntegrityState
        monitored : Monitored
            Of the same epoch.

        Raises
        ------
        ValueError
            When the number of observations is not the number of receivers.
        """
        if len(epoch.observations) != params.n_receivers:
            raise ValueError(f"{len(epoch.observations)} observations for {params.n_receivers} reference receivers")
        # Nonsense in an ephemeris may overflow on its way to a monitor that refuses it.
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            return _monitor(state, epoch, params)

    @staticmethod
    def broadcast(
        state: BroadcastState, integrity: IntegrityEpoch, params: GroundParams
    ) -> tuple[BroadcastState, tuple[Burst, ...]]:
        """Bursts of the frame at the integrity's epoch; see :func:`gbas_ground.broadcast.broadcast_frame`."""
        return broadcast_frame(state, integrity, params)

    @staticmethod
    def step(
        state: StationState, epoch: GroundEpoch, params: GroundParams
    ) -> tuple[StationState, Monitored, tuple[Burst, ...]]:
        """Both together."""
        monitor, monitored = GroundStation.monitor(state.monitor, epoch, params)
        broadcast, bursts = GroundStation.broadcast(state.broadcast, monitored.integrity, params)
        return StationState(monitor=monitor, broadcast=broadcast), monitored, bursts


def _monitor(state: IntegrityState, epoch: GroundEpoch, params: GroundParams) -> tuple[IntegrityState, Monitored]:
    events = EventLog(epoch.gps_week, epoch.tow_s)
    admitted = _admit(state, epoch, params, events)
    if admitted is None:
        refused = replace(state, refused=_refused(state, epoch), refused_key=epoch_key(epoch.gps_week, epoch.tow_s))
        nothing = ChannelEpoch(gps_week=epoch.gps_week, tow_s=epoch.tow_s)
        integrity = empty_integrity(epoch.gps_week, epoch.tow_s)
        statistics = MonitorEpoch(gps_week=epoch.gps_week, tow_s=epoch.tow_s)
        return refused, Monitored(integrity=integrity, statistics=statistics, channels=nothing, events=events.all())
    return _process(admitted, epoch, params, events)


def _refused(state: IntegrityState, epoch: GroundEpoch) -> int:
    return refused_in_a_row(state.refused, state.refused_key, epoch_key(epoch.gps_week, epoch.tow_s))


def _admit(state: IntegrityState, epoch: GroundEpoch, params: GroundParams, events: EventLog) -> IntegrityState | None:
    """The state to continue from; None refuses the epoch."""
    key = epoch_key(epoch.gps_week, epoch.tow_s)
    if state.key is None or key > state.key:
        return replace(state, refused=0)
    if _refused(state, epoch) >= RESTART_AFTER_REFUSED:
        events.add(EventKind.STATION, "station", "restarted", (key - state.key) / 1000.0)
        # what was received stays true; it is not sent again
        return replace(initial_monitor_state(params), ephemerides=state.ephemerides)
    events.add(EventKind.INPUT, "station", "epoch_not_later", (key - state.key) / 1000.0, 0.0)
    return None


def _process(
    state: IntegrityState, epoch: GroundEpoch, params: GroundParams, events: EventLog
) -> tuple[IntegrityState, Monitored]:
    key = epoch_key(epoch.gps_week, epoch.tow_s)
    dt_s = float("nan") if state.key is None else (key - state.key) / 1000.0
    _, satellites = _constants(params)
    known, changed = _ephemerides(state, epoch, params, events)
    raw = stack(_of_this_epoch(epoch, events), satellites)
    _receiver_events(state, raw, events)
    exclusions = _released(state.exclusions, params, events)

    observed, exclusions = _track_channels(state, epoch, raw, known, changed, exclusions, params, events)
    judged = _judge(state, epoch, observed, known, changed, exclusions, dt_s, params, events)
    inputs, corrections = judged.correction_inputs, judged.corrections
    events.found(judged.findings)
    status = satellite_status(observed.tracked, observed.tracks, known, inputs, corrections, judged.exclusions, params)
    ionosphere, protection, status = _protect(state, key, status, corrections, observed.predicted, params, events)
    time, bound = (epoch.gps_week, epoch.tow_s), judged.monitor_output.orbit_bound
    integrity = integrity_of(*time, known, inputs, corrections, status, bound, protection, params)
    channels = channel_epoch(
        *time, observed.tracked, observed.tracks, inputs, corrections, status, judged.exclusions, state.channels
    )
    usable = status.state == ChannelState.USABLE
    serving, contributing = bool(usable.any()), (corrections.used & usable).any(axis=1)
    _contribution_events(state, contributing, raw, judged.exclusions, events)
    _satellite_events(state, status, serving, judged.findings, events)
    new = IntegrityState(
        key=key,
        refused=0,
        refused_key=0,
        ephemerides=known,
        tracking=observed.tracking,
        exclusions=judged.exclusions,
        previous=_previous_epoch(epoch, observed),
        satellites=status.state,
        causes=status.cause,
        present=raw.present,
        contributing=contributing,
        serving=serving,
        channels=channels,
        monitoring=judged.monitoring,
        long_term=judged.long_term,
        ionosphere=ionosphere,
    )
    statistics = monitor_epoch(*time, judged.summaries, judged.monitor_output.details, np.isfinite(integrity.state))
    return new, Monitored(integrity=integrity, statistics=statistics, channels=channels, events=events.all())


class _Judged(NamedTuple):
    """What the monitors leave of one epoch.

    Attributes
    ----------
    monitoring : MonitoringState
    monitor_output : MonitoringResult
        Monitors of signals.
    correction_inputs : CorrectionInputs
    corrections : Corrections
        Those that agree.
    exclusions : Exclusions
        With this epoch's.
    long_term : SigmaMonitorState
    summaries : mapping from a monitor's name to MonitorSummary
    findings : tuple of Finding
        Satellites, channels and receivers that were excluded, and why.
    """

    monitoring: MonitoringState
    monitor_output: MonitoringResult
    correction_inputs: CorrectionInputs
    corrections: Corrections
    exclusions: Exclusions
    long_term: SigmaMonitorState
    summaries: Mapping[str, MonitorSummary]
    findings: tuple[Finding, ...]


def _judge(
    state: IntegrityState,
    epoch: GroundEpoch,
    observed: _TrackedEpoch,
    known: EphemerisState,
    changed: BoolArray,
    exclusions: Exclusions,
    dt_s: float,
    params: GroundParams,
    events: EventLog,
) -> _Judged:
    """Run the monitors, exclude what fails, form corrections of the rest until they agree."""
    given = _monitor_inputs(state, epoch, observed, known, exclusions, changed, dt_s, params)
    monitoring, monitor_output = run_monitors(state.monitoring, given, params)
    exclusions = _exclude_channels(exclusions, monitor_output.channels, events)
    exclusions = _exclude_receivers(exclusions, monitor_output.receivers, ExclusionCause.RECEIVER_BASELINES, events)
    exclusions, of_signals = _exclude_satellites(exclusions, monitor_output)
    inputs = _correction_inputs(state, observed, monitor_output, known, changed, dt_s, params)
    corrections, exclusions, of_corrections = resolve_consistency(inputs, exclusions, params)
    long_term, exclusions, of_sigmas, sigma_summaries = monitor_sigmas(
        state.long_term, corrections, exclusions, dt_s, params
    )
    checks = zip(("range", "power"), observed.checks, strict=True)
    return _Judged(
        monitoring=monitoring,
        monitor_output=monitor_output,
        correction_inputs=inputs,
        corrections=corrections,
        exclusions=_advanced(exclusions, inputs, corrections, observed.channel_ok, monitor_output, dt_s, params),
        long_term=long_term,
        summaries={
            **{name: summarise(result, observed.tracked) for name, (_, result) in checks},
            **monitor_output.summaries,
            **consistency_summaries(corrections, params),
            **sigma_summaries,
        },
        findings=(*of_signals, *of_corrections, *of_sigmas),
    )


class _TrackedEpoch(NamedTuple):
    """What the receivers measured at one epoch, checked, followed over slips and smoothed.

    Attributes
    ----------
    raw : RawEpoch
        Without measurements far from what is expected.
    predicted : PredictedRanges
    tracked, channel_ok, settled : (R, N) bool arrays
        Channels with code and carrier; those that pass the checks of channels; those whose filters have settled.
    checks : sequence of (cause, result)
    tracking : tuple of TrackGroup
    tracks : Tracks
    correction_m : (tau, R, N) array
        PR_sc [m].
    """

    raw: RawEpoch
    predicted: PredictedRanges
    tracked: BoolArray
    channel_ok: BoolArray
    settled: BoolArray
    checks: _Checks
    tracking: tuple[TrackGroup, ...]
    tracks: Tracks
    correction_m: FloatArray


def _track_channels(
    state: IntegrityState,
    epoch: GroundEpoch,
    raw: RawEpoch,
    known: EphemerisState,
    changed: BoolArray,
    exclusions: Exclusions,
    params: GroundParams,
    events: EventLog,
) -> tuple[_TrackedEpoch, Exclusions]:
    """Check the channels, exclude what fails, and smooth the rest."""
    site, _ = _constants(params)
    predicted = predict_ranges(known.current, epoch.gps_week, epoch.tow_s, raw.code_m[:, L1], site)
    tracked = np.isfinite(raw.code_m[:, L1] + raw.carrier_m[:, L1])
    checks = _channel_checks(raw, predicted, tracked, params)
    excluding = checks if params.signal_power.exclude else checks[:1]
    exclusions = _exclude_channels(exclusions, excluding, events)
    exclusions = _exclude_receivers(
        exclusions, _far_receivers(checks[0][1], params), ExclusionCause.RECEIVER_FAULT, events
    )
    clean = _without(raw, checks[0][1].failed)
    key = epoch_key(epoch.gps_week, epoch.tow_s)
    tracking, tracks = track(state.tracking, clean, key, _comparable_range_m(predicted, changed), params)
    correction_m = range_correction_m(predicted.range_m, tracks.smoothed_m, predicted.clock_s)
    observed = _TrackedEpoch(
        raw=clean,
        predicted=predicted,
        tracked=tracked,
        channel_ok=tracked & ~np.logical_or.reduce([check.failed for _, check in excluding]),
        settled=_settled(tracks, correction_m, predicted, params),
        checks=checks,
        tracking=tracking,
        tracks=tracks,
        correction_m=correction_m,
    )
    return observed, exclusions


def _monitor_inputs(
    state: IntegrityState,
    epoch: GroundEpoch,
    observed: _TrackedEpoch,
    known: EphemerisState,
    exclusions: Exclusions,
    changed: BoolArray,
    dt_s: float,
    params: GroundParams,
) -> MonitorInputs:
    """What the monitors of signals are given."""
    site, _ = _constants(params)
    raw, tracks, predicted = observed.raw, observed.tracks, observed.predicted
    usable = observed.channel_ok & exclusions.usable_channels()
    high = predicted.elevation_rad >= params.monitors.elevation_mask_rad
    due = ((usable & observed.settled).sum(axis=0) >= params.receivers.minimum) & np.isfinite(known.crc)
    return MonitorInputs(
        code_m=raw.code_m,
        carrier_m=tracks.carrier_m,
        cn0_dbhz=raw.cn0_dbhz,
        slipped=tracks.slipped,
        usable=usable & high & ~exclusions.satellites.excluded,
        ready=usable & observed.settled,
        suspended=observed.channel_ok
        & observed.settled
        & exclusions.receivers.excluded[:, np.newaxis]
        & ~exclusions.channels.excluded,
        in_use=state.satellites == ChannelState.USABLE,
        due=due,
        may_refer=due & ~exclusions.satellites.excluded,
        predicted=predicted,
        rebased=changed,
        shift_m=_shift_m(state, epoch, predicted, changed, raw, site),
        dt_s=dt_s,
    )


def _correction_inputs(
    state: IntegrityState,
    observed: _TrackedEpoch,
    monitor_output: MonitoringResult,
    known: EphemerisState,
    changed: BoolArray,
    dt_s: float,
    params: GroundParams,
) -> CorrectionInputs:
    """What the corrections are formed from."""
    site, _ = _constants(params)
    previous = state.previous if dt_s <= params.smoothing.max_gap_s else None
    return CorrectionInputs(
        correction_m=observed.correction_m,
        previous_m=_previous_corrections(
            previous,
            known.current,
            changed,
            observed.correction_m.shape,
            site,
        ),
        dt_s=dt_s,
        settled=observed.settled,
        judged=monitor_output.ready,
        elevation_rad=observed.predicted.elevation_rad,
    )


def _protect(
    state: IntegrityState,
    key: int,
    status: SatelliteStatus,
    corrections: Corrections,
    predicted: PredictedRanges,
    params: GroundParams,
    events: EventLog,
) -> tuple[IonosphereState, Protection, SatelliteStatus]:
    """Protection of what would be sent against ionospheric fronts; what it cannot protect is not used."""
    if state.key is None and not params.ionosphere.protects:
        events.add(EventKind.STATION, "station", "ionosphere_no_threat_model")
    usable = status.state == ChannelState.USABLE
    sent = highest_sent(usable, predicted.elevation_rad, params) if params.ionosphere.protects else usable
    sky = Sky(predicted.elevation_rad, predicted.azimuth_rad, corrections.sigmas.gnd_m, corrections.count)
    ionosphere, protection = protect(state.ionosphere, key, sent, sky, params)
    previous = state.ionosphere.protection
    if ionosphere.protection is not None and ionosphere.protection is not previous:
        for cause, value, threshold in changes(previous, ionosphere.protection):
            events.add(EventKind.STATION, "station", cause, value, threshold)
    return ionosphere, protection, status if protection.available else withheld(status)


def _previous_epoch(epoch: GroundEpoch, observed: _TrackedEpoch) -> PreviousEpoch:
    """What the next epoch needs of this one."""
    return PreviousEpoch(
        gps_week=epoch.gps_week,
        tow_s=epoch.tow_s,
        code_m=observed.raw.code_m[:, L1],
        smoothed_m=observed.tracks.smoothed_m,
        correction_m=observed.correction_m,
    )


def _ephemerides(
    state: IntegrityState, epoch: GroundEpoch, params: GroundParams, events: EventLog
) -> tuple[EphemerisState, BoolArray]:
    known = state.ephemerides
    for received in epoch.ephemerides:
        known, refused = ephemerides.receive(known, received, epoch.gps_week, epoch.tow_s, params)
        events.extend(refused)
    known, changed, changes = ephemerides.choose(known, epoch.gps_week, epoch.tow_s, params)
    events.extend(changes)
    return known, changed


def _of_this_epoch(epoch: GroundEpoch, events: EventLog) -> tuple[ObservationEpoch | None, ...]:
    """The observations; one that carries another epoch does not count."""
    result: list[ObservationEpoch | None] = []
    for row, each in enumerate(epoch.observations):
        if each is not None and not each.is_of(epoch.gps_week, epoch.tow_s):
            late_s = seconds_between(epoch.gps_week, epoch.tow_s, each.gps_week, each.tow_s)
            events.add(EventKind.INPUT, f"rr{row + 1}", "wrong_epoch", late_s, 0.0)
            result.append(None)
        else:
            result.append(each)
    return tuple(result)


def _receiver_events(state: IntegrityState, raw: RawEpoch, events: EventLog) -> None:
    for row in np.flatnonzero(raw.present != state.present):
        events.add(EventKind.INPUT, f"rr{row + 1}", "back" if raw.present[row] else "missing")


def _contribution_events(
    state: IntegrityState, contributing: BoolArray, raw: RawEpoch, exclusions: Exclusions, events: EventLog
) -> None:
    """Receivers that went out of the corrections, or came into them, without an event of their own."""
    told = ~raw.present | exclusions.receivers.excluded
    for row in np.flatnonzero(state.contributing & ~contributing & ~told):
        events.add(EventKind.EXCLUSION, f"rr{row + 1}", "no_channels")
    for row in np.flatnonzero(~state.contributing & contributing):
        events.add(EventKind.READMISSION, f"rr{row + 1}", "used")


def _released(exclusions: Exclusions, params: GroundParams, events: EventLog) -> Exclusions:
    """End what has been clear for the re-admission time."""
    times = params.monitors.readmission_time_s, params.monitors.readmission_longest_s
    channels, channels_ended = release(exclusions.channels, *times)
    receivers, receivers_ended = release(exclusions.receivers, *times)
    satellites, _ = release(exclusions.satellites, *times)  # told when they are usable again
    for row in np.flatnonzero(receivers_ended):
        cause = ExclusionCause(int(exclusions.receivers.cause[row]))
        waited_s = max(params.monitors.readmission_time_s, float(exclusions.receivers.wait_s[row]))
        events.add(EventKind.READMISSION, f"rr{row + 1}", cause.word, waited_s)
    for row, satellite in np.argwhere(channels_ended) if channels_ended.any() else ():
        cause = ExclusionCause(int(exclusions.channels.cause[row, satellite]))
        waited_s = max(params.monitors.readmission_time_s, float(exclusions.channels.wait_s[row, satellite]))
        events.add(EventKind.READMISSION, f"rr{row + 1}/{SAT_IDS[satellite]}", cause.word, waited_s)
    return Exclusions(channels=channels, receivers=receivers, satellites=satellites)


def _channel_checks(raw: RawEpoch, predicted: PredictedRanges, tracked: BoolArray, params: GroundParams) -> _Checks:
    """Monitors of single channels, each ``(R, N)``; the first also keeps measurements out of the filters."""
    raw_correction = range_correction_m(predicted.range_m, raw.code_m[:, L1], predicted.clock_s)
    comparable = tracked & np.isfinite(predicted.clock_s)
    residual = check_expected_range(raw_correction, comparable, params.expected_range.max_residual_m)
    power = check_signal_power(
        raw.cn0_dbhz[:, L1], tracked, params.signal_power.min_cn0_dbhz, required=params.signal_power.require_cn0
    )
    return ((ExclusionCause.RANGE_RESIDUAL, residual), (ExclusionCause.SIGNAL_POWER, power))


def _exclude_channels(exclusions: Exclusions, checks: _Checks, events: EventLog) -> Exclusions:
    channels = exclusions.channels
    for cause, check in checks:
        if not check.failed.any():
            continue
        for row, satellite in np.argwhere(check.failed & ~channels.excluded):
            value, threshold = check.at(row, satellite)
            events.add(EventKind.EXCLUSION, f"rr{row + 1}/{SAT_IDS[satellite]}", cause.word, value, threshold)
        channels = exclude(channels, check.failed, cause)
    return replace(exclusions, channels=channels)


def _far_receivers(residual: MonitorResult, params: GroundParams) -> MonitorResult:
    """Receivers far from the expected ranges on several satellites: how many, ``(R,)``.

    Then it is not the satellites but the receiver, its time tag or its position, and what is within the limit is wrong
    too.
    """
    failures = residual.failed.sum(axis=1)
    least = params.monitors.receiver_fault_channels
    return MonitorResult(
        statistic=failures.astype(np.float64), threshold=np.array(float(least)), failed=failures >= least
    )


def _exclude_receivers(
    exclusions: Exclusions, result: MonitorResult, cause: ExclusionCause, events: EventLog
) -> Exclusions:
    if not result.failed.any():
        return exclusions
    for row in np.flatnonzero(result.failed & ~exclusions.receivers.excluded):
        events.add(EventKind.EXCLUSION, f"rr{row + 1}", cause.word, *result.at(int(row)))
    return replace(exclusions, receivers=exclude(exclusions.receivers, result.failed, cause))


def _shift_m(
    state: IntegrityState, epoch: GroundEpoch, predicted: PredictedRanges, changed: BoolArray, raw: RawEpoch, site: Site
) -> FloatArray:
    """What another ephemeris than that of the epoch before adds to a carrier's residual, ``(R, N)`` [m]."""
    if not changed.any():
        return np.zeros_like(predicted.range_m)
    old = predict_ranges(state.ephemerides.current, epoch.gps_week, epoch.tow_s, raw.code_m[:, L1], site)
    shift_m = old.range_m - predicted.range_m - SPEED_OF_LIGHT_MPS * (old.clock_s - predicted.clock_s)
    return np.where(changed, shift_m, 0.0)


def _exclude_satellites(
    exclusions: Exclusions, monitor_output: MonitoringResult
) -> tuple[Exclusions, tuple[Finding, ...]]:
    """Exclude the satellites that monitors of signals fail; several may fail one, and each says so."""
    satellites, findings = exclusions.satellites, []
    for cause, result in monitor_output.satellites:
        if not result.failed.any():
            continue
        for satellite in np.flatnonzero(result.failed & ~exclusions.satellites.excluded):
            value, threshold = result.at(int(satellite))
            findings.append(Finding(subject=SAT_IDS[satellite], cause=cause, value=value, threshold=threshold))
        satellites = exclude(satellites, result.failed, cause)
    return replace(exclusions, satellites=satellites), tuple(findings)


def _without(raw: RawEpoch, failed: BoolArray) -> RawEpoch:
    """Raw observations without those that must not enter a filter."""
    if not failed.any():
        return raw
    return raw._replace(code_m=np.where(failed[:, np.newaxis, :], np.nan, raw.code_m))


def _comparable_range_m(predicted: PredictedRanges, changed: BoolArray) -> FloatArray:
    """Expected ranges for the slip tests, missing where another ephemeris would look like a slip."""
    range_m = predicted.range_m - SPEED_OF_LIGHT_MPS * predicted.clock_s
    return np.where(changed, np.nan, range_m)


def _previous_corrections(
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


def _settled(tracks: Tracks, correction_m: FloatArray, predicted: PredictedRanges, params: GroundParams) -> BoolArray:
    """Channels whose filters have run long enough, of satellites above the mask, ``(R, N)``."""
    high = predicted.elevation_rad >= params.monitors.elevation_mask_rad
    return np.isfinite(correction_m).all(axis=0) & (tracks.age_s >= params.smoothing.settle_time_s) & high


def _advanced(
    exclusions: Exclusions,
    correction_inputs: CorrectionInputs,
    corrections: Corrections,
    channel_ok: BoolArray,
    monitor_output: MonitoringResult,
    dt_s: float,
    params: GroundParams,
) -> Exclusions:
    """Count the clear time of everything that is excluded."""
    latches = (exclusions.channels, exclusions.receivers, exclusions.satellites)
    if not any(latch.remembers for latch in latches):
        return exclusions
    satellite_ok = monitor_output.passed(params.monitors.readmission_share)
    passed = readmission_state(
        correction_inputs, corrections, exclusions, channel_ok, monitor_output.receivers_quiet, satellite_ok, params
    )
    return Exclusions(
        channels=advance(exclusions.channels, passed.channels, dt_s, params.smoothing.max_gap_s),
        receivers=advance(exclusions.receivers, passed.receivers, dt_s, params.smoothing.max_gap_s),
        satellites=advance(exclusions.satellites, passed.satellites, dt_s, params.smoothing.max_gap_s),
    )


def _satellite_events(
    state: IntegrityState, status: SatelliteStatus, serving: bool, findings: tuple[Finding, ...], events: EventLog
) -> None:
    """Satellites that came into use or went out of it, and the station with the first and the last of them."""
    now, was = status.state == ChannelState.USABLE, state.satellites == ChannelState.USABLE
    told = {finding.subject for finding in findings}
    for satellite in np.flatnonzero(now != was):
        subject = SAT_IDS[satellite]
        if now[satellite]:
            cause = ExclusionCause(int(state.causes[satellite]))
            events.add(EventKind.READMISSION, subject, cause.word)
        elif subject not in told:
            cause = ExclusionCause(int(status.cause[satellite])) or ExclusionCause.NOT_TRACKED
            events.add(EventKind.EXCLUSION, subject, cause.word)
    if serving != state.serving:
        events.add(
            EventKind.STATION, "station", "corrections_begin" if serving else "corrections_end", float(now.sum())
        )
