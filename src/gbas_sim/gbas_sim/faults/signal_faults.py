"""Faults of satellites' signals: divergence, acceleration, clocks, power, deformation, slips, losses of lock.

The divergence's fifteen modes and their signs are those of :mod:`gbas_core.ranging.fault_modes`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from gbas_core.bounds import all_within, one_of
from gbas_core.ranging.fault_modes import FAULT_MODES, FAULT_SIGNS
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GPS
from gbas_core.signals import BAND_INDEX, L1, L5, SPEED_OF_LIGHT_MPS, WAVELENGTH_M
from gbas_sim.faults.deformation import Correlator, Deformation, deformation_bias_m
from gbas_sim.faults.fault_base import RECEIVERS, Growing, Listener, Moment, SatelliteFault, SignalEffect

_SIGNALS_OF_BANDS: Final = {"L1": (0, 1), "L5": (2, 2)}


@dataclass(frozen=True, kw_only=True)
class CodeCarrierDivergence(Growing, SatelliteFault):
    """Code and carrier drift apart: the size d is added to the codes, and taken from the carriers, of the mode.

    Attributes
    ----------
    mode : str
        One of the fifteen names of :data:`gbas_core.ranging.fault_modes.FAULT_MODES`.
    weights : (float, float, float, float)
        Factors on d for (code L1, code L5, carrier L1, carrier L5), as far as the mode has them; the paper assumes
        that they may differ. (1, 1.7933, -1, -1.7933) on all four is how an ionosphere looks.
    """

    kind: ClassVar[str] = "divergence"

    mode: str
    weights: tuple[float, float, float, float] = FAULT_SIGNS

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mode not in FAULT_MODES:
            known = "; ".join(FAULT_MODES)
            raise ValueError(f"{self.owner}: mode = {self.mode!r} is not one of: {known}")
        if not (isinstance(self.weights, tuple) and len(self.weights) == 4):
            raise ValueError(f"{self.owner}: weights = {self.weights!r} is not four numbers")
        all_within(self.owner, self, {"weights": (-100.0, 100.0)})

    def add_to(self, effect: SignalEffect, moment: Moment) -> None:
        size_m, rate_mps = self.size(moment.since_s)
        factors = [weight * there for weight, there in zip(self.weights, FAULT_MODES[self.mode], strict=True)]
        for place, band in enumerate((L1, L5)):
            effect.code_m[..., band, self.index] += factors[place] * size_m
            effect.carrier_m[..., band, self.index] += factors[place + 2] * size_m
            effect.rate_mps[..., band, self.index] += factors[place + 2] * rate_mps


@dataclass(frozen=True, kw_only=True)
class ExcessiveAcceleration(Growing, SatelliteFault):
    """Code and carrier on all bands move together, as with a satellite clock that accelerates, ramps or steps."""

    kind: ClassVar[str] = "acceleration"

    def add_to(self, effect: SignalEffect, moment: Moment) -> None:
        _add_common(effect, self.index, *self.size(moment.since_s))


@dataclass(frozen=True, kw_only=True)
class ClockFault(SatelliteFault):
    """The satellite's clock runs ahead of what it broadcasts: ranges become shorter.

    Attributes
    ----------
    step_s, ramp_sps : float
        At the start, and per time since [s], [s/s].
    """

    kind: ClassVar[str] = "clock"

    step_s: float = 0.0
    ramp_sps: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        all_within(self.owner, self, {"step_s": (-1e-2, 1e-2), "ramp_sps": (-1e-5, 1e-5)})
        if self.step_s == self.ramp_sps == 0.0:
            raise ValueError(f"{self.owner}: step_s and ramp_sps are both 0: nothing would happen")

    def add_to(self, effect: SignalEffect, moment: Moment) -> None:
        active = self.active(moment.since_s)
        ahead_s = np.where(active, self.step_s + self.ramp_sps * (moment.since_s - self.start_s), 0.0)
        rate = np.where(active, self.ramp_sps, 0.0)
        _add_common(effect, self.index, -SPEED_OF_LIGHT_MPS * ahead_s, -SPEED_OF_LIGHT_MPS * rate)


def _add_common(effect: SignalEffect, index: int, size_m: FloatArray, rate_mps: FloatArray) -> None:
    effect.code_m[..., index] += size_m[..., np.newaxis]
    effect.carrier_m[..., index] += size_m[..., np.newaxis]
    effect.rate_mps[..., index] += rate_mps[..., np.newaxis]


@dataclass(frozen=True, kw_only=True)
class LowPower(SatelliteFault):
    """The satellite's signals become weaker.

    Attributes
    ----------
    drop_db : float
        At once [dB].
    ramp_dbps : float
        And per time since the start [dB/s].
    largest_db : float
        Weaker than this they do not become [dB].
    bands : tuple of str
        ``"L1"``, ``"L5"``.
    """

    kind: ClassVar[str] = "low_power"

    drop_db: float = 0.0
    ramp_dbps: float = 0.0
    largest_db: float = 60.0
    bands: tuple[str, ...] = ("L1", "L5")

    def __post_init__(self) -> None:
        super().__post_init__()
        bounds = {"drop_db": (0.0, 100.0), "ramp_dbps": (0.0, 100.0), "largest_db": (0.0, 100.0)}
        all_within(self.owner, self, bounds)
        if self.drop_db == self.ramp_dbps == 0.0:
            raise ValueError(f"{self.owner}: drop_db and ramp_dbps are both 0: nothing would happen")
        _check_bands(self.owner, self.bands)

    @property
    def weakens(self) -> bool:
        return True

    def add_to(self, effect: SignalEffect, moment: Moment) -> None:
        weaker = np.minimum(self.drop_db + self.ramp_dbps * (moment.since_s - self.start_s), self.largest_db)
        for band in self.bands:
            effect.cn0_db[..., BAND_INDEX[band], self.index] -= np.where(self.active(moment.since_s), weaker, 0.0)


@dataclass(frozen=True, kw_only=True)
class SignalDeformation(SatelliteFault):
    """A deformed signal biases the code of each receiver as its correlators have it: see :mod:`deformation`.

    Attributes
    ----------
    deformation : Deformation
    band : str
        ``"L1"`` or ``"L5"``; the threat models are known for L1 C/A only.
    """

    kind: ClassVar[str] = "deformation"

    deformation: Deformation
    band: str = "L1"

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_bands(self.owner, (self.band,))
        if self._signal == 1 and self.deformation.lag_chips != 0.0:
            raise ValueError(f"{self.owner}: lag_chips has no model for E1, whose subcarrier has edges of its own")

    @property
    def _signal(self) -> int:
        gps, galileo = _SIGNALS_OF_BANDS[self.band]
        return gps if IS_GPS[self.index] else galileo

    def biases_m(self, listeners: tuple[Listener, ...]) -> FloatArray:
        """Bias of each receiver's code ``(R,)`` [m]."""
        biases = [
            deformation_bias_m(
                self.deformation,
                Correlator(listener.spacing_chips[self._signal], listener.front_end_hz[self._signal]),
                self._signal,
            )
            for listener in listeners
        ]
        return np.array(biases)

    def add_to(self, effect: SignalEffect, moment: Moment) -> None:
        biased = np.where(self.active(moment.since_s), self.biases_m(moment.listeners), 0.0)
        effect.code_m[..., BAND_INDEX[self.band], self.index] += biased


@dataclass(frozen=True, kw_only=True)
class CycleSlip(SatelliteFault):
    """The carrier jumps by whole cycles, for good unless an end is given.

    Attributes
    ----------
    cycles_l1, cycles_l5 : int
        Added to the carriers.
    receivers : tuple of str
        Whose, in :data:`RECEIVERS`; all if empty.
    flagged : bool
        Whether the receiver notices (loss-of-lock indicator).
    """

    kind: ClassVar[str] = "cycle_slip"

    cycles_l1: int = 0
    cycles_l5: int = 0
    receivers: tuple[str, ...] = ()
    flagged: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        all_within(self.owner, self, {"cycles_l1": (-1e9, 1e9), "cycles_l5": (-1e9, 1e9)})
        if self.cycles_l1 == self.cycles_l5 == 0:
            raise ValueError(f"{self.owner}: cycles_l1 and cycles_l5 are both 0: nothing would happen")
        _check_receivers(self.owner, self.receivers)

    def add_to(self, effect: SignalEffect, moment: Moment) -> None:
        theirs = moment.named(self.receivers)
        slipped = self.active(moment.since_s) & theirs
        new = (moment.just_now(self.start_s) | moment.just_now(self.end_s)) & theirs & self.flagged
        for band, cycles in ((L1, self.cycles_l1), (L5, self.cycles_l5)):
            if cycles:
                effect.carrier_m[..., band, self.index] += np.where(slipped, cycles * WAVELENGTH_M[band], 0.0)
                effect.slipped[..., band, self.index] |= new


@dataclass(frozen=True, kw_only=True)
class LossOfLock(SatelliteFault):
    """Signals are not tracked; afterwards their carriers count from elsewhere.

    Attributes
    ----------
    bands : tuple of str
        ``"L1"``, ``"L5"``.
    receivers : tuple of str
        Whose, in :data:`RECEIVERS`; all if empty.
    cycles : int
        By which the carriers differ afterwards from what they would have been.
    """

    kind: ClassVar[str] = "loss_of_lock"

    bands: tuple[str, ...] = ("L1", "L5")
    receivers: tuple[str, ...] = ()
    cycles: int = 1000

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_bands(self.owner, self.bands)
        _check_receivers(self.owner, self.receivers)
        all_within(self.owner, self, {"cycles": (-1e9, 1e9)})

    def add_to(self, effect: SignalEffect, moment: Moment) -> None:
        theirs = moment.named(self.receivers)
        lost, over = self.active(moment.since_s) & theirs, (moment.since_s >= self.end_s) & theirs
        for name in self.bands:
            band = BAND_INDEX[name]
            effect.tracked[..., band, self.index] &= ~lost
            effect.carrier_m[..., band, self.index] += np.where(over, self.cycles * WAVELENGTH_M[band], 0.0)
            effect.slipped[..., band, self.index] |= moment.just_now(self.end_s) & theirs


def _check_bands(owner: str, bands: tuple[str, ...]) -> None:
    if not bands:
        raise ValueError(f"{owner}: bands is empty: nothing would happen")
    for band in bands:
        one_of(owner, "band", band, ("L1", "L5"))


def _check_receivers(owner: str, receivers: tuple[str, ...]) -> None:
    for receiver in receivers:
        one_of(owner, "receivers", receiver, RECEIVERS)
