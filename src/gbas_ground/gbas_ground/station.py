"""The ground station: reference receivers' observations in, integrity and bursts out, one epoch at a time.

    receive -> track -> monitor -> correct -> decide -> (second band) -> report -> broadcast

The stages are in :mod:`gbas_ground.stages`; each has its own part of the state, takes one record and gives one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gbas_core.gnss.epoch_order import Arrival, EpochOrder
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.satellites import N_SATS
from gbas_ground.broadcast import BroadcastState, broadcast_frame
from gbas_ground.channels.ephemerides import EphemerisState, initial_ephemerides
from gbas_ground.channels.tracking import initial_tracking
from gbas_ground.consistency import no_exclusions
from gbas_ground.ionosphere.protection import initial_ionosphere
from gbas_ground.long_term import initial_long_term
from gbas_ground.params import GroundParams
from gbas_ground.prepared import PreparedStation
from gbas_ground.stages.channel_table import NO_CHANNELS
from gbas_ground.stages.correct import CorrectState, correct
from gbas_ground.stages.decide import DecideState, decide
from gbas_ground.stages.monitor import MonitorState, initial_monitors, monitor_signals
from gbas_ground.stages.receive import SOURCE, GroundEpoch, ReceiveState, receive
from gbas_ground.stages.report import ReportState, StationReport, refusal, report
from gbas_ground.stages.satellite_status import SatelliteStatus
from gbas_ground.stages.second_band import SecondBandState, initial_second_band, second_band
from gbas_ground.stages.track import TrackState, track_channels
from gbas_msgs_py.codes import ChannelState, EventKind
from gbas_msgs_py.events import EventLog
from gbas_msgs_py.records import IntegrityEpoch
from gbas_vdb.transmission.burst import Burst

__all__ = ["GroundEpoch", "GroundStation", "IntegrityState", "StationReport", "StationState"]


@dataclass(frozen=True, kw_only=True, eq=False)
class IntegrityState:
    """What the station remembers between epochs, stage by stage; from :meth:`GroundStation.initial_integrity`.

    Attributes
    ----------
    order : EpochOrder
        Last epoch processed, and those refused since.
    """

    order: EpochOrder
    receive: ReceiveState
    track: TrackState
    monitor: MonitorState
    correct: CorrectState
    decide: DecideState
    second: SecondBandState | None
    report: ReportState


@dataclass(frozen=True, kw_only=True, eq=False)
class StationState:
    """State of the whole station."""

    integrity: IntegrityState
    broadcast: BroadcastState


class GroundStation:
    """A station made ready: its parameters and all that follows from them; what it remembers is given and given back.

    Nodes, the offline command and studies all use it.

    Parameters
    ----------
    params : GroundParams
    """

    def __init__(self, params: GroundParams) -> None:
        self.params = params
        self._prepared = PreparedStation(params)

    def initial_state(self) -> StationState:
        """A station that has just been switched on."""
        return StationState(integrity=self.initial_integrity(), broadcast=BroadcastState())

    def initial_integrity(self, ephemerides: EphemerisState | None = None) -> IntegrityState:
        """Monitors and corrections that have seen nothing but, perhaps, ephemerides."""
        count = self.params.n_receivers
        nothing = SatelliteStatus(state=np.full(N_SATS, float(ChannelState.NOT_TRACKED)), cause=np.zeros(N_SATS))
        return IntegrityState(
            order=EpochOrder(),
            receive=ReceiveState(
                last_ms=None,
                ephemerides=ephemerides or initial_ephemerides(),
                present=np.ones(count, dtype=bool),
                exclusions=no_exclusions(self.params),
            ),
            track=TrackState(groups=initial_tracking(self._prepared.filters, count)),
            monitor=MonitorState(memories=initial_monitors(self._prepared), in_use=np.zeros(N_SATS, dtype=bool)),
            correct=CorrectState(previous=None, sigmas=initial_long_term(self.params)),
            decide=DecideState(ionosphere=initial_ionosphere()),
            second=initial_second_band(self._prepared),
            report=ReportState(
                status=nothing, contributing=np.zeros(count, dtype=bool), serving=False, channels=NO_CHANNELS
            ),
        )

    def monitor(self, state: IntegrityState, epoch: GroundEpoch) -> tuple[IntegrityState, StationReport]:
        """Corrections of one epoch after monitoring.

        Parameters
        ----------
        state : IntegrityState
        epoch : GroundEpoch
            One place in `observations` for each reference receiver. An epoch not later than the last one is refused
            with an event.

        Raises
        ------
        ValueError
            When the number of observations is not the number of receivers.
        """
        if len(epoch.observations) != self.params.n_receivers:
            raise ValueError(
                f"{len(epoch.observations)} observations for {self.params.n_receivers} reference receivers"
            )
        key, events = epoch_key(epoch.gps_week, epoch.tow_s), EventLog(epoch.gps_week, epoch.tow_s, SOURCE)
        order, arrival = state.order.step(key)
        if arrival is Arrival.REFUSED:
            events.add(EventKind.INPUT, "station", "epoch_not_later", state.order.since_last_s(key), 0.0)
            return replace(state, order=order), refusal(epoch, events)
        if arrival is Arrival.RESTART:
            events.add(EventKind.STATION, "station", "restarted", state.order.since_last_s(key))
            # what was received stays true; it is not sent again
            state = self.initial_integrity(state.receive.ephemerides)
        # Nonsense in an ephemeris may overflow on its way to a monitor that refuses it.
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            return self._process(replace(state, order=order), epoch, events)

    def broadcast(self, state: BroadcastState, integrity: IntegrityEpoch) -> tuple[BroadcastState, tuple[Burst, ...]]:
        """Bursts of the frame at the integrity's epoch; see :func:`gbas_ground.broadcast.broadcast_frame`."""
        return broadcast_frame(state, integrity, self._prepared)

    def step(self, state: StationState, epoch: GroundEpoch) -> tuple[StationState, StationReport, tuple[Burst, ...]]:
        """Both together."""
        integrity, made = self.monitor(state.integrity, epoch)
        broadcast, bursts = self.broadcast(state.broadcast, made.integrity)
        return StationState(integrity=integrity, broadcast=broadcast), made, bursts

    def _process(
        self, state: IntegrityState, epoch: GroundEpoch, events: EventLog
    ) -> tuple[IntegrityState, StationReport]:
        """The stages, one after the other."""
        station = self._prepared
        receiving, received = receive(state.receive, epoch, events, station)
        tracking, tracked = track_channels(state.track, received, station)
        monitoring, monitored = monitor_signals(state.monitor, tracked, station)
        correcting, corrected = correct(state.correct, monitored, station)
        deciding, decided = decide(state.decide, corrected, station)
        second_state, second = state.second, None
        if second_state is not None and station.second is not None:
            second_state, second = second_band(second_state, decided, station, station.second)
        reporting, made = report(state.report, decided, second, station)
        return IntegrityState(
            order=state.order,
            receive=replace(receiving, exclusions=corrected.exclusions),
            track=tracking,
            monitor=replace(monitoring, in_use=decided.status.usable),
            correct=correcting,
            decide=deciding,
            second=second_state,
            report=reporting,
        ), made
