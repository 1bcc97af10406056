"""What faults have in common: when they are there, whom they hit, and what they do to signals.

Times are seconds since the start of the run; a fault lasts from `start_s` up to, not including, `end_s`. All receivers
feel it at the same epoch: signals differ by microseconds of flight time, and clocks are not looked at.
Ranges are positive when they grow, Doppler is minus the carrier's rate over the wavelength.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic.types import AllowInfNan

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS, SAT_IDS, SAT_INDEX
from gbas_core.signal.tracking_loops import TrackingParams
from gbas_core.signals import N_BANDS, WAVELENGTH_M

IndexArray = NDArray[np.intp]
After = Literal["clear", "hold"]

Band = Literal["L1", "L5"]

RECEIVERS: Final = ("rr1", "rr2", "rr3", "rr4", "airborne")
"""Names of receivers, as in the topics."""

_LARGEST_S: Final = 1.0e7


class Listener(NamedTuple):
    """What faults need to know of a receiver; triples as in :data:`gbas_core.signal.tracking_loops.SIGNALS`.

    Attributes
    ----------
    name : str
        One of :data:`RECEIVERS`.
    spacing_chips, front_end_hz : (float, float, float)
        Correlator spacings and bandwidths, which a deformed signal's effect depends on.
    """

    name: str
    spacing_chips: tuple[float, float, float] = TrackingParams().spacing_chips
    front_end_hz: tuple[float, float, float] = TrackingParams().front_end_hz

    @classmethod
    def of(cls, name: str, tracking: TrackingParams) -> Listener:
        """A receiver with these loops."""
        return cls(name, tracking.spacing_chips, tracking.front_end_hz)


@dataclass(frozen=True, kw_only=True, eq=False)
class SignalEffect:
    """What faults do to signals as receivers see them; arrays ``(..., R, N_BANDS, N_SATS)``, never NaN.

    Attributes
    ----------
    code_m, carrier_m : array
        Added to code and carrier range [m].
    rate_mps : array
        Rate of what is added to the carrier: the Doppler changes by minus this over the wavelength [m/s].
    cn0_db : array
        Change of C/N0 [dB].
    tracked : bool array
        Whether the signal can be tracked.
    slipped : bool array
        Whether the carrier lost count since the epoch before, and the receiver says so.
    """

    code_m: FloatArray
    carrier_m: FloatArray
    rate_mps: FloatArray
    cn0_db: FloatArray
    tracked: BoolArray
    slipped: BoolArray

    @classmethod
    def none(cls, *leading: int) -> SignalEffect:
        """No effect, for arrays of shape ``(*leading, N_BANDS, N_SATS)``."""
        shape = (*leading, N_BANDS, N_SATS)
        return cls(
            code_m=np.zeros(shape),
            carrier_m=np.zeros(shape),
            rate_mps=np.zeros(shape),
            cn0_db=np.zeros(shape),
            tracked=np.ones(shape, dtype=bool),
            slipped=np.zeros(shape, dtype=bool),
        )

    @property
    def doppler_hz(self) -> FloatArray:
        """Change of the Doppler [Hz]."""
        return np.asarray(-self.rate_mps / WAVELENGTH_M[:, np.newaxis])

    def plus(self, other: SignalEffect) -> SignalEffect:
        """Both effects together."""
        return SignalEffect(
            code_m=self.code_m + other.code_m,
            carrier_m=self.carrier_m + other.carrier_m,
            rate_mps=self.rate_mps + other.rate_mps,
            cn0_db=self.cn0_db + other.cn0_db,
            tracked=self.tracked & other.tracked,
            slipped=self.slipped | other.slipped,
        )


class Moment(NamedTuple):
    """When and by whom faults are felt.

    Attributes
    ----------
    since_s : (..., R) array
        Time since the start of the run by the time tags, of each receiver [s].
    interval_s : float
        Since the epoch before [s].
    listeners : tuple of Listener
        The R receivers.
    """

    since_s: FloatArray
    interval_s: float
    listeners: tuple[Listener, ...]

    def just_now(self, time_s: float) -> BoolArray:
        """Whether a time is after the epoch before and not after this one, ``(..., R)``."""
        return np.asarray((self.since_s >= time_s) & (self.since_s - self.interval_s < time_s))

    def named(self, names: tuple[str, ...]) -> BoolArray:
        """Which receivers are meant, ``(R,)``: those named, or all if none is."""
        return np.array([not names or listener.name in names for listener in self.listeners])


@parameters
class Window:
    """When a fault is there."""

    kind: Annotated[str, Parameter("kind of the fault")]
    start_s: Annotated[float, Parameter("from when", "s", -_LARGEST_S, _LARGEST_S)]
    end_s: Annotated[
        float, AllowInfNan(True), Parameter("up to when; for good unless given", "s", -_LARGEST_S, math.inf)
    ] = math.inf

    def __post_init__(self) -> None:
        if not self.end_s > self.start_s:
            raise ValueError(f"{self.owner}: end_s = {self.end_s!r} is not after start_s = {self.start_s!r}")

    @property
    def owner(self) -> str:
        """What messages call it."""
        return f"fault {self.kind}"

    @property
    def weakens(self) -> bool:
        """Whether it takes C/N0, so that a signal may be lost."""
        return False

    def active(self, since_s: FloatArray) -> BoolArray:
        """Whether the fault is there at times."""
        return np.asarray((since_s >= self.start_s) & (since_s < self.end_s))


@parameters
class Growing(Window):
    """A fault whose size is ``step + ramp t + acceleration t^2 / 2``, t since its start."""

    step_m: Annotated[float, Parameter("size at the start", "m", -1e6, 1e6)] = 0.0
    ramp_mps: Annotated[float, Parameter("growth", "m/s", -1e4, 1e4)] = 0.0
    acceleration_mps2: Annotated[float, Parameter("growth of the growth", "m/s^2", -1e3, 1e3)] = 0.0
    after: Annotated[After, Parameter("the size at the end falls to 0 (clear) or stays as it was (hold)")] = "clear"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.step_m == self.ramp_mps == self.acceleration_mps2 == 0.0:
            raise ValueError(f"{self.owner}: step_m, ramp_mps and acceleration_mps2 are all 0: nothing would happen")

    def size(self, since_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Size and its rate at times ``(...)`` [m], [m/s]; the step itself has no rate."""
        active = self.active(since_s)
        shown = since_s >= self.start_s if self.after == "hold" else active
        since = np.clip(since_s - self.start_s, 0.0, self.end_s - self.start_s)
        size = self.step_m + since * (self.ramp_mps + 0.5 * self.acceleration_mps2 * since)
        rate = self.ramp_mps + self.acceleration_mps2 * since
        return np.where(shown, size, 0.0), np.where(active, rate, 0.0)


@parameters
class SatelliteFault(Window):
    """A fault of one satellite."""

    satellite: Annotated[str, Parameter("satellite, such as G05", choices=SAT_IDS)]

    @property
    def index(self) -> int:
        """Place on the satellite axis."""
        return SAT_INDEX[self.satellite]

    def add_to(self, effect: SignalEffect, moment: Moment) -> None:
        """Add what the fault does to an effect, in place; faults of orbits do nothing here."""
