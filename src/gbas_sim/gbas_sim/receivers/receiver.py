"""Receivers: what one makes of the signals that reach it, with its clock and its errors.

A kind of receiver is either a :class:`~gbas_sim.receivers.receiver_model.ReceiverModel` (loops, multipath, hardware),
of which there are presets, or a :class:`ReceiverParams`, the simple kind described here.

Code, carrier and Doppler noise follow from C/N0 by the usual formulas for tracking loops, C/N0 from elevation. Noise is
white from epoch to epoch. Every draw is a function of (seed, receiver, epoch): random numbers come from a counter based
generator (Philox) whose counter starts there.

Source of the loop formulas: Kaplan and Hegarty, Understanding GPS, 2nd edition (2006), 5.6.1 to 5.6.3.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray, IntArray
from gbas_core.satellites import IS_GPS, N_SATS
from gbas_core.signals import IONO_RATIO, L1, L5, N_BANDS, SPEED_OF_LIGHT_MPS, WAVELENGTH_M
from gbas_sim.atmosphere.paths import Delay
from gbas_sim.random_processes import Normals
from gbas_sim.receivers.arcs import jumps
from gbas_sim.receivers.oscillators import ClockState
from gbas_sim.receivers.receiver_model import ELEVATION_MASK, ReceiverErrors, ReceiverModel, SignalErrors, rinex_rounded
from gbas_sim.satellites.sightlines import Sightlines

_CA_CHIP_M: Final = SPEED_OF_LIGHT_MPS / 1.023e6
_L5_CHIP_M: Final = SPEED_OF_LIGHT_MPS / 10.23e6
CHIP_M: Final[FloatArray] = np.array([_CA_CHIP_M, np.nan, _L5_CHIP_M])[:, np.newaxis] * np.ones(N_SATS)
"""Chip length, (N_BANDS, N_SATS) [m]: L1 C/A and E1, L5 and E5a. L2 is not simulated."""
# The main peak of BOC(1,1), of which E1 is mostly made, is three times as steep as that of C/A. Known.
PEAK_SLOPE: Final[FloatArray] = np.where(np.arange(N_BANDS)[:, np.newaxis] == L1, np.where(IS_GPS, 1.0, 3.0), 1.0)
"""Slope of the correlation peak relative to BPSK, (N_BANDS, N_SATS)."""

_LARGEST_AMBIGUITY: Final = 1_000_000
_QUANTITIES: Final = 3  # code, carrier, Doppler
_RATIO: Final = IONO_RATIO[:, np.newaxis]
WEAKEST_DBHZ: Final = 20.0
"""C/N0 below which a receiver of :class:`ReceiverParams` tracks nothing. Ours."""


class Stream(IntEnum):
    """What a random number is for: the second word of the generator's key."""

    CLOCK = 2
    AMBIGUITY = 3
    NOISE = 4


_PAIR: Final = "on L1 and on L5"


@parameters
class ReceiverParams:
    """A kind of receiver; C/N0 goes with the sine of elevation between horizon and zenith. Ours.

    Observations averaged over their interval T have a noise bandwidth of 1/(2T), and only then are white: 1 Hz for 2 Hz
    data.
    """

    elevation_mask_rad: Annotated[float, ELEVATION_MASK] = math.radians(3.0)
    cn0_zenith_dbhz: Annotated[tuple[float, float], Parameter(f"C/N0 at the zenith {_PAIR}", "dB-Hz", 20.0, 70.0)] = (
        50.0,
        52.0,
    )
    cn0_horizon_dbhz: Annotated[tuple[float, float], Parameter(f"C/N0 at the horizon {_PAIR}", "dB-Hz", 20.0, 70.0)] = (
        37.0,
        39.0,
    )
    spacing_chips: Annotated[tuple[float, float], Parameter(f"early to late {_PAIR}", "chips", 0.01, 1.5)] = (0.1, 1.0)
    code_bandwidth_hz: Annotated[float, Parameter("noise bandwidth of a pseudorange as output", "Hz", 0.01, 100.0)] = (
        1.0
    )
    carrier_bandwidth_hz: Annotated[float, Parameter("of the phase loop", "Hz", 0.1, 100.0)] = 15.0
    frequency_bandwidth_hz: Annotated[float, Parameter("of the frequency loop", "Hz", 0.1, 100.0)] = 2.0
    integration_s: Annotated[float, Parameter("coherent integration time", "s", 0.001, 1.0)] = 0.02
    noise_scale: Annotated[float, Parameter("factor on all noise; 0 switches it off", "-", 0.0, 100.0)] = 1.0
    clock_offset_s: Annotated[
        float, Parameter("bound of the clock's offset, drawn for each receiver", "s", 0.0, 1.0e-3)
    ] = 1.0e-6
    clock_drift: Annotated[
        float, Parameter("bound of the clock's rate, drawn for each receiver", "s/s", 0.0, 1.0e-6)
    ] = 1.0e-9


@parameters
class AirborneReceiverParams(ReceiverParams):
    """As :class:`ReceiverParams`, with the aircraft's weaker signals."""

    cn0_zenith_dbhz: Annotated[tuple[float, float], Parameter(f"C/N0 at the zenith {_PAIR}", "dB-Hz", 20.0, 70.0)] = (
        48.0,
        50.0,
    )
    cn0_horizon_dbhz: Annotated[tuple[float, float], Parameter(f"C/N0 at the horizon {_PAIR}", "dB-Hz", 20.0, 70.0)] = (
        36.0,
        38.0,
    )


GROUND_RECEIVER: Final = ReceiverParams()
AIRBORNE_RECEIVER: Final = AirborneReceiverParams()


def cn0_dbhz(params: ReceiverParams, elevation_rad: FloatArray) -> FloatArray:
    """C/N0 ``(..., N_BANDS, N_SATS)`` at elevations ``(..., N_SATS)`` [dB-Hz]; NaN on L2."""
    zenith = np.array([params.cn0_zenith_dbhz[0], np.nan, params.cn0_zenith_dbhz[1]])[:, np.newaxis]
    horizon = np.array([params.cn0_horizon_dbhz[0], np.nan, params.cn0_horizon_dbhz[1]])[:, np.newaxis]
    return np.asarray(horizon + (zenith - horizon) * np.sin(elevation_rad)[..., np.newaxis, :])


def noise_sigmas(params: ReceiverParams, cn0: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Standard deviations of code [m], carrier [m] and Doppler [Hz] at C/N0 ``(..., N_BANDS, N_SATS)`` [dB-Hz].

    Source: Kaplan and Hegarty, 5.6.3 (non-coherent early-late power, wide front end), 5.6.1 (Costas loop, first term)
    and 5.6.2 (frequency loop at high C/N0).
    """
    density = 10.0 ** (0.1 * cn0)
    spacing = np.array([params.spacing_chips[0], np.nan, params.spacing_chips[1]])[:, np.newaxis]
    coherent = params.integration_s * density
    squaring = 1.0 + 2.0 / ((2.0 - spacing) * coherent)
    chips = np.sqrt(params.code_bandwidth_hz * spacing / (2.0 * PEAK_SLOPE * density) * squaring)
    cycles = np.sqrt(params.carrier_bandwidth_hz / density * (1.0 + 0.5 / coherent)) / (2.0 * np.pi)
    hertz = np.sqrt(4.0 * params.frequency_bandwidth_hz / density * (1.0 + 1.0 / coherent))
    hertz = hertz / (2.0 * np.pi * params.integration_s)
    scale = params.noise_scale
    return scale * CHIP_M * chips, scale * WAVELENGTH_M[:, np.newaxis] * cycles, scale * hertz


class WhiteErrors:
    """Errors of receivers of one kind of :class:`ReceiverParams`; as
    :class:`~gbas_sim.receivers.receiver_model.ReceiverErrors`.

    Parameters
    ----------
    params : ReceiverParams
    seed : int
    numbers : tuple of int
        Which receivers they are: another number, other noise.
    interval_s : float
        Between epochs [s].
    """

    def __init__(self, params: ReceiverParams, *, seed: int, numbers: tuple[int, ...], interval_s: float) -> None:
        self._params, self._numbers, self._interval_s = params, numbers, interval_s
        self._normals = Normals(seed, Stream.NOISE)
        drawn = np.array([_generator(seed, Stream.CLOCK, number).uniform(-1.0, 1.0, 2) for number in numbers])
        self._offset_s, self._drift = params.clock_offset_s * drawn[:, 0], params.clock_drift * drawn[:, 1]

    def clocks(self, epoch: int) -> ClockState:
        """Clocks less system time and their rates, (R,) each."""
        return ClockState(self._offset_s + self._drift * (self._interval_s * epoch), self._drift)

    def cn0_dbhz(
        self,
        elevation_rad: FloatArray,
        *,
        antenna_elevation_rad: FloatArray | None = None,
        change_db: FloatArray | float = 0.0,
    ) -> FloatArray:
        """C/N0 ``(R, N_BANDS, N_SATS)`` [dB-Hz]; NaN on L2."""
        seen = elevation_rad if antenna_elevation_rad is None else antenna_elevation_rad
        return np.asarray(cn0_dbhz(self._params, seen) + change_db)

    def tracked(self, elevation_rad: FloatArray, cn0: FloatArray) -> NDArray[np.bool_]:
        """Signals ``(R, N_BANDS, N_SATS)`` above the mask and the weakest C/N0 that is tracked."""
        above = (elevation_rad >= self._params.elevation_mask_rad)[:, np.newaxis, :]
        return np.asarray(above & (cn0 >= WEAKEST_DBHZ))

    def at(self, epoch: int, elevation_rad: FloatArray, cn0: FloatArray) -> SignalErrors:
        """Errors of an epoch; noise is drawn for every place, tracked or not."""
        noise = np.full((len(self._numbers), _QUANTITIES, N_BANDS, N_SATS), np.nan)
        noise[:, :, (L1, L5)] = self._normals.rows(self._numbers, epoch, (_QUANTITIES, 2, N_SATS))
        sigmas = noise_sigmas(self._params, cn0)
        code, carrier, doppler = (sigma * noise[:, place] for place, sigma in enumerate(sigmas))
        return SignalErrors(code_m=code, carrier_m=carrier, doppler_hz=doppler, cn0_dbhz=cn0)


class Arrivals(NamedTuple):
    """Signals as they arrive at receivers of one kind, and what is held of them.

    Attributes
    ----------
    lines : Sightlines
        Geometry with all that delays codes and carriers alike, (R, N_SATS).
    dispersive : Delay
        Delay of the code on L1 that is opposite on the carrier and goes with the square of the wavelength.
    code_m, carrier_m, rate_mps : (R, N_BANDS, N_SATS) arrays or 0
        Added by faults: to codes and carriers, and the rate of the carrier's [m], [m/s].
    cn0_dbhz, elevation_rad : (R, N_BANDS, N_SATS) and (R, N_SATS) arrays
    tracked, tracked_before : (R, N_BANDS, N_SATS) bool arrays
        In this epoch and in the one before.
    arcs : (R, N_BANDS, N_SATS) int array
        Numbers of the carriers' arcs, see :mod:`gbas_sim.receivers.arcs`.
    """

    lines: Sightlines
    dispersive: Delay
    code_m: FloatArray | float
    carrier_m: FloatArray | float
    rate_mps: FloatArray | float
    cn0_dbhz: FloatArray
    elevation_rad: FloatArray
    tracked: NDArray[np.bool_]
    tracked_before: NDArray[np.bool_]
    arcs: IntArray


class ReceiverBank:
    """Receivers of one kind.

    Parameters
    ----------
    kind : ReceiverParams or ReceiverModel
    seed : int
    numbers : tuple of int
        Which receivers they are.
    interval_s : float
        Between epochs [s].

    Attributes
    ----------
    numbers : tuple of int
    errors : WhiteErrors or ReceiverErrors
    """

    def __init__(
        self, kind: ReceiverParams | ReceiverModel, *, seed: int, numbers: tuple[int, ...], interval_s: float
    ) -> None:
        self.kind, self.numbers = kind, numbers
        model = ReceiverErrors if isinstance(kind, ReceiverModel) else WhiteErrors
        self.errors = model(kind, seed=seed, numbers=numbers, interval_s=interval_s)  # type: ignore[arg-type]
        shape, largest = (N_BANDS, N_SATS), _LARGEST_AMBIGUITY
        cycles = [_generator(seed, Stream.AMBIGUITY, number).integers(-largest, largest, shape) for number in numbers]
        self._seed, self._first_arcs = seed, np.array(cycles)
        self._counted: tuple[IntArray, FloatArray] | None = None

    def ambiguity_m(self, arcs: IntArray) -> FloatArray:
        """Whole wavelengths in each carrier, by the numbers of their arcs, (R, N_BANDS, N_SATS) [m]."""
        if self._counted is None or not np.array_equal(self._counted[0], arcs):
            cycles = self._first_arcs + jumps(self._seed, self.numbers, arcs)
            self._counted = (arcs, cycles * WAVELENGTH_M[:, np.newaxis])
        return self._counted[1]

    def observe(
        self, *, gps_week: int, tow_s: float, epoch: int, clock: ClockState, group_delay_s: FloatArray, seen: Arrivals
    ) -> tuple[ObservationEpoch, ...]:
        """Observations of one epoch, one record a receiver.

        Parameters
        ----------
        epoch : int
            Number of the epoch, which its noise depends on.
        clock : ClockState
            The receivers' clocks less system time (R,).
        group_delay_s : (N_BANDS, N_SATS) array
            Of the satellites; NaN where a band is not transmitted [s].
        """
        lines = seen.lines
        errors = self.errors.at(epoch, seen.elevation_rad, seen.cn0_dbhz)
        clock_m = SPEED_OF_LIGHT_MPS * (clock.offset_s[:, np.newaxis] - lines.clock_s)
        pseudorange = (lines.range_m + clock_m)[:, np.newaxis, :] + SPEED_OF_LIGHT_MPS * group_delay_s
        delay = _RATIO * seen.dispersive.delay_m[:, np.newaxis, :]
        advancing = seen.rate_mps - _RATIO * seen.dispersive.rate_mps[:, np.newaxis, :]
        drift = clock.drift[:, np.newaxis, np.newaxis]
        signal = (lines.range_rate_mps - SPEED_OF_LIGHT_MPS * lines.clock_drift)[:, np.newaxis, :] + advancing
        rate = signal * (1.0 - drift) + SPEED_OF_LIGHT_MPS * drift
        tracked = seen.tracked & np.isfinite(pseudorange)
        ambiguity_m = self.ambiguity_m(np.where(tracked, seen.arcs, 0))
        values = {
            "code_m": pseudorange + delay + seen.code_m + errors.code_m,
            "carrier_m": pseudorange - delay + seen.carrier_m + ambiguity_m + errors.carrier_m,
            "doppler_hz": -rate / WAVELENGTH_M[:, np.newaxis] + errors.doppler_hz,
            "cn0_dbhz": errors.cn0_dbhz,
            "lli": np.where(seen.tracked_before, 0.0, 1.0),
        }
        held = {name: np.where(tracked, each, np.nan) for name, each in values.items()}
        observations = tuple(
            ObservationEpoch(
                gps_week=gps_week, tow_s=tow_s, simulated=1.0, **{name: each[row] for name, each in held.items()}
            )
            for row in range(len(self.numbers))
        )
        if isinstance(self.kind, ReceiverModel) and self.kind.rinex_steps:
            return tuple(rinex_rounded(each) for each in observations)
        return observations


def _generator(seed: int, stream: Stream, number: int) -> np.random.Generator:
    """Random numbers of one receiver and purpose, drawn once."""
    return np.random.Generator(np.random.Philox(key=[seed, int(stream)], counter=[0, 0, 0, number]))
