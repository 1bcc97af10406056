"""What a kind of receiver adds to the signals: clock, hardware delays, thermal noise, errors with memory, C/N0.

A :class:`ReceiverModel` holds the parameters, a :class:`ReceiverErrors` makes the values of an epoch. In order::

    cn0 = errors.cn0_dbhz(elevation_rad, change_db=effect.cn0_db)   # what arrives, with what faults change
    tracked = errors.tracked(elevation_rad, cn0) & effect.tracked   # what is held
    values = errors.at(epoch, elevation_rad, cn0)                   # errors of code, carrier, Doppler; C/N0 as output

Everything is a function of the parameters and the number of the epoch: nothing remembers.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Final, NamedTuple

import numpy as np

from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.parameters import Parameter, parameters
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signal.antenna import Cn0Curve, Cn0Model
from gbas_core.signal.tracking_loops import TrackingParams, lock_threshold_dbhz, noise_sigmas
from gbas_core.signals import L1, L5, WAVELENGTH_M
from gbas_sim.random_processes import GaussMarkov, Normals, Stream
from gbas_sim.receivers.multipath import CorrelatedError, CorrelatedErrors
from gbas_sim.receivers.oscillators import (
    OSCILLATORS,
    ClockBank,
    ClockState,
    HardwareParams,
    OscillatorParams,
    hardware_delays,
)

# Known: F14.3 fields hold metres, cycles, hertz and dB-Hz with three digits. Source: RINEX 3.05, table A3.
_RINEX_STEP: Final = 0.001
_WHITE: Final = 3  # carrier, Doppler, C/N0

ELEVATION_MASK: Final = Parameter("lowest elevation tracked", "deg", 0.0, math.degrees(1.5))
CN0_SIGMA: Final = Parameter("white noise of the C/N0 that is output", "dB", 0.0, 10.0)
RINEX_STEPS: Final = Parameter("observations are rounded to the digits of a RINEX file")


@parameters
class ReceiverModel:
    """A kind of receiver with its antenna and site; `errors` are multipath and others with memory."""

    tracking: TrackingParams = TrackingParams()
    cn0: Cn0Model = Cn0Curve()
    errors: tuple[CorrelatedError, ...] = ()
    oscillator: OscillatorParams = OSCILLATORS["ocxo"]
    hardware: HardwareParams = HardwareParams()
    elevation_mask_rad: Annotated[float, ELEVATION_MASK] = math.radians(3.0)
    cn0_sigma_db: Annotated[float, CN0_SIGMA] = 0.2
    rinex_steps: Annotated[bool, RINEX_STEPS] = False


IDEAL: Final = ReceiverModel(
    tracking=TrackingParams(noise_scale=0.0),
    oscillator=OscillatorParams(offset_s=0.0, drift=0.0),
    hardware=HardwareParams(band_m=0.0, system_m=0.0, code_carrier_m=0.0),
    cn0_sigma_db=0.0,
)
"""A receiver without errors: C/N0 and elevation mask only."""


class SignalErrors(NamedTuple):
    """What receivers add; arrays (R, N_BANDS, N_SATS), NaN on L2 and for missing elevations.

    Attributes
    ----------
    code_m, carrier_m : array
        Added to code and carrier ranges, hardware delays included, clock not [m].
    doppler_hz : array
        Added to the Doppler [Hz].
    cn0_dbhz : array
        C/N0 as the receiver outputs it [dB-Hz].
    """

    code_m: FloatArray
    carrier_m: FloatArray
    doppler_hz: FloatArray
    cn0_dbhz: FloatArray


class ReceiverErrors:
    """The errors of receivers of one kind, any epoch by itself.

    Parameters
    ----------
    model : ReceiverModel
    seed : int
        0 to 2^63 - 1.
    numbers : tuple of int
        Which receivers they are: another number, other errors; which others there are makes no difference.
    interval_s : float
        Between epochs [s].
    """

    def __init__(self, model: ReceiverModel, *, seed: int, numbers: tuple[int, ...], interval_s: float) -> None:
        self.model = model
        self._numbers = numbers
        self._clock = ClockBank(model.oscillator, seed=seed, numbers=numbers, interval_s=interval_s)
        self._hardware = hardware_delays(model.hardware, seed=seed, numbers=numbers)
        self._memory = CorrelatedErrors(model.errors, seed=seed, numbers=numbers, interval_s=interval_s)
        correlation = model.tracking.code_correlation_s / interval_s
        self._code = GaussMarkov(Normals(seed, Stream.CODE_NOISE), numbers, (2, N_SATS), correlation)
        self._white = Normals(seed, Stream.WHITE_NOISE)
        self._threshold_dbhz = lock_threshold_dbhz(model.tracking)

    def clocks(self, epoch: int) -> ClockState:
        """Clocks less system time and their rates, (R,) each, at an epoch from -1 on."""
        return self._clock.at(epoch)

    def cn0_dbhz(
        self,
        elevation_rad: FloatArray,
        *,
        antenna_elevation_rad: FloatArray | None = None,
        change_db: FloatArray | float = 0.0,
    ) -> FloatArray:
        """C/N0 at the receiver, ``(..., N_BANDS, N_SATS)`` [dB-Hz]; NaN on L2.

        Parameters
        ----------
        elevation_rad : (..., N_SATS) array
            Above the horizon [rad].
        antenna_elevation_rad : (..., N_SATS) array, optional
            Above the antenna's plane, if that is tilted [rad].
        change_db : (..., N_BANDS, N_SATS) array
            What faults, fading and reflections change [dB].
        """
        return np.asarray(self.model.cn0.cn0_dbhz(elevation_rad, antenna_elevation_rad) + change_db)

    def tracked(self, elevation_rad: FloatArray, cn0_dbhz: FloatArray) -> BoolArray:
        """Signals ``(..., N_BANDS, N_SATS)`` above the mask whose C/N0 the loops hold."""
        above = (elevation_rad >= self.model.elevation_mask_rad)[..., np.newaxis, :]
        return np.asarray(above & (cn0_dbhz >= self._threshold_dbhz))

    def at(self, epoch: int, elevation_rad: FloatArray, cn0_dbhz: FloatArray) -> SignalErrors:
        """Errors of an epoch.

        Parameters
        ----------
        epoch : int
            Its number.
        elevation_rad : (R, N_SATS) array
        cn0_dbhz : (R, N_BANDS, N_SATS) array
            From :meth:`cn0_dbhz`.
        """
        sigma = noise_sigmas(self.model.tracking, cn0_dbhz)
        code_m, carrier_m = self._memory.at(epoch, elevation_rad)
        code_m += self._hardware.code_m
        carrier_m += self._hardware.carrier_m
        doppler_hz = np.zeros_like(code_m)
        cn0 = np.array(cn0_dbhz)
        loop = self._code.at(epoch)
        white = self._white.rows(self._numbers, epoch, (_WHITE, 2, N_SATS))
        for place, band in enumerate((L1, L5)):
            code_m[:, band] += sigma.code_m[:, band] * loop[:, place]
            carrier_m[:, band] += sigma.carrier_m[:, band] * white[:, 0, place]
            doppler_hz[:, band] = sigma.doppler_hz[:, band] * white[:, 1, place]
            cn0[:, band] += self.model.cn0_sigma_db * white[:, 2, place]
        missing = np.isnan(cn0)
        for values in (code_m, carrier_m, doppler_hz):
            values[missing] = np.nan
        return SignalErrors(code_m=code_m, carrier_m=carrier_m, doppler_hz=doppler_hz, cn0_dbhz=cn0)


def rinex_rounded(observation: ObservationEpoch) -> ObservationEpoch:
    """The observation as a RINEX file holds it: 1 mm of code, 0.001 cycles, 0.001 Hz, 0.001 dB-Hz.

    Source: RINEX 3.05, table A3: F14.3.
    """
    wavelength = WAVELENGTH_M[:, np.newaxis]
    return replace(
        observation,
        code_m=_rounded(observation.code_m),
        carrier_m=_rounded(observation.carrier_m / wavelength) * wavelength,
        doppler_hz=_rounded(observation.doppler_hz),
        cn0_dbhz=_rounded(observation.cn0_dbhz),
    )


def _rounded(values: FloatArray) -> FloatArray:
    return np.asarray(np.rint(values / _RINEX_STEP) * _RINEX_STEP)
