"""Tracking loops: noise of code, carrier and Doppler from C/N0, and the C/N0 below which a signal is lost.

Signals are L1 C/A (BPSK(1)), E1 (taken as BOC(1,1)), and L5 and E5a (BPSK(10)).

Sources: Kaplan and Hegarty, Understanding GPS, 2nd edition (2006), 5.6 (K&H); Betz and Kolodziejski, "Extended theory
of early-late code tracking for a bandlimited GPS receiver", NAVIGATION 47 (2000), pp. 211-226; Betz, "Binary offset
carrier modulations for radionavigation", NAVIGATION 48 (2001), pp. 227-246; Sabatini, Moore, Hill, "A novel GNSS
integrity augmentation system", WASET 7 (2013), eq (42) to (56).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import simpson

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GPS, N_SATS
from gbas_core.signals import FREQUENCY_HZ, L1, L5, N_BANDS, SPEED_OF_LIGHT_MPS, WAVELENGTH_M

SIGNALS: Final = ("L1 C/A", "E1", "L5/E5a")
"""The kinds of signals, in the order of parameters that have a value for each."""


@dataclass(frozen=True, kw_only=True)
class Modulation:
    """A spreading code with its chip shape.

    Attributes
    ----------
    name : str
    chip_rate_hz : float
    boc : bool
        Whether a square wave of the chip rate, sine phased, multiplies the chips: BOC(n, n).
    """

    name: str
    chip_rate_hz: float
    boc: bool = False

    @property
    def chip_m(self) -> float:
        """Length of a chip [m]."""
        return SPEED_OF_LIGHT_MPS / self.chip_rate_hz

    def density_s(self, frequency_hz: ArrayLike) -> FloatArray:
        """Power spectral density, of unit power over all frequencies [1/Hz].

        Source: Betz (2001), eq (4) (BPSK) and (9) (BOC, even).
        """
        chips = np.asarray(frequency_hz, dtype=np.float64) / self.chip_rate_hz
        shape = np.sinc(chips)
        if self.boc:
            # sin(pi x) tan(pi x / 2) / (pi x), without the poles of the tangent.
            shape = np.sinc(0.5 * chips) * np.sin(0.5 * np.pi * chips)
        return np.asarray(shape**2 / self.chip_rate_hz)

    def correlation(self, lag_chips: ArrayLike) -> FloatArray:
        """Autocorrelation with unlimited bandwidth, 1 at lag 0 [-]."""
        lag = np.abs(np.asarray(lag_chips, dtype=np.float64))
        if self.boc:
            return np.where(lag <= 0.5, 1.0 - 3.0 * lag, np.minimum(lag - 1.0, 0.0))
        return np.asarray(np.maximum(1.0 - lag, 0.0))


BPSK_1: Final = Modulation(name="BPSK(1)", chip_rate_hz=1.023e6)
BPSK_10: Final = Modulation(name="BPSK(10)", chip_rate_hz=10.23e6)
BOC_1_1: Final = Modulation(name="BOC(1,1)", chip_rate_hz=1.023e6, boc=True)
MODULATIONS: Final = (BPSK_1, BOC_1_1, BPSK_10)
"""Of :data:`SIGNALS`."""


def per_signal(values: tuple[float, float, float]) -> FloatArray:
    """Values of the kinds of signals on the bands and satellites that have them, (N_BANDS, N_SATS); NaN on L2."""
    placed = np.full((N_BANDS, N_SATS), np.nan)
    placed[L1] = np.where(IS_GPS, values[0], values[1])
    placed[L5] = values[2]
    return placed


class CodeJitter(NamedTuple):
    """What the noise of a code loop depends on, besides C/N0, loop bandwidth and integration time.

    Attributes
    ----------
    variance_s2 : float
        Times loop bandwidth over C/N0 gives the variance at high C/N0 [s^2].
    squaring : float
        Over (integration time times C/N0), the relative increase of the variance [-].
    """

    variance_s2: float
    squaring: float


@lru_cache(maxsize=64)
def code_jitter(modulation: Modulation, spacing_chips: float, front_end_hz: float) -> CodeJitter:
    """Thermal noise of an early-late power discriminator behind a brick-wall filter.

    Parameters
    ----------
    modulation : Modulation
    spacing_chips : float
        From early to late [chips].
    front_end_hz : float
        Two-sided bandwidth of the front end [Hz].

    Source: K&H eq (5.22), from Betz and Kolodziejski (2000).
    """
    half_band, spacing_s = 0.5 * front_end_hz, spacing_chips / modulation.chip_rate_hz
    # Simpson's rule with 400 points a lobe of the integrands, whose finest is a chip's.
    points = 2 * round(400.0 * max(1.0, half_band / modulation.chip_rate_hz)) + 1
    frequency = np.linspace(0.0, half_band, points)
    density = modulation.density_s(frequency)
    sine, cosine = np.sin(np.pi * frequency * spacing_s), np.cos(np.pi * frequency * spacing_s)

    def over_band(values: FloatArray) -> float:
        return 2.0 * float(simpson(values, x=frequency))

    slope = 2.0 * math.pi * over_band(frequency * density * sine)
    return CodeJitter(
        variance_s2=over_band(density * sine**2) / slope**2,
        squaring=over_band(density * cosine**2) / over_band(density * cosine) ** 2,
    )


def code_sigma_s(jitter: CodeJitter, cn0_dbhz: ArrayLike, bandwidth_hz: float, integration_s: float) -> FloatArray:
    """Standard deviation of a code loop's thermal noise [s]; the loop's one-sided bandwidth and integration time.

    Source: K&H eq (5.22).
    """
    ratio = cn0_ratio_hz(cn0_dbhz)
    variance = jitter.variance_s2 * bandwidth_hz / ratio * (1.0 + jitter.squaring / (integration_s * ratio))
    return np.asarray(np.sqrt(variance))


def phase_sigma_rad(cn0_dbhz: ArrayLike, bandwidth_hz: float, integration_s: float) -> FloatArray:
    """Standard deviation of a Costas loop's thermal noise [rad].

    Source: K&H eq (5.6); Sabatini et al., eq (44), with C/N0 as a ratio and radians for degrees.
    """
    return _phase_rad(cn0_ratio_hz(cn0_dbhz), bandwidth_hz, integration_s)


def frequency_sigma_hz(
    cn0_dbhz: ArrayLike, bandwidth_hz: float, integration_s: float, *, near_threshold: bool = False
) -> FloatArray:
    """Standard deviation of a frequency loop's thermal noise [Hz].

    Source: K&H 5.6.2; Sabatini et al., eq (51), with C/N0 as a ratio; F = 1, but 2 near the threshold.
    """
    factor = 2.0 if near_threshold else 1.0
    return _frequency_hz(cn0_ratio_hz(cn0_dbhz), factor * bandwidth_hz, integration_s)


def vibration_phase_rad(frequency_hz: float, sensitivity_per_g: float, power_g2phz: float) -> float:
    """Phase jitter of an oscillator under vibration with a flat spectrum of `power_g2phz` from 20 to 2000 Hz [rad].

    Source: K&H 5.6.1.2; Sabatini et al., eq (46): 1.42 degrees on L1 at 1e-9 per g and 0.005 g^2/Hz.
    """
    low_hz, high_hz = 20.0, 2000.0
    return frequency_hz * sensitivity_per_g * math.sqrt(power_g2phz * (1.0 / low_hz - 1.0 / high_hz))


def oscillator_phase_rad(
    frequency_hz: float, allan_deviation: float, bandwidth_hz: float, order: Literal[2, 3] = 3
) -> float:
    """Phase jitter of a loop from an oscillator's instability over about 1/bandwidth [rad].

    Source: K&H eq (5.12), (5.13); Sabatini et al., eq (47), (48).

    Notes
    -----
    The factors 144 and 160 of both give degrees; the second says radians, which would be 57 times too much.
    """
    return math.radians(_OSCILLATOR_DEG[order] * allan_deviation * frequency_hz / bandwidth_hz)


_OSCILLATOR_DEG: Final = {2: 144.0, 3: 160.0}


def natural_rate_radps(bandwidth_hz: float, order: Literal[1, 2, 3]) -> float:
    """Natural frequency of a loop with that noise bandwidth [rad/s].

    Source: K&H table 5.6.
    """
    return bandwidth_hz / _BANDWIDTH_OVER_RATE[order]


_BANDWIDTH_OVER_RATE: Final = {1: 0.25, 2: 0.53, 3: 0.7845}


def dynamic_phase_rad(
    frequency_hz: float, motion: ArrayLike, bandwidth_hz: float, order: Literal[2, 3] = 3
) -> FloatArray:
    """Phase error of a loop under motion along the line of sight [rad].

    Parameters
    ----------
    motion : array
        What the loop does not follow: acceleration [m/s^2] with order 2, jerk [m/s^3] with order 3.

    Source: K&H eq (5.16) and table 5.6: over the natural frequency to the power of the order; Sabatini et al., eq (49),
    whose text says acceleration where its formula and number are a jerk.
    """
    radians = 2.0 * math.pi * frequency_hz / SPEED_OF_LIGHT_MPS * np.abs(np.asarray(motion, dtype=np.float64))
    return np.asarray(radians / natural_rate_radps(bandwidth_hz, order) ** order)


CODE_BANDWIDTH: Final = Parameter("one-sided noise bandwidth of the code loop", "Hz", 0.01, 10.0)
CARRIER_BANDWIDTH: Final = Parameter("of the third-order Costas loop", "Hz", 0.1, 100.0)
NOISE_SCALE: Final = Parameter("factor on all thermal noise; 0 switches it off", "-", 0.0, 100.0)


@parameters
class TrackingParams:
    """The loops of a receiver; triples are for :data:`SIGNALS`.

    The code loop is aided by the carrier; its noise has a correlation time of a quarter of the inverse of its
    bandwidth. Known: at least 0.125 Hz in a GBAS (Annex 10 Vol. I, App. B 3.6.8.3.5.1).
    """

    spacing_chips: Annotated[tuple[float, float, float], Parameter("early to late", "chips", 0.02, 1.0)] = (
        0.1,
        0.1,
        1.0,
    )
    front_end_hz: Annotated[
        tuple[float, float, float], Parameter("two-sided bandwidths before correlation", "Hz", 1.0e6, 60.0e6)
    ] = (20.0e6, 20.0e6, 20.0e6)
    code_bandwidth_hz: Annotated[float, CODE_BANDWIDTH] = 0.25
    carrier_bandwidth_hz: Annotated[float, CARRIER_BANDWIDTH] = 15.0
    frequency_bandwidth_hz: Annotated[float, Parameter("of the frequency loop", "Hz", 0.1, 100.0)] = 2.0
    integration_s: Annotated[float, Parameter("before detection, of all loops", "s", 0.001, 1.0)] = 0.02
    allan_deviation: Annotated[float, Parameter("of the oscillator over the phase loop's time", "-", 0.0, 1.0e-7)] = (
        1.0e-10
    )
    vibration_sensitivity_per_g: Annotated[float, Parameter("of the oscillator", "1/g", 0.0, 1.0e-6)] = 1.0e-9
    vibration_g2phz: Annotated[float, Parameter("flat spectrum it feels from 20 to 2000 Hz", "g^2/Hz", 0.0, 10.0)] = 0.0
    jerk_mps3: Annotated[
        float, Parameter("largest along a line of sight that the phase loop is to bear", "m/s^3", 0.0, 1000.0)
    ] = 0.0
    noise_scale: Annotated[float, NOISE_SCALE] = 1.0

    @property
    def code_correlation_s(self) -> float:
        """Correlation time of the code loop's noise [s]: a first-order loop of gain K has bandwidth K/4, time 1/K."""
        return 0.25 / self.code_bandwidth_hz


class NoiseSigmas(NamedTuple):
    """Standard deviations ``(..., N_BANDS, N_SATS)`` of thermal noise; NaN on L2."""

    code_m: FloatArray
    carrier_m: FloatArray
    doppler_hz: FloatArray


def noise_sigmas(params: TrackingParams, cn0_dbhz: FloatArray) -> NoiseSigmas:
    """Thermal noise at C/N0 ``(..., N_BANDS, N_SATS)`` [dB-Hz]."""
    variance, squaring = _jitters(params)
    ratio = cn0_ratio_hz(cn0_dbhz)
    coherent = params.integration_s * ratio
    code_s = np.sqrt(variance * (params.code_bandwidth_hz / ratio) * (1.0 + squaring / coherent))
    phase_rad = _phase_rad(ratio, params.carrier_bandwidth_hz, params.integration_s)
    doppler_hz = _frequency_hz(ratio, params.frequency_bandwidth_hz, params.integration_s)
    return NoiseSigmas(
        code_m=params.noise_scale * SPEED_OF_LIGHT_MPS * code_s,
        carrier_m=params.noise_scale * _RADIAN_M * phase_rad,
        doppler_hz=params.noise_scale * doppler_hz,
    )


def lock_threshold_dbhz(params: TrackingParams) -> FloatArray:
    """Lowest C/N0 at which code and phase loops hold, (N_BANDS, N_SATS) [dB-Hz]; NaN on L2.

    The phase loop holds while three standard deviations of its jitter and its dynamic error stay within 45 degrees,
    the code loop while three of its own stay within half the spacing. Above either bound nothing is lost, below
    everything is: a rule of thumb, as its sources say. NaN-free infinity where stress alone breaks the phase lock.

    Source: K&H eq (5.5), (5.21); Sabatini et al., eq (42), (43), (53).

    Notes
    -----
    With x = 1 / (C/N0), both variances are ``a x (1 + b x)``, and the threshold is the root of a quadratic equation.
    """
    thresholds = []
    for signal, modulation in enumerate(MODULATIONS):
        frequency_hz = float(FREQUENCY_HZ[L5 if modulation is BPSK_10 else L1])
        jitter = code_jitter(modulation, params.spacing_chips[signal], params.front_end_hz[signal])
        half_spacing_s = 0.5 * params.spacing_chips[signal] / modulation.chip_rate_hz
        code = threshold_dbhz(
            half_spacing_s**2 / 9.0,
            jitter.variance_s2 * params.code_bandwidth_hz,
            jitter.squaring / params.integration_s,
        )
        left = phase_margin_rad2(params, frequency_hz)
        phase = threshold_dbhz(left, params.carrier_bandwidth_hz, 0.5 / params.integration_s)
        thresholds.append(max(code, phase))
    return per_signal((thresholds[0], thresholds[1], thresholds[2]))


def phase_margin_rad2(params: TrackingParams, frequency_hz: float) -> float:
    """Variance the phase loop has left for thermal noise [rad^2]; below 0 when stress alone breaks the lock.

    Source: Sabatini et al., eq (43): sqrt(thermal + vibration^2 + oscillator^2) + dynamic / 3 <= 15 degrees.
    """
    dynamic = float(dynamic_phase_rad(frequency_hz, params.jerk_mps3, params.carrier_bandwidth_hz))
    jitter = math.radians(15.0) - dynamic / 3.0
    vibration = vibration_phase_rad(frequency_hz, params.vibration_sensitivity_per_g, params.vibration_g2phz)
    oscillator = oscillator_phase_rad(frequency_hz, params.allan_deviation, params.carrier_bandwidth_hz)
    return max(jitter, 0.0) ** 2 - vibration**2 - oscillator**2


_RADIAN_M: Final[FloatArray] = (WAVELENGTH_M / (2.0 * np.pi))[:, np.newaxis]


@lru_cache(maxsize=64)
def _jitters(params: TrackingParams) -> tuple[FloatArray, FloatArray]:
    """:class:`CodeJitter` of each band and satellite, (N_BANDS, N_SATS) each."""
    found = [
        code_jitter(modulation, params.spacing_chips[signal], params.front_end_hz[signal])
        for signal, modulation in enumerate(MODULATIONS)
    ]
    variance = per_signal((found[0].variance_s2, found[1].variance_s2, found[2].variance_s2))
    squaring = per_signal((found[0].squaring, found[1].squaring, found[2].squaring))
    return variance, squaring


def cn0_ratio_hz(cn0_dbhz: ArrayLike) -> FloatArray:
    """C/N0 as a ratio [Hz]."""
    return np.asarray(10.0 ** (0.1 * np.asarray(cn0_dbhz, dtype=np.float64)))


def _phase_rad(ratio: FloatArray, bandwidth_hz: float, integration_s: float) -> FloatArray:
    return np.asarray(np.sqrt(bandwidth_hz / ratio * (1.0 + 0.5 / (integration_s * ratio))))


def _frequency_hz(ratio: FloatArray, bandwidth_hz: float, integration_s: float) -> FloatArray:
    scale = 1.0 / (math.pi * integration_s)
    return np.asarray(scale * np.sqrt(bandwidth_hz / ratio * (1.0 + 1.0 / (integration_s * ratio))))


def threshold_dbhz(allowed: float, first: float, second: float) -> float:
    """C/N0 at which ``first x (1 + second x)``, x its inverse, is `allowed`; infinity for none left [dB-Hz]."""
    if not allowed > 0.0:
        return math.inf
    root = (math.sqrt(first**2 + 4.0 * first * second * allowed) - first) / (2.0 * first * second)
    return -10.0 * math.log10(root)
