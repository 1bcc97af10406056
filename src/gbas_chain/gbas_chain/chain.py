"""The whole chain without ROS: observations in, protection levels out.

The steps and the joining are those of the live nodes, so the numbers agree bit for bit with a live run and with the
replay of its bag.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from gbas_airborne.params import AirborneParams
from gbas_airborne.receiver import AirborneReceiver, AirborneState
from gbas_airborne.reception.receive import AirborneEpoch
from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.io.recording import RecordedEpoch
from gbas_ground.params import GroundParams
from gbas_ground.station import GroundEpoch, GroundStation, StationReport, StationState
from gbas_msgs_py.events import Event
from gbas_msgs_py.joining import AirborneInput, AirborneJoiner, ReceptionQueue
from gbas_msgs_py.records import IntegrityEpoch, ModesEpoch, ProtectionEpoch, SolutionEpoch
from gbas_vdb.transmission.burst import Burst

Channel = Callable[[int, tuple[Burst, ...]], Iterable[Burst]]
"""What the VDB makes of the bursts sent at an epoch (its key): the bursts that arrive then, in that order."""


@dataclass(frozen=True, kw_only=True)
class GroundOutput:
    """What the station made of one epoch."""

    monitored: StationReport
    bursts: tuple[Burst, ...]

    @property
    def integrity(self) -> IntegrityEpoch:
        """Corrections, and what may be broadcast of them."""
        return self.monitored.integrity

    @property
    def events(self) -> tuple[Event, ...]:
        """What happened."""
        return self.monitored.events


@dataclass(frozen=True, kw_only=True)
class AirborneOutput:
    """What the aircraft made of one epoch.

    Attributes
    ----------
    solution, protection
        Of the mode that guidance is from.
    events : tuple of Event
    others : tuple of (SolutionEpoch, ProtectionEpoch)
        Of the modes beside it.
    modes : ModesEpoch or None
        All modes beside one another; None where there is one.
    """

    solution: SolutionEpoch
    protection: ProtectionEpoch
    events: tuple[Event, ...]
    others: tuple[tuple[SolutionEpoch, ProtectionEpoch], ...] = ()
    modes: ModesEpoch | None = None


class Chain:
    """A ground station and an aircraft stepped over a recording or a simulation.

    Parameters
    ----------
    ground : GroundParams
    airborne : AirborneParams
    ephemerides, user_ephemerides : iterable of Ephemeris
        What each end receives, in any order; each takes effect from its reception time on.
    """

    def __init__(
        self,
        ground: GroundParams,
        airborne: AirborneParams,
        ephemerides: Iterable[Ephemeris],
        user_ephemerides: Iterable[Ephemeris],
    ) -> None:
        self._station = GroundStation(ground)
        self._airborne_params = airborne
        self._ground_state: StationState = self._station.initial_state()
        self._airborne_state: AirborneState = AirborneState()
        self._ground_ephemerides = _queue(ephemerides)
        self._airborne_ephemerides = _queue(user_ephemerides)
        # Nothing is ever late here, so the deadline is never asked for.
        self._joiner: AirborneJoiner[ObservationEpoch] = AirborneJoiner(
            correction_wait_s=airborne.correction_wait_s, timeout_s=1.0
        )

    def run(
        self, epochs: Iterable[RecordedEpoch], *, channel: Channel | None = None
    ) -> Iterator[GroundOutput | AirborneOutput]:
        """Step both ends through the epochs, in order; outputs come in the order in which they are made.

        Without a `channel` every burst arrives as it was sent.
        """
        for epoch in epochs:
            ready: list[AirborneInput[ObservationEpoch]] = []
            if epoch.user is not None:
                ready += self._joiner.add_observation(epoch.key, epoch.user, 0.0)
            station = self.ground_step(epoch)
            yield station
            for burst in station.bursts if channel is None else channel(epoch.key, station.bursts):
                ready += self._joiner.add_burst(burst)
            for item in ready:
                yield self.airborne_step(item)
        for item in self._joiner.flush():
            yield self.airborne_step(item)

    def ground_step(self, epoch: RecordedEpoch) -> GroundOutput:
        """Step the station alone."""
        week, tow_s = from_epoch_key(epoch.key)
        self._ground_state, monitored, bursts = self._station.step(
            self._ground_state,
            GroundEpoch(
                gps_week=week,
                tow_s=tow_s,
                observations=tuple(_or_none(seen) for seen in epoch.ground),
                ephemerides=self._ground_ephemerides.take(epoch.key),
            ),
        )
        return GroundOutput(monitored=monitored, bursts=bursts)

    def airborne_step(self, joined: AirborneInput[ObservationEpoch]) -> AirborneOutput:
        """Step the aircraft alone."""
        week, tow_s = from_epoch_key(joined.key)
        self._airborne_state, output = AirborneReceiver.step(
            self._airborne_state,
            AirborneEpoch(
                gps_week=week,
                tow_s=tow_s,
                observations=_or_none(joined.item),
                bursts=joined.bursts,
                ephemerides=self._airborne_ephemerides.take(joined.key),
            ),
            self._airborne_params,
        )
        first, *others = zip(output.solutions, output.protections, strict=True)
        return AirborneOutput(
            solution=first[0],
            protection=first[1],
            events=output.events,
            others=tuple(others),
            modes=output.modes,
        )


def _queue(ephemerides: Iterable[Ephemeris]) -> ReceptionQueue[Ephemeris]:
    queue: ReceptionQueue[Ephemeris] = ReceptionQueue()
    for ephemeris in ephemerides:
        queue.add(epoch_key(ephemeris.gps_week, ephemeris.tow_s), ephemeris)
    return queue


def _or_none(observations: ObservationEpoch | None) -> ObservationEpoch | None:
    """Observations without a single value are no observations."""
    return None if observations is None or observations.empty else observations
