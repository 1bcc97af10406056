"""Receivers: what one makes of the signals that reach it, with its clock and its thermal noise.

Code, carrier and Doppler noise follow from C/N0 by the usual formulas for tracking loops, C/N0 from elevation. Noise is
white from epoch to epoch. Every draw is a function of (seed, receiver, epoch): random numbers come from a counter based
generator (Philox) whose counter starts there.

Source of the loop formulas: Kaplan and Hegarty, Understanding GPS, 2nd edition (2006), 5.6.1 to 5.6.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.observations import ObservationEpoch
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GPS, N_SATS
from gbas_core.signals import L1, L5, N_BANDS, SPEED_OF_LIGHT_MPS, WAVELENGTH_M
from gbas_sim.sightlines import Sightlines

_CA_CHIP_M: Final = SPEED_OF_LIGHT_MPS / 1.023e6
_L5_CHIP_M: Final = SPEED_OF_LIGHT_MPS / 10.23e6
CHIP_M: Final[FloatArray] = np.array([_CA_CHIP_M, np.nan, _L5_CHIP_M])[:, np.newaxis] * np.ones(N_SATS)
"""Chip length, (N_BANDS, N_SATS) [m]: L1 C/A and E1, L5 and E5a. L2 is not simulated."""
# The main peak of BOC(1,1), of which E1 is mostly made, is three times as steep as that of C/A. Known.
PEAK_SLOPE: Final[FloatArray] = np.where(np.arange(N_BANDS)[:, np.newaxis] == L1, np.where(IS_GPS, 1.0, 3.0), 1.0)
"""Slope of the correlation peak relative to BPSK, (N_BANDS, N_SATS)."""

_LARGEST_AMBIGUITY: Final = 1_000_000
_QUANTITIES: Final = 3  # code, carrier, Doppler


class Stream(IntEnum):
    """What a random number is for: the second word of the generator's key."""

    CLOCK = 2
    AMBIGUITY = 3
    NOISE = 4


@dataclass(frozen=True, kw_only=True)
class ReceiverParams:
    """A kind of receiver.

    Attributes
    ----------
    elevation_mask_rad : float
        Lowest elevation tracked [rad].
    cn0_zenith_dbhz, cn0_horizon_dbhz : (float, float)
        C/N0 on L1 and on L5 at the zenith and at the horizon; in between it goes with the sine of elevation. Ours.
    spacing_chips : (float, float)
        Early-late spacing on L1 and on L5 [chips].
    code_bandwidth_hz : float
        Noise bandwidth of a pseudorange as output. Observations averaged over their interval T have 1/(2T), and only
        then are white: 1 Hz for 2 Hz data.
    carrier_bandwidth_hz, frequency_bandwidth_hz : float
        Bandwidths of the phase and frequency loops.
    integration_s : float
        Coherent integration time [s].
    noise_scale : float
        Factor on all noise; 0 switches it off.
    clock_offset_s, clock_drift : float
        Bounds of the clock's offset and rate, which are drawn for each receiver.
    """

    elevation_mask_rad: float = math.radians(3.0)
    cn0_zenith_dbhz: tuple[float, float] = (50.0, 52.0)
    cn0_horizon_dbhz: tuple[float, float] = (37.0, 39.0)
    spacing_chips: tuple[float, float] = (0.1, 1.0)
    code_bandwidth_hz: float = 1.0
    carrier_bandwidth_hz: float = 15.0
    frequency_bandwidth_hz: float = 2.0
    integration_s: float = 0.02
    noise_scale: float = 1.0
    clock_offset_s: float = 1.0e-6
    clock_drift: float = 1.0e-9

    def __post_init__(self) -> None:
        bounds = {
            "elevation_mask_rad": (0.0, 1.5),
            "cn0_zenith_dbhz": (20.0, 70.0),
            "cn0_horizon_dbhz": (20.0, 70.0),
            "spacing_chips": (0.01, 1.5),
            "code_bandwidth_hz": (0.01, 100.0),
            "carrier_bandwidth_hz": (0.1, 100.0),
            "frequency_bandwidth_hz": (0.1, 100.0),
            "integration_s": (0.001, 1.0),
            "noise_scale": (0.0, 100.0),
            "clock_offset_s": (0.0, 1.0e-3),
            "clock_drift": (0.0, 1.0e-6),
        }
        for key, (low, high) in bounds.items():
            value = getattr(self, key)
            pair = key in ("cn0_zenith_dbhz", "cn0_horizon_dbhz", "spacing_chips")
            if pair and not (isinstance(value, tuple) and len(value) == 2):
                raise ValueError(f"receiver: {key} = {value!r} is not two numbers (L1, L5)")
            if not all(low <= each <= high for each in (value if pair else (value,))):
                raise ValueError(f"receiver: {key} = {value!r} is not within {low:g} to {high:g}")


GROUND_RECEIVER: Final = ReceiverParams()
AIRBORNE_RECEIVER: Final = ReceiverParams(cn0_zenith_dbhz=(48.0, 50.0), cn0_horizon_dbhz=(36.0, 38.0))


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


@dataclass(frozen=True, kw_only=True, eq=False)
class ReceiverBank:
    """Receivers of one kind, with what each keeps for the whole run.

    Attributes
    ----------
    params : ReceiverParams
    seed : int
    numbers : tuple of int
        Which receivers they are: another number, other noise.
    clock_offset_s, clock_drift : (R,) arrays
        Clock less system time at the start [s] and its rate.
    ambiguity_m : (R, N_BANDS, N_SATS) array
        Whole wavelengths in each carrier [m].
    """

    params: ReceiverParams
    seed: int
    numbers: tuple[int, ...]
    clock_offset_s: FloatArray
    clock_drift: FloatArray
    ambiguity_m: FloatArray

    @classmethod
    def make(cls, params: ReceiverParams, seed: int, numbers: tuple[int, ...]) -> ReceiverBank:
        """Draw clocks and ambiguities."""
        clocks = np.array([_generator(seed, Stream.CLOCK, number).uniform(-1.0, 1.0, 2) for number in numbers])
        shape, largest = (N_BANDS, N_SATS), _LARGEST_AMBIGUITY
        cycles = [_generator(seed, Stream.AMBIGUITY, number).integers(-largest, largest, shape) for number in numbers]
        return cls(
            params=params,
            seed=seed,
            numbers=numbers,
            clock_offset_s=params.clock_offset_s * clocks[:, 0],
            clock_drift=params.clock_drift * clocks[:, 1],
            ambiguity_m=np.array(cycles) * WAVELENGTH_M[:, np.newaxis],
        )

    def clock_s(self, since_start_s: FloatArray) -> FloatArray:
        """Clocks less system time ``(..., R)`` at times ``(...)`` since the start [s]."""
        return self.clock_offset_s + self.clock_drift * since_start_s[..., np.newaxis]

    def observe(
        self,
        *,
        gps_week: int,
        tow_s: float,
        epoch: int,
        clock_s: FloatArray,
        lines: Sightlines,
        group_delay_s: FloatArray,
        elevation_rad: FloatArray,
        tracked: NDArray[np.bool_],
        tracked_before: NDArray[np.bool_],
    ) -> tuple[ObservationEpoch, ...]:
        """Observations of one epoch, one record a receiver.

        Parameters
        ----------
        epoch : int
            Number of the epoch, which its noise depends on.
        clock_s : (R,) array
            The receivers' clocks less system time [s].
        lines : Sightlines
            Geometry (R, N_SATS).
        group_delay_s : (N_BANDS, N_SATS) array
            Of the satellites; NaN where a band is not transmitted [s].
        elevation_rad : (R, N_SATS) array
        tracked, tracked_before : (R, N_SATS) bool arrays
            Satellites tracked in this epoch and in the one before.
        """
        cn0 = np.where(tracked[:, np.newaxis, :], cn0_dbhz(self.params, elevation_rad), np.nan)
        noise = self._noise(epoch)
        code_sigma, carrier_sigma, doppler_sigma = noise_sigmas(self.params, cn0)
        clock_m = SPEED_OF_LIGHT_MPS * (clock_s[:, np.newaxis] - lines.clock_s)
        pseudorange = (lines.range_m + clock_m)[:, np.newaxis, :] + SPEED_OF_LIGHT_MPS * group_delay_s
        own_drift = self.clock_drift[:, np.newaxis]
        rate = (lines.range_rate_mps - SPEED_OF_LIGHT_MPS * lines.clock_drift) * (1.0 - own_drift)
        doppler = -(rate + SPEED_OF_LIGHT_MPS * own_drift)[:, np.newaxis, :] / WAVELENGTH_M[:, np.newaxis]
        code = pseudorange + code_sigma * noise[:, 0]
        carrier = pseudorange + self.ambiguity_m + carrier_sigma * noise[:, 1]
        doppler = doppler + doppler_sigma * noise[:, 2]
        lli = np.where(np.isnan(code), np.nan, np.where(tracked_before, 0.0, 1.0)[:, np.newaxis, :])
        return tuple(
            ObservationEpoch(
                gps_week=gps_week,
                tow_s=tow_s,
                simulated=1.0,
                code_m=code[row],
                carrier_m=carrier[row],
                doppler_hz=doppler[row],
                cn0_dbhz=cn0[row],
                lli=lli[row],
            )
            for row in range(len(self.numbers))
        )

    def _noise(self, epoch: int) -> FloatArray:
        """Standard normal numbers ``(R, 3, N_BANDS, N_SATS)``, drawn for every place whether tracked or not."""
        shape = (_QUANTITIES, 2, N_SATS)
        noise = np.full((len(self.numbers), _QUANTITIES, N_BANDS, N_SATS), np.nan)
        for row, number in enumerate(self.numbers):
            noise[row][:, (L1, L5)] = _generator(self.seed, Stream.NOISE, number, epoch).standard_normal(shape)
        return noise


def _generator(seed: int, stream: Stream, number: int, epoch: int = 0) -> np.random.Generator:
    """Random numbers of one receiver, purpose and epoch: the two low words of the counter are left to count with."""
    return np.random.Generator(np.random.Philox(key=[seed, int(stream)], counter=[0, 0, epoch, number]))
