"""Receiver clocks: offset, drift and the random walks of an oscillator; and the delays of receiver hardware.

Source of the clock model: Brown and Hwang, Introduction to Random Signals and Applied Kalman Filtering, 4th edition
(2012), 9.3: white noise and random walk of frequency. Flicker noise of frequency is left out, as usual: the Allan
deviation has the two slopes, and less than it should between them.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, NamedTuple

import numpy as np

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GPS, N_SATS
from gbas_core.signals import L1, L5, N_BANDS
from gbas_sim.random_processes import Normals, Stream, TwoStateWalk

_MILLISECOND_S: Final = 0.001


@parameters
class OscillatorParams:
    """A kind of clock.

    White frequency noise has the Allan variance ``h0 / (2 tau)``, random walk of frequency ``2 pi^2 / 3 h_-2 tau``. A
    receiver that keeps its clock within half a millisecond by steps of whole ones has code and carrier jump together,
    as time tags do.
    """

    h0_s: Annotated[float, Parameter("coefficient of white frequency noise", "s", 0.0, 1e-15)] = 0.0
    h_minus2_hz: Annotated[float, Parameter("coefficient of random walk of frequency", "1/s", 0.0, 1e-15)] = 0.0
    offset_s: Annotated[float, Parameter("bound of the offset at the start, drawn by receiver", "s", 0.0, 1e-3)] = 1e-6
    drift: Annotated[float, Parameter("bound of the rate at the start, drawn by receiver", "s/s", 0.0, 1e-5)] = 1e-9
    millisecond_steps: Annotated[bool, Parameter("the clock is kept within half a millisecond by steps")] = False

    def allan_deviation(self, tau_s: float) -> float:
        """Allan deviation over a time [-]."""
        return math.sqrt(0.5 * self.h0_s / tau_s + 2.0 * math.pi**2 / 3.0 * self.h_minus2_hz * tau_s)


OSCILLATORS: Final[dict[str, OscillatorParams]] = {
    "steady": OscillatorParams(),
    # Known: Brown and Hwang, table 9.3.
    "tcxo": OscillatorParams(h0_s=2e-19, h_minus2_hz=2e-20, drift=1e-7, millisecond_steps=True),
    "tcxo_good": OscillatorParams(h0_s=2e-21, h_minus2_hz=2e-20, drift=1e-7, millisecond_steps=True),
    "ocxo": OscillatorParams(h0_s=2e-25, h_minus2_hz=6e-25),
    "rubidium": OscillatorParams(h0_s=2e-22, h_minus2_hz=1e-30, drift=1e-10),
}


class ClockState(NamedTuple):
    """Clocks less system time ``(R,)`` [s], and their rates [s/s]."""

    offset_s: FloatArray
    drift: FloatArray


class ClockBank:
    """The clocks of receivers of one kind.

    Parameters
    ----------
    params : OscillatorParams
    seed : int
    numbers : tuple of int
        Which receivers they are.
    interval_s : float
        Between epochs [s].
    """

    def __init__(self, params: OscillatorParams, *, seed: int, numbers: tuple[int, ...], interval_s: float) -> None:
        self._params = params
        hardware = [np.random.Philox(key=[seed, Stream.OSCILLATOR], counter=[0, 0, 0, number]) for number in numbers]
        drawn = np.array([np.random.Generator(each).uniform(-1.0, 1.0, 2) for each in hardware])
        self._walk = TwoStateWalk(
            Normals(seed, Stream.CLOCK_WALK),
            numbers,
            drawn * np.array([params.offset_s, params.drift]),
            phase_s2ps=0.5 * params.h0_s,
            frequency_ps=2.0 * math.pi**2 * params.h_minus2_hz,
            interval_s=interval_s,
        )

    def at(self, epoch: int) -> ClockState:
        """Clocks at an epoch, from -1 on.

        Raises
        ------
        IndexError
            For an epoch before -1, or after 97 days at 2 Hz.
        """
        state = self._walk.at(epoch)
        offset_s, drift = state[:, 0], state[:, 1]
        if self._params.millisecond_steps:
            offset_s = offset_s - _MILLISECOND_S * np.rint(offset_s / _MILLISECOND_S)
        return ClockState(offset_s=offset_s, drift=drift)


BAND_DELAY: Final = Parameter("bound of the delay of code and carrier on L5 relative to L1", "m", 0.0, 1e3)
SYSTEM_DELAY: Final = Parameter("bound of the delay of Galileo relative to GPS", "m", 0.0, 1e3)
CODE_CARRIER_DELAY: Final = Parameter(
    "bound of the code's delay relative to the carrier's, by band and system", "m", 0.0, 1e3
)


@parameters
class HardwareParams:
    """Delays of receivers, each drawn once from a uniform distribution."""

    band_m: Annotated[float, BAND_DELAY] = 3.0
    system_m: Annotated[float, SYSTEM_DELAY] = 3.0
    code_carrier_m: Annotated[float, CODE_CARRIER_DELAY] = 1.0


class HardwareDelays(NamedTuple):
    """Delays ``(R, N_BANDS, N_SATS)`` [m]: 0 on L2, and for the code of nothing."""

    code_m: FloatArray
    carrier_m: FloatArray


def hardware_delays(params: HardwareParams, *, seed: int, numbers: tuple[int, ...]) -> HardwareDelays:
    """Delays of receivers; a receiver's do not depend on which others there are."""
    code_m = np.zeros((len(numbers), N_BANDS, N_SATS))
    carrier_m = np.zeros_like(code_m)
    for row, number in enumerate(numbers):
        philox = np.random.Philox(key=[seed, Stream.HARDWARE], counter=[0, 0, 0, number])
        drawn = np.random.Generator(philox).uniform(-1.0, 1.0, 6)
        carrier_m[row] += np.where(IS_GPS, 0.0, params.system_m * drawn[0])
        carrier_m[row, L5] += params.band_m * drawn[1]
        code_m[row] = carrier_m[row]
        for band, gps, galileo in ((L1, drawn[2], drawn[3]), (L5, drawn[4], drawn[5])):
            code_m[row, band] += params.code_carrier_m * np.where(IS_GPS, gps, galileo)
    return HardwareDelays(code_m=code_m, carrier_m=carrier_m)
