"""The early-late phase: the difference of the phases of late and early correlator, which echoes turn apart.

Without an echo both have the phase of the signal, and noise alone makes a difference; the loop's own phase cancels.

Sources: Mubarak and Dempster, "Statistical analysis of early late phase for multipath detection", IGNSS (2009);
Sabatini, Moore, Hill, WASET 7 (2013), eq (40), (41), figures 21 and 22.

Notes
-----
Eq (41) prints the arc tangent of a difference of ratios; the difference of two arc tangents is meant. It is taken as
the angle of the late correlator times the conjugate of the early one, which is the same where both are within 90
degrees of the prompt phase and has no ambiguity beyond. C/N0 is in dB-Hz, not "dB/Hz".

An echo that is late by a small part of a chip turns both correlators alike: those of the airframe are not seen (a fin's
of half the signal's amplitude, 1.2 m late, is 0.011 rad at most). The observable is one for echoes of the ground and of
buildings.
"""

from __future__ import annotations

import math
from typing import Annotated, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.signal.tracking_loops import BPSK_1, Modulation, cn0_ratio_hz

ComplexArray = NDArray[np.complex128]
THRESHOLD_RAD: Final = 0.1
"""The paper's, of its caution."""
_DRAWS: Final = 200_000
"""Of noise and echoes for a share: good to 0.001."""


@parameters
class EarlyLateParams:
    """A receiver's correlators. Uncertain: the paper gives neither; these come nearest to its figure 22."""

    spacing_chips: Annotated[float, Parameter("early to prompt, and prompt to late", "chips", 0.01, 0.75)] = 0.5
    integration_s: Annotated[float, Parameter("of each correlation", "s", 0.001, 10.0)] = 0.02


def early_late_phase_rad(early: ComplexArray, late: ComplexArray) -> FloatArray:
    """Phase of late less phase of early correlator outputs, -pi to pi [rad].

    Source: Sabatini et al., eq (41), corrected.
    """
    return np.angle(late * np.conj(early))


def correlators(
    params: EarlyLateParams, delay_chips: ArrayLike, amplitude: ArrayLike, modulation: Modulation = BPSK_1
) -> tuple[ComplexArray, ComplexArray]:
    """Early and late outputs with one echo, the prompt correlator on the direct signal, of amplitude 1; no noise.

    Parameters
    ----------
    params : EarlyLateParams
    delay_chips, amplitude : (...) arrays
        Of the echo; amplitude complex, over the direct signal.
    """
    delay, echo = np.asarray(delay_chips, dtype=np.float64), np.asarray(amplitude, dtype=np.complex128)
    half = params.spacing_chips
    direct = modulation.correlation(half)
    early = direct + echo * modulation.correlation(-half - delay)
    late = direct + echo * modulation.correlation(half - delay)
    return np.asarray(early), np.asarray(late)


def noise_sigma_rad(params: EarlyLateParams, cn0_dbhz: ArrayLike, modulation: Modulation = BPSK_1) -> FloatArray:
    """Standard deviation of the early-late phase from noise alone, at high C/N0 [rad].

    The noises of both correlators correlate as the code does over their distance, so that much of it cancels.
    """
    half = params.spacing_chips
    signal = float(modulation.correlation(half))
    apart = 1.0 - float(modulation.correlation(2.0 * half))
    return np.asarray(np.sqrt(apart / (cn0_ratio_hz(cn0_dbhz) * params.integration_s)) / signal)


def noisy_phase_rad(
    params: EarlyLateParams,
    cn0_dbhz: float,
    echoes: tuple[ArrayLike, ArrayLike],
    *,
    seed: int,
    modulation: Modulation = BPSK_1,
) -> FloatArray:
    """Early-late phases (N,) of correlators with noise, a draw for each echo: delays [chips] and amplitudes, (N,)."""
    early, late = correlators(params, *echoes, modulation)
    random = np.random.default_rng(seed)
    count = np.broadcast_shapes(early.shape)[0]
    draws = random.standard_normal((4, count)) / math.sqrt(2.0 * float(cn0_ratio_hz(cn0_dbhz)) * params.integration_s)
    alike = float(modulation.correlation(2.0 * params.spacing_chips))
    of_early = draws[0] + 1j * draws[1]
    of_late = alike * of_early + math.sqrt(1.0 - alike**2) * (draws[2] + 1j * draws[3])
    return early_late_phase_rad(early + of_early, late + of_late)


def false_alarm_share(
    params: EarlyLateParams, cn0_dbhz: float, thresholds_rad: ArrayLike, *, seed: int = 1
) -> FloatArray:
    """Share of early-late phases beyond thresholds, of either sign, without an echo: figure 22."""
    none = np.zeros(_DRAWS)
    return _beyond(noisy_phase_rad(params, cn0_dbhz, (none, none), seed=seed), thresholds_rad)


def detection_share(
    params: EarlyLateParams,
    cn0_dbhz: float,
    amplitude: float,
    thresholds_rad: ArrayLike,
    *,
    longest_chips: float = 1.5,
    seed: int = 1,
) -> FloatArray:
    """Share of echoes of an amplitude that are detected: figure 21.

    Delays are even up to `longest_chips`, phases even around the circle: the paper does not say which it took.
    """
    random = np.random.default_rng([seed, 21])
    delay = random.uniform(0.0, longest_chips, _DRAWS)
    echo = amplitude * np.exp(2j * np.pi * random.uniform(size=_DRAWS))
    return _beyond(noisy_phase_rad(params, cn0_dbhz, (delay, echo), seed=seed), thresholds_rad)


def threshold_rad(params: EarlyLateParams, cn0_dbhz: float, false_alarm: float) -> float:
    """Threshold with a share of false alarms of either sign, at high C/N0 [rad]."""
    if not 0.0 < false_alarm < 1.0:
        raise ValueError(f"false_alarm = {false_alarm!r} is not between 0 and 1")
    return float(-ndtri(0.5 * false_alarm) * noise_sigma_rad(params, cn0_dbhz))


def _beyond(phase_rad: FloatArray, thresholds_rad: ArrayLike) -> FloatArray:
    size = np.sort(np.abs(phase_rad))
    thresholds = np.asarray(thresholds_rad, dtype=np.float64)
    return np.asarray(1.0 - np.searchsorted(size, thresholds, side="right") / len(size))
