"""Faults of satellites, their signals and receivers: all kinds, by the names files have for them.

Each kind is a record of parameters; :func:`signal_effect` and :func:`receiver_effect` say what all of them together do
to the signals at a time: code, carrier and its rate, C/N0, what is tracked, where a carrier lost count. Orbits'
faults move the satellite (:func:`displaced`) or change what it broadcasts (:func:`with_wrong_broadcasts`). Clock jumps
that a receiver's codes and carriers share are :func:`clock_jumps_s`, frozen outputs :func:`source_epochs`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, get_args

from gbas_core.ranging.fault_modes import FAULT_MODES
from gbas_core.record import FloatArray
from gbas_sim.faults.fault_base import RECEIVERS, Growing, Listener, Moment, SatelliteFault, SignalEffect, Window
from gbas_sim.faults.orbit_faults import BROADCAST_FIELDS, BroadcastFault, OrbitFault, displaced, with_wrong_broadcasts
from gbas_sim.faults.receiver_faults import (
    ClockJump,
    FrozenOutput,
    NoiseBurst,
    RangeFault,
    ReceiverFault,
    clock_jumps_s,
    receiver_effect,
    source_epochs,
)
from gbas_sim.faults.signal_faults import (
    ClockFault,
    CodeCarrierDivergence,
    CycleSlip,
    ExcessiveAcceleration,
    LossOfLock,
    LowPower,
    SignalDeformation,
)

__all__ = [
    "BROADCAST_FIELDS", "FAULT_MODES", "RECEIVERS", "RECEIVER_FAULTS", "SATELLITE_FAULTS",
    "BroadcastFault", "ClockFault", "ClockJump", "CodeCarrierDivergence", "CycleSlip", "ExcessiveAcceleration",
    "FrozenOutput", "Growing", "Listener", "LossOfLock", "LowPower", "Moment", "NoiseBurst", "OrbitFault", "RangeFault",
    "ReceiverFault", "ReceiverKinds", "SatelliteFault", "SatelliteKinds", "SignalDeformation", "SignalEffect", "Window",
    "clock_jumps_s", "displaced", "receiver_effect", "signal_effect", "source_epochs", "with_wrong_broadcasts",
]  # fmt: skip

SatelliteKinds = (
    CodeCarrierDivergence
    | ExcessiveAcceleration
    | ClockFault
    | OrbitFault
    | BroadcastFault
    | LowPower
    | SignalDeformation
    | CycleSlip
    | LossOfLock
)
ReceiverKinds = RangeFault | NoiseBurst | FrozenOutput | ClockJump
SATELLITE_FAULTS: Final[dict[str, type[SatelliteFault]]] = {kind.kind: kind for kind in get_args(SatelliteKinds)}
"""Kinds of satellites' faults by name."""

RECEIVER_FAULTS: Final[dict[str, type[ReceiverFault]]] = {kind.kind: kind for kind in get_args(ReceiverKinds)}
"""Kinds of receivers' faults by name."""


def signal_effect(
    faults: Sequence[SatelliteFault], since_s: FloatArray, listeners: tuple[Listener, ...], interval_s: float
) -> SignalEffect:
    """What all faults do to the signals.

    Parameters
    ----------
    faults : sequence of SatelliteFault
    since_s : (..., R) array
        Time since the start of the run by the time tags, of each receiver [s].
    listeners : tuple of Listener
        The R receivers.
    interval_s : float
        Between epochs [s]: a carrier that lost count less than this ago has slipped.
    """
    effect = SignalEffect.none(*since_s.shape)
    moment = Moment(since_s, interval_s, listeners)
    for fault in faults:
        fault.add_to(effect, moment)
    return effect
