"""One fault into a settled station: when is it found, by which monitor, and when does a burst say so?

Epochs of a world are functions of its parameters and their number, and the station's state is a value. So the quiet
part of a run, in which the filters settle, is made once; each fault goes on from there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_core.satellites import RANGING_SOURCE_ID, SAT_INDEX
from gbas_ground.params import GroundParams
from gbas_ground.station import GroundEpoch, GroundStation, StationReport, StationState
from gbas_msgs_py.codes import EventKind, MonitorState
from gbas_msgs_py.events import Event
from gbas_msgs_py.joining import ReceptionQueue
from gbas_msgs_py.products import L1_100
from gbas_sim.atmosphere.fronts import PlasmaBubble, WedgeFront
from gbas_sim.faults.kinds import ReceiverFault, SatelliteFault
from gbas_sim.world import World
from gbas_sim.world_params import WorldParams
from gbas_vdb.messages.types import Type1, Type11
from gbas_vdb.transmission.burst import SLOT_DURATION_S, Burst
from gbas_vdb.transmission.receive import decode_burst

Threat = SatelliteFault | ReceiverFault | WedgeFront | PlasmaBubble


@dataclass(frozen=True, kw_only=True, eq=False)
class Settled:
    """A station after a quiet start.

    Attributes
    ----------
    world : World
        Without threats.
    params : GroundParams
    state : StationState
    number : int
        Epochs made.
    usable : tuple of str
        Satellites broadcast as usable.
    """

    world: World
    params: GroundParams
    state: StationState
    number: int
    usable: tuple[str, ...]

    @property
    def time_s(self) -> float:
        """Time of the next epoch since the start of the run [s]."""
        return self.number * self.world.params.interval_s


@dataclass(frozen=True, kw_only=True)
class Reaction:
    """What became of a fault; times are since its onset [s], NaN for what did not happen.

    Attributes
    ----------
    detected_s : float
        Epoch at which the satellite or receiver first was no longer used.
    burst_s : float
        End of the slot of the first burst after the onset from which a user no longer gets a valid correction of the
        satellite, or gets corrections without the receiver's channel: the moment the alert has arrived.
    cause : str
        Word of the first exclusion, or ``""``.
    value, threshold : float
        Of that event.
    failed_s : mapping from a monitor's name to float
        First epoch at which each monitor failed the satellite, whether or not that excludes it.
    others : tuple of str
        Other subjects excluded within the run: false exclusions of satellites that have no fault.
    """

    detected_s: float
    burst_s: float
    cause: str
    value: float
    threshold: float
    failed_s: Mapping[str, float] = field(default_factory=dict)
    others: tuple[str, ...] = ()

    @property
    def detected(self) -> bool:
        """Whether the fault was found."""
        return math.isfinite(self.detected_s)


def settle(params: WorldParams, station: GroundParams, quiet_s: float) -> Settled:
    """Step a station through a quiet world.

    Parameters
    ----------
    params : WorldParams
        Threats in it are left out.
    station : GroundParams
    quiet_s : float
        How long; the run must last longer [s].
    """
    world = World(replace(params, faults=(), fronts=()))
    count = round(quiet_s / params.interval_s)
    state = GroundStation(station).initial_state()
    usable: tuple[str, ...] = ()
    for after, monitored, _ in _steps(world, station, state, range(count)):
        state = after
        usable = tuple(_usable(monitored))
    return Settled(world=world, params=station, state=state, number=count, usable=usable)


def inject(settled: Settled, threats: tuple[Threat, ...], subject: str, onset_s: float, watch_s: float) -> Reaction:
    """Let a fault happen to a settled station.

    Parameters
    ----------
    settled : Settled
    threats : tuple of Threat
        Whose times are since the start of the run.
    subject : str
        Satellite or receiver that must no longer be used, such as ``"G05"`` or ``"rr2"``.
    onset_s : float
        When the fault begins, since the start of the run [s]; not before the settled station's next epoch.
    watch_s : float
        How long to look [s]; at most to the end of the run.

    Raises
    ------
    ValueError
        When the onset is in the quiet part, or the run ends before it.
    """
    interval_s = settled.world.params.interval_s
    if onset_s < settled.time_s or onset_s >= len(settled.world) * interval_s:
        raise ValueError(f"onset_s = {onset_s:g} is not within {settled.time_s:g} and the end of the run")
    stop = min(len(settled.world), settled.number + math.ceil((onset_s - settled.time_s + watch_s) / interval_s) + 1)
    world = with_threats(settled.world, threats)
    events: list[tuple[float, Event]] = []
    failed_s: dict[str, float] = {}
    burst_s = math.nan
    for number, (_, monitored, bursts) in enumerate(
        _steps(world, settled.params, settled.state, range(settled.number, stop)), start=settled.number
    ):
        since_s = number * interval_s - onset_s
        events += [(since_s, event) for event in monitored.events if event.kind == EventKind.EXCLUSION]
        if since_s >= 0.0 and subject in SAT_INDEX:
            for name in _failing(monitored, subject):
                failed_s.setdefault(name, since_s)
        if since_s >= 0.0 and _told(subject, monitored, bursts):
            burst_s = since_s + _end_of_slots_s(bursts)
        if math.isfinite(burst_s):
            break
    return replace(_reaction(events, subject, burst_s), failed_s=failed_s)


def with_threats(world: World, threats: tuple[Threat, ...]) -> World:
    """The same world with threats."""
    faults = tuple(each for each in threats if isinstance(each, SatelliteFault | ReceiverFault))
    fronts = tuple(each for each in threats if isinstance(each, WedgeFront | PlasmaBubble))
    return World(replace(world.params, faults=faults, fronts=fronts), orbits=world.orbits)


def _steps(
    world: World, station: GroundParams, state: StationState, numbers: range
) -> Iterator[tuple[StationState, StationReport, tuple[Burst, ...]]]:
    ready = GroundStation(station)
    received: ReceptionQueue[Ephemeris] = ReceptionQueue()
    start_key = epoch_key(world.params.start_week, world.params.start_tow_s)
    first_key = start_key + round(numbers.start * world.params.interval_s * 1000.0)
    for each in world.ephemerides:
        key = epoch_key(each.gps_week, each.tow_s)
        if numbers.start == 0 or key >= first_key:
            received.add(key, each)
    for number in numbers:
        made = world.epoch(number)
        week, tow_s = from_epoch_key(made.key)
        epoch = GroundEpoch(gps_week=week, tow_s=tow_s, observations=made.ground, ephemerides=received.take(made.key))
        state, monitored, bursts = ready.step(state, epoch)
        yield state, monitored, bursts


def _usable(monitored: StationReport) -> Iterator[str]:
    used = np.isfinite(monitored.integrity.prc_m[L1_100])
    return (name for name, index in SAT_INDEX.items() if used[index])


def _told(subject: str, monitored: StationReport, bursts: tuple[Burst, ...]) -> bool:
    """Whether users are told in this frame: no valid correction of the satellite, or none with the receiver in it."""
    if subject in SAT_INDEX:
        return not _sent_as_valid(bursts, subject)
    return any(event.kind == EventKind.EXCLUSION and _concerns(event.subject, subject) for event in monitored.events)


def _failing(monitored: StationReport, satellite: str) -> Iterator[str]:
    """Monitors that fail a satellite."""
    rows = monitored.statistics.select(sat=satellite).rows()
    return (f"{row.monitor}/{row.test}" for row in rows if row.state is MonitorState.FAILED)


def _sent_as_valid(bursts: tuple[Burst, ...], satellite: str) -> bool:
    """Whether every kind of correction in the frame has the satellite, with a sigma that is valid."""
    source = int(RANGING_SOURCE_ID[SAT_INDEX[satellite]])
    sent: dict[type, bool] = {}
    for burst in bursts:
        for block in decode_burst(burst).blocks:
            message = block.message
            if isinstance(message, Type1):
                valid = any(
                    each.ranging_source_id == source and not math.isnan(each.sigma_pr_gnd_m)
                    for each in message.measurements
                )
            elif isinstance(message, Type11):
                valid = any(
                    each.ranging_source_id == source and not math.isnan(each.sigma_pr_gnd_30_m)
                    for each in message.measurements
                )
            else:
                continue
            sent[type(message)] = sent.get(type(message), False) or valid
    return bool(sent) and all(sent.values())


def _end_of_slots_s(bursts: tuple[Burst, ...]) -> float:
    """Latest end of a slot of the frame, after its epoch [s]."""
    return max(((burst.slot + 1) * SLOT_DURATION_S for burst in bursts), default=8 * SLOT_DURATION_S)


def _reaction(events: list[tuple[float, Event]], subject: str, burst_s: float) -> Reaction:
    mine = [(since_s, each) for since_s, each in events if since_s >= 0.0 and _concerns(each.subject, subject)]
    others = sorted({each.subject for _, each in events if not _concerns(each.subject, subject)})
    if not mine:
        nan = math.nan
        return Reaction(detected_s=nan, burst_s=burst_s, cause="", value=nan, threshold=nan, others=tuple(others))
    since_s, first = mine[0]
    return Reaction(
        detected_s=since_s,
        burst_s=burst_s,
        cause=first.cause,
        value=first.value,
        threshold=first.threshold,
        others=tuple(others),
    )


def _concerns(told: str, subject: str) -> bool:
    """Whether an event is about the satellite or receiver, or one of its channels."""
    return subject in told.split("/")
