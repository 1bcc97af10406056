"""First stage of an epoch: what the receiver knows of the station and the satellites, and what it observed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from gbas_airborne.params import AirborneParams
from gbas_airborne.reception.station_data import Corrections, EphemerisChecks, StationData
from gbas_airborne.reception.vdb_messages import SOURCE, reception_step
from gbas_airborne.reception.vdb_state import ReceptionState
from gbas_core.gnss.ephemeris import Ephemeris, EphemerisStore
from gbas_core.gnss.epoch_order import Arrival, EpochOrder
from gbas_core.gnss.gpstime import epoch_key, seconds_between
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.positioning.approach import FinalApproach
from gbas_core.record import FloatArray
from gbas_msgs_py.codes import EventKind
from gbas_msgs_py.events import Event, EventLog
from gbas_vdb.transmission.burst import Burst


@dataclass(frozen=True, kw_only=True, eq=False)
class AirborneEpoch:
    """What the receiver gets for one epoch.

    Attributes
    ----------
    gps_week, tow_s
        The epoch.
    observations : ObservationEpoch or None
        None when the receiver gave none: there is then no position.
    bursts : tuple of Burst
        VDB bursts that arrived since the last epoch.
    ephemerides : tuple of Ephemeris
        Broadcast ephemerides received since the last epoch.
    """

    gps_week: int
    tow_s: float
    observations: ObservationEpoch | None
    bursts: tuple[Burst, ...] = ()
    ephemerides: tuple[Ephemeris, ...] = ()

    @property
    def epoch_ms(self) -> int:
        """The epoch [ms since the start of GPS time]."""
        return epoch_key(self.gps_week, self.tow_s)


@dataclass(frozen=True, kw_only=True, eq=False)
class ReceiveState:
    """What this stage remembers.

    Attributes
    ----------
    order : EpochOrder
        Of the epochs.
    vdb : ReceptionState
    ephemerides : EphemerisStore
        Broadcast ephemerides received.
    observations_missing : bool
        Whether the last epoch had none.
    """

    order: EpochOrder = field(default_factory=EpochOrder)
    vdb: ReceptionState = field(default_factory=ReceptionState)
    ephemerides: EphemerisStore = field(default_factory=EphemerisStore)
    observations_missing: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Received:
    """All there is to make a position of at an epoch.

    Attributes
    ----------
    gps_week, tow_s
        The epoch.
    arrival : Arrival
        Whether the epoch is taken, with what was known before or without.
    observations : ObservationEpoch or None
        Own observations of this epoch; none of one that is refused.
    ephemerides : EphemerisStore
    station : StationData or None
    approach : FinalApproach or None
        The one selected.
    corrections : mapping from a product's name to Corrections
    checks : EphemerisChecks
    p_d : (N_SATS,) array or None
        Decorrelation of the ephemeris error for GAST-D [m/m].
    events : tuple of Event
        What happened in this stage.
    """

    gps_week: int
    tow_s: float
    arrival: Arrival
    observations: ObservationEpoch | None
    ephemerides: EphemerisStore
    station: StationData | None
    approach: FinalApproach | None
    corrections: Mapping[str, Corrections]
    checks: EphemerisChecks
    events: tuple[Event, ...]
    p_d: FloatArray | None = None

    @property
    def epoch_ms(self) -> int:
        """The epoch [ms since the start of GPS time]."""
        return epoch_key(self.gps_week, self.tow_s)

    def since_s(self, instant: tuple[int, float]) -> float:
        """Time from an instant to the epoch [s]."""
        return seconds_between(*instant, self.gps_week, self.tow_s)


def receive(state: ReceiveState, epoch: AirborneEpoch, params: AirborneParams) -> tuple[ReceiveState, Received]:
    """Take in what arrived for an epoch; messages and ephemerides count also when the epoch itself is refused."""
    events = EventLog(epoch.gps_week, epoch.tow_s, SOURCE)
    state, arrival = _admit(state, epoch, events)
    vdb, messages = reception_step(state.vdb, epoch.bursts, epoch.gps_week, epoch.tow_s, params)
    events.extend(messages)
    store = state.ephemerides
    for ephemeris in epoch.ephemerides:
        store = store.add(ephemeris)
    state = replace(state, vdb=vdb, ephemerides=store)
    observations = None
    if arrival is not Arrival.REFUSED:
        observations = _observations(epoch)
        if observations is None and not state.observations_missing:
            events.add(EventKind.INPUT, "observations", "missing")
        state = replace(state, observations_missing=observations is None)
    received = Received(
        gps_week=epoch.gps_week,
        tow_s=epoch.tow_s,
        arrival=arrival,
        observations=observations,
        ephemerides=store,
        station=vdb.station,
        approach=vdb.approach,
        corrections=vdb.corrections,
        checks=vdb.checks,
        events=events.all(),
        p_d=vdb.p_d,
    )
    return state, received


def _admit(state: ReceiveState, epoch: AirborneEpoch, events: EventLog) -> tuple[ReceiveState, Arrival]:
    """Whether the epoch comes after the last one; a state that starts anew when time goes on from an earlier one."""
    order, arrival = state.order.step(epoch.epoch_ms)
    back_s = 0.0 - state.order.since_last_s(epoch.epoch_ms)  # never minus zero
    if arrival is Arrival.REFUSED:
        events.add(EventKind.INPUT, "observations", "time_backwards", back_s, 0.0)
    elif arrival is Arrival.RESTART:
        events.add(EventKind.INPUT, "observations", "time_restart", back_s)
        # what was received stays true; it is not sent again
        return ReceiveState(order=order, ephemerides=state.ephemerides), arrival
    return replace(state, order=order), arrival


def _observations(epoch: AirborneEpoch) -> ObservationEpoch | None:
    """The observations, if they are those of the epoch."""
    observations = epoch.observations
    return observations if observations is not None and observations.is_of(epoch.gps_week, epoch.tow_s) else None
