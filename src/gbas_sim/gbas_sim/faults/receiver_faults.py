"""Faults of receivers: one is wrong, the others are right.

:func:`receiver_effect` says what all of them do to the signals, in the form satellites' faults have too; clock jumps
that code and carrier share, and outputs that are frozen, are for the world to take: :func:`clock_jumps_s` and
:func:`source_epochs`. Times as in :mod:`gbas_sim.faults.fault_base`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Final, Literal

import numpy as np

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS, SAT_IDS, SAT_INDEX
from gbas_core.signals import L1, L5, SPEED_OF_LIGHT_MPS
from gbas_sim.faults.fault_base import RECEIVERS, Growing, IndexArray, Moment, SignalEffect, Window
from gbas_sim.random_processes import Normals, Stream

Draw = Callable[[tuple[int, ...]], FloatArray]

QUANTITIES: Final = ("code_l1", "code_l5", "carrier_l1", "carrier_l5")
_MILLISECOND_S: Final = 0.001


@parameters
class ReceiverFault(Window):
    """A fault of one receiver."""

    receiver: Annotated[str, Parameter("receiver that is hit", choices=RECEIVERS)]
    satellites: Annotated[
        tuple[str, ...], Parameter("satellites whose signals are hit; all if empty", choices=SAT_IDS)
    ] = ()

    @property
    def hit(self) -> BoolArray:
        """Which satellites are hit, (N_SATS,)."""
        mask = np.full(N_SATS, not self.satellites)
        mask[[SAT_INDEX[satellite] for satellite in self.satellites]] = True
        return mask

    def theirs(self, moment: Moment) -> BoolArray:
        """Which receivers have the fault, ``(R,)``."""
        return moment.named((self.receiver,))

    def add_to(self, effect: SignalEffect, moment: Moment, draw: Draw) -> None:
        """Add what the fault does to an effect, in place; `draw` gives standard normal numbers of a shape."""


@parameters
class RangeFault(Growing, ReceiverFault):
    """Ranges are wrong by a bias, a ramp or an acceleration."""

    kind: Annotated[Literal["range"], Parameter("kind of the fault")] = "range"
    quantities: Annotated[tuple[str, ...], Parameter("what is wrong", choices=QUANTITIES)] = ("code_l1", "code_l5")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.quantities:
            raise ValueError(f"{self.owner}: quantities is empty: nothing would happen")

    def add_to(self, effect: SignalEffect, moment: Moment, draw: Draw) -> None:
        size_m, rate_mps = (
            np.where(self.theirs(moment), each, 0.0)[..., np.newaxis] * self.hit for each in self.size(moment.since_s)
        )
        for place, band in enumerate((L1, L5)):
            if QUANTITIES[place] in self.quantities:
                effect.code_m[..., band, :] += size_m
            if QUANTITIES[place + 2] in self.quantities:
                effect.carrier_m[..., band, :] += size_m
                effect.rate_mps[..., band, :] += rate_mps


@parameters
class NoiseBurst(ReceiverFault):
    """Additional white noise on both bands, as of an interference."""

    kind: Annotated[Literal["noise_burst"], Parameter("kind of the fault")] = "noise_burst"
    code_m: Annotated[float, Parameter("standard deviation of the codes", "m", 0.0, 1e4)] = 0.0
    carrier_m: Annotated[float, Parameter("standard deviation of the carriers", "m", 0.0, 1e3)] = 0.0
    drop_db: Annotated[float, Parameter("by how much C/N0 falls meanwhile", "dB", 0.0, 100.0)] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.code_m == self.carrier_m == self.drop_db == 0.0:
            raise ValueError(f"{self.owner}: code_m, carrier_m and drop_db are all 0: nothing would happen")

    @property
    def weakens(self) -> bool:
        return self.drop_db > 0.0

    def add_to(self, effect: SignalEffect, moment: Moment, draw: Draw) -> None:
        hit = (self.active(moment.since_s) & self.theirs(moment))[..., np.newaxis] & self.hit
        if not hit.any():
            return
        drawn = draw((len(QUANTITIES), N_SATS))
        for place, band in enumerate((L1, L5)):
            effect.code_m[..., band, :] += self.code_m * drawn[place] * hit
            effect.carrier_m[..., band, :] += self.carrier_m * drawn[place + 2] * hit
            effect.cn0_db[..., band, :] -= self.drop_db * hit


@parameters
class FrozenOutput(ReceiverFault):
    """The receiver repeats its last observations, with time tags that go on."""

    kind: Annotated[Literal["frozen"], Parameter("kind of the fault")] = "frozen"


@parameters
class ClockJump(ReceiverFault):
    """The receiver's clock jumps by milliseconds, ahead or back, up to the end if one is given.

    When the carriers jump too, as time tags do then, it is as in a receiver that steers its clock (a fault monitors
    should not mind); else the codes alone are wrong.
    """

    kind: Annotated[Literal["clock_jump"], Parameter("kind of the fault")] = "clock_jump"
    milliseconds: Annotated[int, Parameter("how far ahead; below 0 back", "ms", -1000, 1000)]
    carrier_too: Annotated[bool, Parameter("time tags and carriers jump with the codes")] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.milliseconds == 0:
            raise ValueError(f"{self.owner}: milliseconds is 0: nothing would happen")
        if self.carrier_too and self.satellites:
            raise ValueError(f"{self.owner}: satellites must be empty when carrier_too is true: there is one clock")

    def jump_s(self, moment: Moment) -> FloatArray:
        """How far clocks have jumped, ``(..., R)`` [s]."""
        jumped = self.active(moment.since_s) & self.theirs(moment)
        return np.where(jumped, self.milliseconds * _MILLISECOND_S, 0.0)

    def add_to(self, effect: SignalEffect, moment: Moment, draw: Draw) -> None:
        if not self.carrier_too:
            effect.code_m[...] += SPEED_OF_LIGHT_MPS * self.jump_s(moment)[..., np.newaxis, np.newaxis] * self.hit


def receiver_effect(faults: Sequence[ReceiverFault], moment: Moment, *, epoch: int, seed: int) -> SignalEffect:
    """What receivers' faults do to the signals they observe.

    Parameters
    ----------
    faults : sequence of ReceiverFault
    moment : Moment
        With since_s (R,).
    epoch : int
        Number of the epoch; noise depends on it and on the place of the fault.
    seed : int
    """
    effect = SignalEffect.none(*moment.since_s.shape)
    normals = Normals(seed, Stream.NOISE_BURST)
    for place, fault in enumerate(faults):
        fault.add_to(effect, moment, partial(normals.draw, place, epoch))
    return effect


def clock_jumps_s(faults: Sequence[ReceiverFault], moment: Moment) -> FloatArray:
    """What to add to the receivers' clocks ``(..., R)`` for jumps that codes and carriers share [s]."""
    jump_s = np.zeros(moment.since_s.shape)
    for fault in faults:
        if isinstance(fault, ClockJump) and fault.carrier_too:
            jump_s += fault.jump_s(moment)
    return jump_s


def source_epochs(faults: Sequence[ReceiverFault], moment: Moment, epoch: int) -> IndexArray:
    """Number of the epoch whose observations each receiver gives for each satellite, ``(R, N_SATS)``.

    The epoch's own, or where an output is frozen the last one before; below 0 there is nothing to repeat.

    Parameters
    ----------
    moment : Moment
        Of the epoch, with since_s (R,) on a grid of its interval.
    epoch : int
        Its number.
    """
    numbers = np.full((moment.since_s.size, N_SATS), epoch)
    for fault in faults:
        if isinstance(fault, FrozenOutput):
            frozen = (fault.active(moment.since_s) & fault.theirs(moment))[:, np.newaxis] & fault.hit
            late = np.floor((moment.since_s - fault.start_s) / moment.interval_s + _GRID) + 1.0
            last = epoch - late.astype(np.intp)
            numbers = np.where(frozen, np.minimum(numbers, last[:, np.newaxis]), numbers)
    return numbers


_GRID: Final = 1e-6  # rounding of times that are meant to be on the grid
