"""Report: the tables of the epoch, and events of what came into use or went out of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import SAT_IDS
from gbas_ground.broadcast import empty_integrity, fitting
from gbas_ground.corrections.second_band import SUFFIX
from gbas_ground.monitors.monitor_table import monitor_detail_epoch, monitor_epoch
from gbas_ground.prepared import PreparedStation
from gbas_ground.stages.channel_table import channel_epoch
from gbas_ground.stages.correct import Corrected
from gbas_ground.stages.decide import Decided
from gbas_ground.stages.integrity_table import integrity_of, with_second_band
from gbas_ground.stages.kernels.status import used_of_usable
from gbas_ground.stages.receive import GroundEpoch
from gbas_ground.stages.satellite_status import SatelliteStatus
from gbas_ground.stages.second_band import SecondBand
from gbas_msgs_py.codes import EventKind, ExclusionCause
from gbas_msgs_py.events import Event, EventLog
from gbas_msgs_py.records import ChannelEpoch, IntegrityEpoch, MonitorDetailEpoch, MonitorEpoch


@dataclass(frozen=True, kw_only=True, eq=False)
class StationReport:
    """What the station makes of one epoch, whatever happened.

    Attributes
    ----------
    integrity : IntegrityEpoch
        Corrections, and what may be broadcast of them.
    statistics : MonitorEpoch
        What every monitor said.
    details : MonitorDetailEpoch
        What is behind it.
    channels : ChannelEpoch
        State and cause of every receiver's channel of every satellite.
    events : tuple of Event
    """

    integrity: IntegrityEpoch
    statistics: MonitorEpoch
    details: MonitorDetailEpoch
    channels: ChannelEpoch
    events: tuple[Event, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class ReportState:
    """Memory of this stage: what was said at the epoch before.

    Attributes
    ----------
    status : SatelliteStatus
    contributing : (R,) bool array
        Receivers behind the corrections.
    serving : bool
        Whether there were corrections.
    channels : array
        The executive's table, of :func:`~gbas_ground.stages.channel_table.channel_epoch`.
    left_out : tuple of int
        Satellites for which the frame had no room, on the first band and on the second.
    """

    status: SatelliteStatus
    contributing: BoolArray
    serving: bool
    channels: FloatArray
    left_out: tuple[int, int] = (0, 0)


def report(
    state: ReportState, decided: Decided, second: SecondBand | None, station: PreparedStation
) -> tuple[ReportState, StationReport]:
    """Tables and events of one epoch."""
    corrected, status = decided.corrected, decided.status
    tracked, signals = corrected.monitored.tracked, corrected.monitored.signals
    now = tracked.received.now
    time = now.gps_week, now.tow_s
    used, contributing = used_of_usable(corrected.corrections.used, status.state)
    integrity = integrity_of(decided, used, int(np.count_nonzero(contributing)), station.params)
    if second is not None and station.second is not None:
        integrity = with_second_band(integrity, second, station.second)
    table, channels = channel_epoch(decided, state.channels)
    serving = bool(status.usable.any())
    _contribution_events(state.contributing, contributing, corrected, now.events)
    _satellite_events(state, decided, serving, now.events)
    left_out = _room_events(state.left_out, integrity, status, second, station, now.events)
    shown = np.isfinite(integrity.state)
    summaries = {**tracked.summaries, **signals.summaries, **corrected.summaries}
    made = StationReport(
        integrity=integrity,
        statistics=monitor_epoch(*time, summaries, shown, {} if second is None else second.summaries),
        details=monitor_detail_epoch(*time, signals.details, shown),
        channels=channels,
        events=now.events.all(),
    )
    after = ReportState(status=status, contributing=contributing, serving=serving, channels=table, left_out=left_out)
    return after, made


def _room_events(
    before: tuple[int, int], integrity: IntegrityEpoch, status: SatelliteStatus, second: SecondBand | None,
    station: PreparedStation, events: EventLog,
) -> tuple[int, int]:  # fmt: skip
    """Say when satellites are left out for want of room, by how many, and when all fit again; value: those there are,
    threshold: those that fit."""
    n_usable, frames = int(np.count_nonzero(status.usable)), station.frames
    n_second = 0 if second is None else int(np.count_nonzero(second.usable))
    fits = n_usable <= frames.room
    if fits and n_second <= (frames.second_rooms[n_usable] if n_second else 0):
        left_out, counts = (0, 0), (n_usable, n_second)
        rooms = frames.room, frames.second_rooms[n_usable] if frames.second_rooms else 0
    else:
        sent = fitting(integrity, station)
        left_out = sent.left_out, sent.second_left_out
        counts = len(sent.satellites) + left_out[0], len(sent.second) + left_out[1]
        rooms = sent.room, max(sent.second_room, 0)
    for subject, was, now, count, room in zip(
        ("station", "station" + SUFFIX), before, left_out, counts, rooms, strict=True
    ):
        if was != now:
            events.add(EventKind.STATION, subject, "no_room" if now else "room_for_all", float(count), float(room))
    return left_out


def refusal(epoch: GroundEpoch, events: EventLog) -> StationReport:
    """Of an epoch that is not taken: nothing but the event."""
    week, tow_s = epoch.gps_week, epoch.tow_s
    return StationReport(
        integrity=empty_integrity(week, tow_s),
        statistics=MonitorEpoch(gps_week=week, tow_s=tow_s),
        details=MonitorDetailEpoch(gps_week=week, tow_s=tow_s),
        channels=ChannelEpoch(gps_week=week, tow_s=tow_s),
        events=events.all(),
    )


def _contribution_events(before: BoolArray, contributing: BoolArray, corrected: Corrected, events: EventLog) -> None:
    """Receivers that went out of the corrections, or came into them, without an event of their own."""
    if not (before != contributing).any():
        return
    raw = corrected.monitored.tracked.received.raw
    told = ~raw.present | corrected.exclusions.receivers.excluded
    for row in np.flatnonzero(before & ~contributing & ~told):
        events.add(EventKind.EXCLUSION, f"rr{row + 1}", "no_channels")
    for row in np.flatnonzero(~before & contributing):
        events.add(EventKind.READMISSION, f"rr{row + 1}", "used")


def _satellite_events(state: ReportState, decided: Decided, serving: bool, events: EventLog) -> None:
    """Satellites that came into use or went out of it, and the station with the first and the last of them."""
    now, was = decided.status.usable, state.status.usable
    if not (now != was).any():
        return
    told = {finding.subject for finding in decided.corrected.findings}
    for satellite in np.flatnonzero(now != was):
        subject = SAT_IDS[satellite]
        if now[satellite]:
            cause = ExclusionCause(int(state.status.cause[satellite]))
            events.add(EventKind.READMISSION, subject, cause.word)
        elif subject not in told:
            cause = ExclusionCause(int(decided.status.cause[satellite])) or ExclusionCause.NOT_TRACKED
            events.add(EventKind.EXCLUSION, subject, cause.word)
    if serving != state.serving:
        events.add(
            EventKind.STATION, "station", "corrections_begin" if serving else "corrections_end", float(now.sum())
        )
