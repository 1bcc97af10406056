"""Thresholds of tracking loops under thermal noise, vibration, oscillator instability and motion; jamming margin.

Rules of thumb: a loop holds while three standard deviations of its jitter with its dynamic error stay within its
discriminator's range: 45 degrees of a phase loop, a quarter of the inverse of the integration time of a frequency loop,
the spacing from early to prompt of a code loop.

Sources: Kaplan and Hegarty, Understanding GPS, 2nd edition (2006), 5.6 (K&H); Sabatini, Moore, Hill, "A novel GNSS
integrity augmentation system", WASET 7 (2013), eq (42) to (56).
"""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.signal.tracking_loops import (
    BPSK_1,
    Modulation,
    cn0_ratio_hz,
    code_jitter,
    dynamic_phase_rad,
    frequency_sigma_hz,
    natural_rate_radps,
    oscillator_phase_rad,
    phase_sigma_rad,
    threshold_dbhz,
    vibration_phase_rad,
)
from gbas_core.signals import FREQUENCY_HZ, L1, SPEED_OF_LIGHT_MPS

CodeNoise = Literal["band_limited", "paper"]

L1_HZ: Final = float(FREQUENCY_HZ[L1])
PHASE_LIMIT_RAD: Final = math.radians(45.0)


@parameters
class LoopParams:
    """The loops of an avionics receiver; defaults are the paper's, of its fighter, where it has any.

    Uncertain, ours: frequency and code loops, of which the paper gives no numbers.
    """

    phase_order: Annotated[Literal[2, 3], Parameter("of the Costas loop")] = 3
    phase_bandwidth_hz: Annotated[float, Parameter("its one-sided noise bandwidth", "Hz", 0.1, 200.0)] = 18.0
    frequency_order: Annotated[Literal[1, 2], Parameter("of the frequency loop")] = 2
    frequency_bandwidth_hz: Annotated[float, Parameter("its one-sided noise bandwidth", "Hz", 0.1, 200.0)] = 10.0
    code_order: Annotated[Literal[1, 2, 3], Parameter("of the code loop")] = 2
    code_bandwidth_hz: Annotated[float, Parameter("its one-sided noise bandwidth", "Hz", 0.01, 50.0)] = 1.0
    spacing_chips: Annotated[float, Parameter("early to prompt, and prompt to late", "chips", 0.01, 0.5)] = 0.5
    front_end_hz: Annotated[float, Parameter("two-sided bandwidth before correlation", "Hz", 1.0e6, 60.0e6)] = 20.0e6
    code_noise: Annotated[CodeNoise, Parameter("formula of the code loop's noise")] = "band_limited"
    integration_s: Annotated[float, Parameter("before detection, of all loops", "s", 1e-4, 1.0)] = 0.02
    allan_deviation: Annotated[float, Parameter("of the oscillator over the phase loop's time", "-", 0.0, 1e-7)] = 1e-10
    vibration_sensitivity_per_g: Annotated[float, Parameter("of the oscillator", "1/g", 0.0, 1e-6)] = 1e-9
    vibration_g2phz: Annotated[float, Parameter("flat spectrum from 20 to 2000 Hz", "g^2/Hz", 0.0, 10.0)] = 0.005
    aiding_residual: Annotated[
        float,
        Parameter("share of the aircraft's motion that aiding by velocity leaves; 1: unaided", "-", 0.0, 1.0),
    ] = 1.0


class Motion(NamedTuple):
    """Of the line of sight, any shapes that go together; what is not known is NaN, and so is what depends on it.

    Attributes
    ----------
    velocity_mps, acceleration_mps2, jerk_mps3 : array
    """

    velocity_mps: ArrayLike = 0.0
    acceleration_mps2: ArrayLike = 0.0
    jerk_mps3: ArrayLike = 0.0

    def derivative(self, order: int) -> FloatArray:
        """The derivative of the range of that order, as an amount."""
        return np.abs(np.asarray(self[order - 1], dtype=np.float64))


# --- phase loop


def phase_three_sigma_rad(
    params: LoopParams, cn0_dbhz: ArrayLike, motion: Motion, frequency_hz: float = L1_HZ
) -> FloatArray:
    """Three standard deviations of a phase loop's jitter, with its dynamic error [rad]; it holds up to 45 degrees.

    Source: Sabatini et al., eq (42), (43).
    """
    thermal = phase_sigma_rad(cn0_dbhz, params.phase_bandwidth_hz, params.integration_s)
    jitter = np.sqrt(thermal**2 + _shaking_rad2(params, frequency_hz))
    return np.asarray(3.0 * jitter + phase_stress_rad(params, motion, frequency_hz))


def phase_stress_rad(params: LoopParams, motion: Motion, frequency_hz: float = L1_HZ) -> FloatArray:
    """Dynamic error of the phase loop [rad].

    Source: Sabatini et al., eq (49).
    """
    left = params.aiding_residual * motion.derivative(params.phase_order)
    return dynamic_phase_rad(frequency_hz, left, params.phase_bandwidth_hz, params.phase_order)


def vibration_rad(params: LoopParams, frequency_hz: float = L1_HZ) -> float:
    """Jitter of the oscillator from vibration [rad]; Sabatini et al., eq (46)."""
    return vibration_phase_rad(frequency_hz, params.vibration_sensitivity_per_g, params.vibration_g2phz)


def oscillator_rad(params: LoopParams, frequency_hz: float = L1_HZ) -> float:
    """Jitter from the oscillator's instability [rad]; Sabatini et al., eq (47), (48)."""
    return oscillator_phase_rad(frequency_hz, params.allan_deviation, params.phase_bandwidth_hz, params.phase_order)


def _shaking_rad2(params: LoopParams, frequency_hz: float) -> float:
    return vibration_rad(params, frequency_hz) ** 2 + oscillator_rad(params, frequency_hz) ** 2


# --- frequency loop


def frequency_limit_hz(params: LoopParams) -> float:
    """What the frequency loop bears: a quarter of the inverse of the integration time [Hz]."""
    return 0.25 / params.integration_s


def frequency_three_sigma_hz(
    params: LoopParams, cn0_dbhz: ArrayLike, motion: Motion, frequency_hz: float = L1_HZ
) -> FloatArray:
    """Three standard deviations of a frequency loop's jitter, with its dynamic error [Hz].

    Source: Sabatini et al., eq (50) with its two definitions exchanged, and (51) with F = 2, as near the threshold.
    """
    sigma = frequency_sigma_hz(cn0_dbhz, params.frequency_bandwidth_hz, params.integration_s, near_threshold=True)
    return np.asarray(3.0 * sigma + frequency_stress_hz(params, motion, frequency_hz))


def frequency_stress_hz(params: LoopParams, motion: Motion, frequency_hz: float = L1_HZ) -> FloatArray:
    """Dynamic error of the frequency loop [Hz]: one integrator more than a phase loop of that order.

    Source: Sabatini et al., eq (52).
    """
    order = params.frequency_order
    cycles = frequency_hz / SPEED_OF_LIGHT_MPS * params.aiding_residual * motion.derivative(order + 1)
    return np.asarray(cycles / natural_rate_radps(params.frequency_bandwidth_hz, order) ** order)


# --- code loop


def code_three_sigma_chips(
    params: LoopParams, cn0_dbhz: ArrayLike, motion: Motion, modulation: Modulation = BPSK_1
) -> FloatArray:
    """Three standard deviations of a code loop's jitter, with its dynamic error [chips]; it holds up to the spacing.

    Source: Sabatini et al., eq (53).

    Notes
    -----
    The noise is of an early-late power discriminator behind a filter (K&H eq (5.22)). The paper's eq (54), with d from
    early to prompt, agrees with it at d = 0.5 and is too small at narrower spacings, where it has d^2 for d.
    """
    first, second = _code_noise(params, modulation)
    x = 1.0 / cn0_ratio_hz(cn0_dbhz)
    return np.asarray(3.0 * np.sqrt(first * x * (1.0 + second * x)) + code_stress_chips(params, motion, modulation))


def code_stress_chips(params: LoopParams, motion: Motion, modulation: Modulation = BPSK_1) -> FloatArray:
    """Dynamic error of the code loop [chips]; Sabatini et al., eq (55)."""
    order = params.code_order
    left = params.aiding_residual * motion.derivative(order) / modulation.chip_m
    return np.asarray(left / natural_rate_radps(params.code_bandwidth_hz, order) ** order)


def _code_noise(params: LoopParams, modulation: Modulation) -> tuple[float, float]:
    """a [chips^2 Hz] and b [Hz] of the variance a x (1 + b x), x the inverse of C/N0."""
    spacing, bandwidth_hz = params.spacing_chips, params.code_bandwidth_hz
    if params.code_noise == "paper":
        # F1 = 0.5: correlators of their own for early and late; F2 = 1: an early-late discriminator.
        return 4.0 * spacing**2 * bandwidth_hz * (1.0 - spacing), 2.0 * spacing / (1.0 - spacing) / params.integration_s
    jitter = code_jitter(modulation, 2.0 * spacing, params.front_end_hz)
    return jitter.variance_s2 * modulation.chip_rate_hz**2 * bandwidth_hz, jitter.squaring / params.integration_s


# --- thresholds


class Thresholds(NamedTuple):
    """Lowest C/N0 at which each loop holds [dB-Hz]; infinity where motion alone breaks it."""

    phase_dbhz: float
    frequency_dbhz: float
    code_dbhz: float

    @property
    def all_dbhz(self) -> float:
        """At which all hold; Sabatini et al., eq (56)."""
        return max(self)


def cn0_thresholds(
    params: LoopParams, motion: Motion, modulation: Modulation = BPSK_1, frequency_hz: float = L1_HZ
) -> Thresholds:
    """Where the loops' inequalities turn, of one line of sight.

    Source: Sabatini et al., eq (42), (50), (53), (56).

    Notes
    -----
    With x the inverse of C/N0 all variances are ``a x (1 + b x)``: roots of quadratic equations.
    """
    integration_s = params.integration_s
    phase_left = max(PHASE_LIMIT_RAD - float(phase_stress_rad(params, motion, frequency_hz)), 0.0) / 3.0
    frequency_left = frequency_limit_hz(params) - float(frequency_stress_hz(params, motion, frequency_hz))
    code_left = params.spacing_chips - float(code_stress_chips(params, motion, modulation))
    first, second = _code_noise(params, modulation)
    return Thresholds(
        phase_dbhz=threshold_dbhz(
            phase_left**2 - _shaking_rad2(params, frequency_hz), params.phase_bandwidth_hz, 0.5 / integration_s
        ),
        frequency_dbhz=threshold_dbhz(
            (max(frequency_left, 0.0) / 3.0) ** 2,
            2.0 * params.frequency_bandwidth_hz / (math.pi * integration_s) ** 2,
            1.0 / integration_s,
        ),
        code_dbhz=threshold_dbhz((max(code_left, 0.0) / 3.0) ** 2, first, second),
    )


def jamming_margin_db(
    cn0_dbhz: ArrayLike, threshold_dbhz: ArrayLike, *, chip_rate_hz: float = 1.023e6, quality: float = 1.5
) -> FloatArray:
    """Power of a jammer over that of the signal at which C/N0 falls to the threshold [dB]; -infinity below it.

    Parameters
    ----------
    cn0_dbhz, threshold_dbhz : array
        C/N0 without the jammer, and at which the signal is lost [dB-Hz].
    chip_rate_hz : float
        Of the code [Hz].
    quality : float
        1 for a narrow-band jammer, 1.5 for one with the signal's spectrum, 2 for wide-band noise [-].

    Source: Ward, ION GPS 1997 (the paper's [19]); Kaplan, Understanding GPS (1996), eq (6.5).
    """
    room = 1.0 / cn0_ratio_hz(threshold_dbhz) - 1.0 / cn0_ratio_hz(cn0_dbhz)
    with np.errstate(divide="ignore"):
        return np.asarray(10.0 * np.log10(quality * chip_rate_hz * np.maximum(room, 0.0)))
