"""Faults of satellites' signals: divergence, acceleration, clocks, power, deformation, slips, losses of lock.

The divergence's fifteen modes and their signs are those of :mod:`gbas_core.ranging.fault_modes`.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal

import numpy as np

from gbas_core.parameters import Parameter, parameters
from gbas_core.ranging.fault_modes import FAULT_MODES, FAULT_SIGNS
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GPS
from gbas_core.signals import BAND_INDEX, L1, L5, SPEED_OF_LIGHT_MPS, WAVELENGTH_M
from gbas_sim.faults.deformation import Correlator, Deformation, deformation_bias_m
from gbas_sim.faults.fault_base import RECEIVERS, Band, Growing, Listener, Moment, SatelliteFault, SignalEffect

_SIGNALS_OF_BANDS: Final = {"L1": (0, 1), "L5": (2, 2)}
BANDS_HIT: Final = Parameter("bands that are hit")
RECEIVERS_HIT: Final = Parameter("receivers that are hit; all if empty", choices=RECEIVERS)


@parameters
class CodeCarrierDivergence(Growing, SatelliteFault):
    """Code and carrier drift apart: the size d is added to the codes, and taken from the carriers, of the mode.

    Weights are for (code L1, code L5, carrier L1, carrier L5), as far as the mode has them; the paper assumes that they
    may differ. (1, 1.7933, -1, -1.7933) on all four is how an ionosphere looks.
    """

    kind: Annotated[Literal["divergence"], Parameter("kind of the fault")] = "divergence"
    mode: Annotated[str, Parameter("which signals diverge", choices=tuple(FAULT_MODES))]
    weights: Annotated[tuple[float, float, float, float], Parameter("factors on the size", "-", -100.0, 100.0)] = (
        FAULT_SIGNS
    )

    def add_to(self, effect: SignalEffect, moment: Moment) -> None:
        size_m, rate_mps = self.size(moment.since_s)
        factors = [weight * there for weight, there in zip(self.weights, FAULT_MODES[self.mode], strict=True)]
        for place, band in enumerate((L1, L5)):
            effect.code_m[..., band, self.index] += factors[place] * size_m
            effect.carrier_m[..., band, self.index] += factors[place + 2] * size_m
            effect.rate_mps[..., band, self.index] += factors[place + 2] * rate_mps


@parameters
class ExcessiveAcceleration(Growing, SatelliteFault):
    """Code and carrier on all bands move together, as with a satellite clock that accelerates, ramps or steps."""

    kind: Annotated[Literal["acceleration"], Parameter("kind of the fault")] = "acceleration"

    def add_to(self, effect: SignalEffect, moment: Moment) -> None:
        _add_common(effect, self.index, *self.size(moment.since_s))


@parameters
class ClockFault(SatelliteFault):
    """The satellite's clock runs ahead of what it broadcasts: ranges become shorter."""

    kind: Annotated[Literal["clock"], Parameter("kind of the fault")] = "clock"
    step_s: Annotated[float, Parameter("at the start", "s", -1e-2, 1e-2)] = 0.0
    ramp_sps: Annotated[float, Parameter("per time since", "s/s", -1e-5, 1e-5)] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
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


@parameters
class LowPower(SatelliteFault):
    """The satellite's signals become weaker."""

    kind: Annotated[Literal["low_power"], Parameter("kind of the fault")] = "low_power"
    drop_db: Annotated[float, Parameter("at once", "dB", 0.0, 100.0)] = 0.0
    ramp_dbps: Annotated[float, Parameter("and per time since the start", "dB/s", 0.0, 100.0)] = 0.0
    largest_db: Annotated[float, Parameter("weaker than this they do not become", "dB", 0.0, 100.0)] = 60.0
    bands: Annotated[tuple[Band, ...], BANDS_HIT] = ("L1", "L5")

    def __post_init__(self) -> None:
        super().__post_init__()
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


@parameters
class SignalDeformation(SatelliteFault):
    """A deformed signal biases the code of each receiver as its correlators have it: see :mod:`deformation`.

    The threat models are known for L1 C/A only.
    """

    kind: Annotated[Literal["deformation"], Parameter("kind of the fault")] = "deformation"
    deformation: Deformation
    band: Annotated[Band, Parameter("band of the signal")] = "L1"

    def __post_init__(self) -> None:
        super().__post_init__()
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


@parameters
class CycleSlip(SatelliteFault):
    """The carrier jumps by whole cycles, for good unless an end is given."""

    kind: Annotated[Literal["cycle_slip"], Parameter("kind of the fault")] = "cycle_slip"
    cycles_l1: Annotated[int, Parameter("added to the carrier on L1", "cycles", -1e9, 1e9)] = 0
    cycles_l5: Annotated[int, Parameter("added to the carrier on L5", "cycles", -1e9, 1e9)] = 0
    receivers: Annotated[tuple[str, ...], RECEIVERS_HIT] = ()
    flagged: Annotated[bool, Parameter("the receiver notices (loss-of-lock indicator)")] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.cycles_l1 == self.cycles_l5 == 0:
            raise ValueError(f"{self.owner}: cycles_l1 and cycles_l5 are both 0: nothing would happen")

    def add_to(self, effect: SignalEffect, moment: Moment) -> None:
        theirs = moment.named(self.receivers)
        slipped = self.active(moment.since_s) & theirs
        new = (moment.just_now(self.start_s) | moment.just_now(self.end_s)) & theirs & self.flagged
        for band, cycles in ((L1, self.cycles_l1), (L5, self.cycles_l5)):
            if cycles:
                effect.carrier_m[..., band, self.index] += np.where(slipped, cycles * WAVELENGTH_M[band], 0.0)
                effect.slipped[..., band, self.index] |= new


@parameters
class LossOfLock(SatelliteFault):
    """Signals are not tracked; afterwards their carriers count from elsewhere."""

    kind: Annotated[Literal["loss_of_lock"], Parameter("kind of the fault")] = "loss_of_lock"
    bands: Annotated[tuple[Band, ...], BANDS_HIT] = ("L1", "L5")
    receivers: Annotated[tuple[str, ...], RECEIVERS_HIT] = ()
    cycles: Annotated[int, Parameter("by which the carriers differ afterwards", "cycles", -1e9, 1e9)] = 1000

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_bands(self.owner, self.bands)

    def add_to(self, effect: SignalEffect, moment: Moment) -> None:
        theirs = moment.named(self.receivers)
        lost, over = self.active(moment.since_s) & theirs, (moment.since_s >= self.end_s) & theirs
        for name in self.bands:
            band = BAND_INDEX[name]
            effect.tracked[..., band, self.index] &= ~lost
            effect.carrier_m[..., band, self.index] += np.where(over, self.cycles * WAVELENGTH_M[band], 0.0)
            effect.slipped[..., band, self.index] |= moment.just_now(self.end_s) & theirs


def _check_bands(owner: str, bands: tuple[Band, ...]) -> None:
    if not bands:
        raise ValueError(f"{owner}: bands is empty: nothing would happen")
