"""The airborne receiver: from VDB bursts, own observations and broadcast ephemerides to a protected position.

An epoch goes through the stages

    receive ─ track ─ correct ─ locate ─ report ─ select ─ (solution) ─ protect and decide
    VDB and   own     ranging   tested   records  the one    that        levels, limits,
    ephemerides ranges sources  position          that guides guides     service

each with its own part of the state, one record in and one out. :meth:`AirborneReceiver.position` and
:meth:`AirborneReceiver.protect` are what the two nodes run; :meth:`step` is both. Every mode of
:func:`gbas_airborne.modes.configured_modes` runs; the best of those that can give their service guides.

States are frozen and know no clock: the same inputs give the same outputs, bit for bit, wherever they come from.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from gbas_airborne.modes import configured_modes
from gbas_airborne.navigation.locate import LocateState, locate
from gbas_airborne.navigation.position import Withheld
from gbas_airborne.params import AirborneParams
from gbas_airborne.ranging.corrected_ranges import CorrectState, correct
from gbas_airborne.ranging.own_ranges import TrackState, track
from gbas_airborne.reception.receive import AirborneEpoch, ReceiveState, receive
from gbas_airborne.report import no_positions, report
from gbas_airborne.selection import Selected, SelectionState, select
from gbas_airborne.service import ServiceState, service_step
from gbas_core.gnss.epoch_order import Arrival
from gbas_msgs_py.events import Event
from gbas_msgs_py.records import ModesEpoch, ProtectionEpoch, SolutionEpoch


@dataclass(frozen=True, kw_only=True, eq=False)
class PositionState:
    """What positioning remembers between epochs, stage by stage."""

    reception: ReceiveState = field(default_factory=ReceiveState)
    tracking: TrackState | None = None
    correction: CorrectState = field(default_factory=CorrectState)
    location: LocateState = field(default_factory=LocateState)
    selection: SelectionState = field(default_factory=SelectionState)


@dataclass(frozen=True, kw_only=True, eq=False)
class AirborneState:
    """State of the whole receiver: positioning, and the service."""

    position: PositionState = field(default_factory=PositionState)
    service: ServiceState = field(default_factory=ServiceState)


@dataclass(frozen=True, kw_only=True, eq=False)
class AirborneOutput:
    """What the receiver makes of one epoch.

    Attributes
    ----------
    solutions : tuple of SolutionEpoch
        One a mode; the first is the one guidance is from.
    protections : tuple of ProtectionEpoch
        One a solution.
    modes : ModesEpoch or None
        All beside one another; None where there is one mode.
    events : tuple of Event
    """

    solutions: tuple[SolutionEpoch, ...]
    protections: tuple[ProtectionEpoch, ...]
    modes: ModesEpoch | None
    events: tuple[Event, ...]


class AirborneReceiver:
    """The two halves of the receiver and their composition; no state of its own."""

    @staticmethod
    def position(state: PositionState, epoch: AirborneEpoch, params: AirborneParams) -> tuple[PositionState, Selected]:
        """Positions of one epoch, one a mode, and which of them guides.

        Without a position the solution's scalars are NaN (but for what the station told). An epoch that is not later
        than the last one is refused: no position, and nothing changes but what was received. When time goes on from
        there, the receiver starts anew.
        """
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            return _position(state, epoch, params)

    @staticmethod
    def protect(
        state: ServiceState, solution: SolutionEpoch, params: AirborneParams
    ) -> tuple[ServiceState, ProtectionEpoch, tuple[Event, ...]]:
        """Protection levels, alert limits and service of the solution that guides."""
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            return service_step(state, solution, params)

    @staticmethod
    def step(
        state: AirborneState, epoch: AirborneEpoch, params: AirborneParams
    ) -> tuple[AirborneState, AirborneOutput]:
        """Both: position, then protect."""
        position, selected = AirborneReceiver.position(state.position, epoch, params)
        service, protection, events = AirborneReceiver.protect(state.service, selected.solutions[0], params)
        output = AirborneOutput(
            solutions=selected.solutions,
            protections=(protection, *selected.others),
            modes=selected.modes,
            events=selected.events + events,
        )
        return AirborneState(position=position, service=service), output


def _position(state: PositionState, epoch: AirborneEpoch, params: AirborneParams) -> tuple[PositionState, Selected]:
    modes = configured_modes(params)
    reception, received = receive(state.reception, epoch, params)
    if received.arrival is Arrival.RESTART:
        state = PositionState()
    located, events = state, received.events
    withheld: Mapping[int, Withheld] = {}
    if received.observations is None:
        solutions = no_positions(received, modes)
    else:
        tracking, tracked = track(state.tracking, received, modes, params)
        correction, corrected = correct(state.correction, tracked, modes, params)
        location, found = locate(state.location, corrected, params)
        located = replace(state, tracking=tracking, correction=correction, location=location)
        solutions, events = report(found), events + found.events
        withheld = {each.sources.mode.number: each.withheld for each in found.results if each.withheld is not None}
    selection, selected = select(state.selection, solutions, withheld, params)
    state = replace(located, reception=reception, selection=selection)
    return state, replace(selected, events=events + selected.events)
