"""Cycle slips and code jumps: where a carrier-smoothed range must start anew.

Every test compares one epoch with what the epochs before it predict, so a satellite's first epoch is never flagged (its
filter starts anyway). The tests:

- **lock**: the receiver's loss-of-lock indicator, bit 0.
- **gap**: the time since the last epoch is missing, not positive, or too long for a prediction.
- **code**: carrier change against code change, a coarse net for large slips and for jumps of the code alone.
- **Doppler**: carrier change against the integrated Doppler (trapezoid).
- **rate**: carrier change against its own extrapolation, or against the change of the geometric range where the caller
  knows it.
- **geometry-free**: change of the difference of two carriers, L1-L5 and, where there is no L5, L1-L2.

The Doppler and rate tests first remove what all satellites of a receiver have in common: its clock. A step of the clock
that moves code and carrier together (some receivers step by a millisecond) is therefore no slip; a step of the code
alone is caught by the code test on every satellite, as it must be.

Arrays are (R, N_BANDS, N_SATS). Source: Annex 10 leaves slip detection to the manufacturer; the tests are the usual
ones (Kaplan and Hegarty, Understanding GPS/GNSS, 3rd ed., ch. 12; Blewitt, GRL 17(3), 1990 for the geometry-free one).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.record import FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1, L2, L5, N_BANDS, WAVELENGTH_M

BoolArray = NDArray[np.bool_]
_LAMBDA_M: Final = WAVELENGTH_M[:, np.newaxis]

# Uncertain, ours: a smaller common step is put down to the clock's noise and not reported (0.5 microseconds).
CLOCK_STEP_M: Final = 150.0


class SlipCause(IntFlag):
    """Why a measurement was flagged."""

    LOCK = 1
    GAP = 2
    CODE = 4
    DOPPLER = 8
    RATE = 16
    GEOMETRY_FREE = 32


@dataclass(frozen=True, kw_only=True)
class SlipParams:
    """Thresholds of the slip tests. They grow with the interval T between epochs; all are ours, set on recorded data.

    Attributes
    ----------
    max_gap_s : float
        A longer interval flags everything [s].
    code_base_m, code_rate_mps : float
        Code test, ``base + rate T``: noise and multipath of two codes, divergence by the ionosphere [m, m/s].
    doppler_base_m, doppler_noise_mps : float
        Doppler test, ``base + noise T + jerk T^3 / 12``: noise of two carriers, of the mean Doppler [m, m/s].
    rate_base_m : float
        Rate test by extrapolation, ``base + jerk T^3``: noise of four carriers [m].
    range_rate_mps : float
        Rate test with known ranges, ``base + rate T``: atmosphere, orbit and satellite clock [m/s].
    satellite_jerk_mps3 : float
        Change of a range acceleration by satellite motion, static receiver [m/s^3].
    receiver_jerk_mps3 : float
        Jerk of the receiver; 0 on the ground [m/s^3].
    geometry_free_base_m, geometry_free_rate_mps, geometry_free_acceleration_mps2 : float
        Geometry-free test, ``base + acceleration T^2`` against the last change, or ``base + rate T`` where there is
        none: noise, rate of the ionosphere in a storm, change of that rate [m, m/s, m/s^2].
    min_satellites : int
        Satellites needed to tell the receiver's clock from slips; with fewer the rate test is not made.
    """

    max_gap_s: float = 35.0
    code_base_m: float = 10.0
    code_rate_mps: float = 0.3
    doppler_base_m: float = 0.05
    doppler_noise_mps: float = 0.05
    rate_base_m: float = 0.07
    range_rate_mps: float = 0.05
    satellite_jerk_mps3: float = 1e-4
    receiver_jerk_mps3: float = 0.0
    geometry_free_base_m: float = 0.05
    geometry_free_rate_mps: float = 0.07
    geometry_free_acceleration_mps2: float = 1e-3
    min_satellites: int = 3

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"slips: {name} is {value}, it must be finite and not negative")


# Known: jerk of DO-229 normal manoeuvres, 0.25 g/s.
NORMAL_MANOEUVRE_JERK_MPS3: Final = 0.25 * 9.80665


@dataclass(frozen=True, kw_only=True, eq=False)
class SlipState:
    """What the tests remember of the last epoch; arrays are never changed in place.

    Attributes
    ----------
    code_m, carrier_m, doppler_hz : (R, N_BANDS, N_SATS) arrays
        Observations of the last epoch.
    rate_mps, acceleration_mps2 : (R, N_BANDS, N_SATS) arrays
        Carrier rate over the last interval and its change since the one before, up to a term all satellites share.
    range_m : (R, 1, N_SATS) array
        Known ranges of the last epoch [m].
    dt_s : float
        Length of the last interval [s].
    """

    code_m: FloatArray
    carrier_m: FloatArray
    doppler_hz: FloatArray
    rate_mps: FloatArray
    acceleration_mps2: FloatArray
    range_m: FloatArray
    dt_s: float


@dataclass(frozen=True, kw_only=True, eq=False)
class SlipResult:
    """What was found.

    Attributes
    ----------
    slipped : (R, N_BANDS, N_SATS) bool array
        Where a smoothing filter must restart.
    cause : (R, N_BANDS, N_SATS) uint8 array
        :class:`SlipCause`, 0 where nothing was found.
    clock_step_m : (R,) array
        Step of all carriers of a receiver that was taken for its clock, 0 if there was none [m].
    """

    slipped: BoolArray
    cause: NDArray[np.uint8]
    clock_step_m: FloatArray


def initial_slips(n_receivers: int = 1) -> SlipState:
    """State that has seen nothing."""
    nothing = np.full((n_receivers, N_BANDS, N_SATS), np.nan)
    return SlipState(
        code_m=nothing,
        carrier_m=nothing,
        doppler_hz=nothing,
        rate_mps=nothing,
        acceleration_mps2=nothing,
        range_m=nothing[:, :1],
        dt_s=float("nan"),
    )


def slip_step(
    state: SlipState,
    code_m: FloatArray,
    carrier_m: FloatArray,
    doppler_hz: FloatArray,
    lli: FloatArray,
    dt_s: float,
    params: SlipParams,
    *,
    range_m: FloatArray | None = None,
) -> tuple[SlipState, SlipResult]:
    """Test one epoch of several receivers.

    Parameters
    ----------
    state : SlipState
        From :func:`initial_slips` or the previous step.
    code_m, carrier_m, doppler_hz, lli : (R, N_BANDS, N_SATS) arrays
        As in :class:`gbas_core.observations.ObservationEpoch`; missing is NaN.
    dt_s : float
        Time since the last epoch [s]; NaN for the first.
    params : SlipParams
    range_m : (R, N_SATS) array, optional
        Geometric range minus satellite clock, where the receiver's position is known [m]; the rate test then needs no
        history and stays sharp at long intervals. NaN for satellites without an ephemeris.

    Returns
    -------
    state : SlipState
    result : SlipResult
    """
    known_m = np.full((len(code_m), 1, code_m.shape[-1]), np.nan) if range_m is None else range_m[:, np.newaxis, :]
    cause = _lock_lost(lli)
    change_m = carrier_m - state.carrier_m
    if not 0.0 < dt_s <= params.max_gap_s:
        cause |= _flag(np.isfinite(change_m), SlipCause.GAP)
        rate_mps, step_m = np.full_like(carrier_m, np.nan), np.zeros(len(code_m))
    else:
        tests, step_m = _tests(state, change_m, code_m, doppler_hz, known_m, dt_s, params)
        cause |= tests
        rate_mps = np.where(cause == 0, (change_m - step_m[:, np.newaxis, np.newaxis]) / dt_s, np.nan)
    new = SlipState(
        code_m=code_m,
        carrier_m=carrier_m,
        doppler_hz=doppler_hz,
        rate_mps=rate_mps,
        acceleration_mps2=(rate_mps - state.rate_mps) / (0.5 * (dt_s + state.dt_s)),
        range_m=known_m,
        dt_s=dt_s,
    )
    clock_step_m = np.where(np.abs(step_m) > CLOCK_STEP_M, step_m, 0.0)
    return new, SlipResult(slipped=cause != 0, cause=cause, clock_step_m=clock_step_m)


def _lock_lost(lli: FloatArray) -> NDArray[np.uint8]:
    """Bit 0 of the indicator as a cause."""
    bits = np.where(np.isfinite(lli), lli, 0.0).astype(np.int64)
    return _flag(bits & 1 == 1, SlipCause.LOCK)


def _flag(found: BoolArray, cause: SlipCause) -> NDArray[np.uint8]:
    return found.astype(np.uint8) * np.uint8(cause)


def _tests(
    state: SlipState,
    change_m: FloatArray,
    code_m: FloatArray,
    doppler_hz: FloatArray,
    known_m: FloatArray,
    dt_s: float,
    params: SlipParams,
) -> tuple[NDArray[np.uint8], FloatArray]:
    """Causes found by comparison with the past, and the common step (R,) of the carriers [m]."""
    jerk_mps3 = params.satellite_jerk_mps3 + params.receiver_jerk_mps3
    code = np.abs(change_m - (code_m - state.code_m)) > params.code_base_m + params.code_rate_mps * dt_s

    doppler_m = change_m + 0.5 * dt_s * _LAMBDA_M * (doppler_hz + state.doppler_hz)
    doppler_common_m, _ = _common(doppler_m, params.min_satellites)
    doppler_limit_m = params.doppler_base_m + params.doppler_noise_mps * dt_s + jerk_mps3 * dt_s**3 / 12.0
    doppler = np.abs(doppler_m - doppler_common_m) > doppler_limit_m

    predicted_mps = state.rate_mps + state.acceleration_mps2 * (0.5 * (dt_s + state.dt_s))
    ahead_m = change_m - predicted_mps * dt_s
    ahead_common_m, enough = _common(ahead_m, params.min_satellites)
    rate = enough & (np.abs(ahead_m - ahead_common_m) > params.rate_base_m + jerk_mps3 * dt_s**3)

    range_m = change_m - (known_m - state.range_m)
    range_common_m, enough_range = _common(range_m, params.min_satellites)
    range_limit_m = params.rate_base_m + params.range_rate_mps * dt_s
    rate |= enough_range & (np.abs(range_m - range_common_m) > range_limit_m)

    followed = np.isfinite(doppler_m) | (enough & np.isfinite(ahead_m)) | (enough_range & np.isfinite(range_m))
    geometry_free = _geometry_free(state, change_m, followed & ~doppler & ~rate, dt_s, params)
    cause = _flag(code, SlipCause.CODE) | _flag(doppler, SlipCause.DOPPLER)
    cause |= _flag(rate, SlipCause.RATE) | _flag(geometry_free, SlipCause.GEOMETRY_FREE)
    step_m = np.where(enough, ahead_common_m, doppler_common_m)
    return cause, step_m[:, 0, 0]


def _common(residual_m: FloatArray, min_satellites: int) -> tuple[FloatArray, BoolArray]:
    """Median over satellites and bands (R, 1, 1), 0 if there are too few satellites, and whether there are enough."""
    present = np.isfinite(residual_m)
    enough = np.count_nonzero(present.any(axis=1), axis=-1) >= max(min_satellites, 1)
    ordered = np.sort(np.where(present, residual_m, np.inf).reshape(len(residual_m), -1), axis=-1)
    number = np.count_nonzero(present, axis=(1, 2))
    rows = np.arange(len(ordered))
    low, high = np.maximum(number - 1, 0) // 2, np.minimum(number // 2, ordered.shape[-1] - 1)
    median = np.where(enough, 0.5 * (ordered[rows, low] + ordered[rows, high]), 0.0)
    return median[:, np.newaxis, np.newaxis], enough[:, np.newaxis, np.newaxis]


def _geometry_free(
    state: SlipState, change_m: FloatArray, consistent: BoolArray, dt_s: float, params: SlipParams
) -> BoolArray:
    """Bands taking part in a jump of a geometry-free difference, (R, N_BANDS, N_SATS).

    A jump between L1 and L2 is put down to L2 alone where L1 agrees with L5 and passed a test of its own: codeless
    tracking of L2 slips often, and L1 is what the corrections are made of.
    """
    jumped15, tested15 = _pair_jump(state, change_m, L1, L5, dt_s, params)
    jumped12, _ = _pair_jump(state, change_m, L1, L2, dt_s, params)
    cleared = tested15 & ~jumped15 & consistent[:, L1]
    found = np.zeros(change_m.shape, dtype=bool)
    found[:, L1] = jumped15 | (jumped12 & ~cleared)
    found[:, L5] = jumped15
    found[:, L2] = jumped12
    return found


def _pair_jump(
    state: SlipState, change_m: FloatArray, band: int, other: int, dt_s: float, params: SlipParams
) -> tuple[BoolArray, BoolArray]:
    """Where the difference of two carriers jumped, and where it could be tested, both (R, N_SATS)."""
    change = change_m[:, band] - change_m[:, other]
    surprise = change - (state.rate_mps[:, band] - state.rate_mps[:, other]) * dt_s
    followed = np.isfinite(surprise)
    limit_m = np.where(
        followed,
        params.geometry_free_base_m + params.geometry_free_acceleration_mps2 * dt_s**2,
        params.geometry_free_base_m + params.geometry_free_rate_mps * dt_s,
    )
    return np.abs(np.where(followed, surprise, change)) > limit_m, np.isfinite(change)
