"""What code and phase loops make of a signal with delayed copies of itself.

The code error is where early and late correlators, each the sum of the direct signal's and the copies' correlation
functions, have the same power; the phase error is the phase of the sum there.

Sources: Braasch, "Multipath effects", in Parkinson and Spilker, Global Positioning System, vol. 1 (1996), ch. 14; van
Nee, "Multipath effects on GPS code phase measurements", NAVIGATION 39 (1992); Sabatini, Moore, Hill, WASET 7 (2013),
eq (21) and (22).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbas_core.record import FloatArray

ComplexArray = NDArray[np.complex128]

_HALVINGS: Final = 4
_STEPS: Final = 8


class LoopErrors(NamedTuple):
    """Errors of a receiver's loops ``(N,)``.

    Attributes
    ----------
    code_chips : array
        Delay of the code [chips].
    phase_rad : array
        Phase of the sum of signals relative to the direct one [rad].
    power_db : array
        Power of the prompt correlator relative to the direct signal alone [dB].
    """

    code_chips: FloatArray
    phase_rad: FloatArray
    power_db: FloatArray


def discriminator_errors(
    delay_chips: FloatArray, amplitude: ComplexArray, spacing_chips: ArrayLike, *, boc: ArrayLike = False
) -> LoopErrors:
    """Where an early-late power discriminator with unlimited bandwidth balances.

    Parameters
    ----------
    delay_chips : (K, N) array
        Of the copies [chips].
    amplitude : (K, N) complex array
        Of the copies relative to the direct signal, with all of their phase; smaller than 1 together.
    spacing_chips : (N,) array
        Early to late, up to 1 [chips].
    boc : (N,) bool array
        BOC(1,1) rather than BPSK.

    Source: Braasch (1996).

    Notes
    -----
    The balance is within half the spacing of the direct signal as long as the copies' amplitudes add to less than 0.7:
    beyond, the direct signal's correlators differ by more than all copies' can. It is looked for within the whole
    spacing, a fixed number of steps: what comes out of one place does not depend on the others.
    """
    half = 0.5 * np.asarray(spacing_chips, dtype=np.float64)
    is_boc = np.broadcast_to(np.asarray(boc, dtype=bool), delay_chips.shape[1:])
    real, imaginary = np.ascontiguousarray(amplitude.real), np.ascontiguousarray(amplitude.imag)

    ends = np.stack([half, -half]) if half.ndim else np.array([[half], [-half]])

    def parts(place: FloatArray) -> tuple[FloatArray, FloatArray]:
        copies = _correlation(place[..., np.newaxis, :] - delay_chips, is_boc)
        in_phase = _correlation(place, is_boc) + (real * copies).sum(axis=-2)
        return in_phase, (imaginary * copies).sum(axis=-2)

    def late_excess(place: FloatArray) -> FloatArray:
        in_phase, quadrature = parts(place + ends)
        power = in_phase**2 + quadrature**2
        return np.asarray(power[0] - power[1])

    bound = np.broadcast_to(np.where(is_boc, np.minimum(2.0 * half, 0.3), np.minimum(2.0 * half, 0.9)), is_boc.shape)
    code = _root(late_excess, -bound, bound)
    prompt_i, prompt_q = parts(code)
    power = np.maximum(prompt_i**2 + prompt_q**2, 1e-12)
    return LoopErrors(code_chips=code, phase_rad=np.arctan2(prompt_q, prompt_i), power_db=10.0 * np.log10(power))


def _root(function: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray) -> FloatArray:
    """Where a function that is positive before and negative after is 0: halving, then false position (Illinois)."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        left = function(middle) > 0.0
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    at_low, at_high, side = function(low), function(high), np.zeros(low.shape)
    for _ in range(_STEPS):
        safe = (at_low >= 0.0) & (at_high <= 0.0) & (at_low > at_high)
        share = np.where(safe, at_low / np.where(safe, at_low - at_high, 1.0), 0.5)
        middle = low + (high - low) * share
        value = function(middle)
        left = value > 0.0
        low, high = np.where(left, middle, low), np.where(left, high, middle)
        # An end that stays twice counts half from then on.
        at_high = np.where(left, np.where(side > 0.0, 0.5 * at_high, at_high), value)
        at_low = np.where(left, value, np.where(side < 0.0, 0.5 * at_low, at_low))
        side = np.where(left, 1.0, -1.0)
    return middle


def _correlation(lag_chips: FloatArray, boc: NDArray[np.bool_]) -> FloatArray:
    """Autocorrelation of BPSK or BOC(1,1) with unlimited bandwidth."""
    lag = np.abs(lag_chips)
    triangle = np.maximum(1.0 - lag, 0.0)
    if not boc.any():
        return triangle
    return np.where(boc, np.where(lag <= 0.5, 1.0 - 3.0 * lag, -triangle), triangle)
