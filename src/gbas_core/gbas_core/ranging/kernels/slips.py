# mypy: disable-error-code="no-untyped-call"
"""The slip tests of :mod:`gbas_core.ranging.slips`, compiled. Missing is NaN, and no comparison with it holds."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.signals import L1, L2, L5, SPEED_OF_LIGHT_MPS, WAVELENGTH_M

LOCK, GAP, CODE, DOPPLER, RATE, GEOMETRY_FREE, FROZEN = 1, 2, 4, 8, 16, 32, 64

# Uncertain, ours: a smaller common step is put down to the noise of the clock (0.5 microseconds).
CLOCK_STEP_M: Final = 150.0
_MILLISECOND_M: Final = SPEED_OF_LIGHT_MPS * 1e-3
# Codes smoothed by the receiver repeat by chance while the range stands still, but not beyond their noise.
_FROZEN_CODE_M: Final = 1.0
_WHOLE_MILLISECONDS_M: Final = 15.0  # a code step this close to whole milliseconds is one


class SlipThresholds(NamedTuple):
    """Thresholds of all tests at one interval between epochs [m]; `max_gap_s` [s]."""

    code_m: float
    doppler_m: float
    rate_m: float
    range_m: float
    geometry_free_m: float
    geometry_free_new_m: float
    """Where there is no last change to compare with."""
    max_gap_s: float
    min_satellites: int
    follow_code_steps: bool


@compiled
def common_m(residual_m, min_satellites, values):  # type: ignore[no-untyped-def]
    """Median over bands and satellites of one receiver, 0 if there are too few satellites; whether there are enough.

    ``residual_m`` (bands, N); ``values`` is room for all of them.
    """
    n = satellites = 0
    for s in range(residual_m.shape[1]):
        before = n
        for b in range(residual_m.shape[0]):
            if np.isfinite(residual_m[b, s]):
                values[n] = residual_m[b, s]
                n += 1
        if n > before:
            satellites += 1
    if satellites < max(min_satellites, 1):
        return 0.0, False
    return np.median(values[:n]), True


@compiled
def clock_step_m(code_m, predicted_mps, doppler_mps, dt_s, min_satellites, surprise_m, values):  # type: ignore[no-untyped-def]
    """Common step of the codes of one receiver, 0 if there was none [m]; ``surprise_m`` is room, (bands, N)."""
    stepped = False
    for b in range(code_m.shape[0]):
        for s in range(code_m.shape[1]):
            rate = predicted_mps[b, s] if np.isfinite(predicted_mps[b, s]) else doppler_mps[b, s]
            surprise_m[b, s] = code_m[b, s] - rate * dt_s
            stepped = stepped or abs(surprise_m[b, s]) > CLOCK_STEP_M
    if not stepped:  # then their median is none either
        return 0.0
    step_m, _ = common_m(surprise_m, min_satellites, values)
    return step_m if abs(step_m) > CLOCK_STEP_M else 0.0


@compiled
def step_to_follow_m(code_m, carrier_m, min_satellites, apart_m, values):  # type: ignore[no-untyped-def]
    """Step of whole milliseconds that the codes of one receiver made and the carriers did not [m]."""
    for b in range(code_m.shape[0]):
        for s in range(code_m.shape[1]):
            apart_m[b, s] = code_m[b, s] - carrier_m[b, s]
    step_m, enough = common_m(apart_m, min_satellites, values)
    whole_m = np.round(step_m / _MILLISECOND_M) * _MILLISECOND_M
    return whole_m if enough and abs(step_m - whole_m) < _WHOLE_MILLISECONDS_M else 0.0


@compiled
def pair_jump(carrier_m, rate_mps, other, s, dt_s, limits):  # type: ignore[no-untyped-def]
    """Whether the carrier of L1 less that of another band jumped, and whether it could be tested."""
    change_m = carrier_m[L1, s] - carrier_m[other, s]
    surprise_m = change_m - (rate_mps[L1, s] - rate_mps[other, s]) * dt_s
    if np.isfinite(surprise_m):
        return abs(surprise_m) > limits.geometry_free_m, np.isfinite(change_m)
    return abs(change_m) > limits.geometry_free_new_m, np.isfinite(change_m)


@compiled
def geometry_free(carrier_m, rate_mps, consistent, s, dt_s, limits, cause):  # type: ignore[no-untyped-def]
    """Flag the bands that take part in a jump of a geometry-free difference of one satellite.

    A jump between L1 and L2 is put down to L2 alone where L1 agrees with L5 and passed a test of its own: codeless
    tracking of L2 slips often, and L1 is what the corrections are made of.
    """
    jumped15, tested15 = pair_jump(carrier_m, rate_mps, L5, s, dt_s, limits)
    jumped12, _ = pair_jump(carrier_m, rate_mps, L2, s, dt_s, limits)
    cleared = tested15 and not jumped15 and consistent
    if jumped15 or (jumped12 and not cleared):
        cause[L1, s] |= GEOMETRY_FREE
    if jumped12:
        cause[L2, s] |= GEOMETRY_FREE
    if jumped15:
        cause[L5, s] |= GEOMETRY_FREE


@compiled
def tests(change, before_mps, dt_s, true_dt_s, limits, residual, values, cause):  # type: ignore[no-untyped-def]
    """Flag what departs from the past of one receiver; returns the step of its clock as the carriers show it [m].

    ``change`` (5, bands, N): of carrier, code and known range [m], rate by the Dopplers and by history [m/s].
    """
    carrier_m, code_m, range_m, doppler_mps, predicted_mps = change[0], change[1], change[2], change[3], change[4]
    n_bands, n_sats = carrier_m.shape
    for b in range(n_bands):
        for s in range(n_sats):
            residual[0, b, s] = carrier_m[b, s] - doppler_mps[b, s] * true_dt_s
            residual[1, b, s] = carrier_m[b, s] - predicted_mps[b, s] * true_dt_s
            residual[2, b, s] = carrier_m[b, s] - range_m[b, s]
    beside_m, _ = common_m(residual[0], limits.min_satellites, values)
    ahead_m, enough_ahead = common_m(residual[1], limits.min_satellites, values)
    off_m, enough_off = common_m(residual[2], limits.min_satellites, values)
    for s in range(n_sats):
        consistent = False
        for b in range(n_bands):
            beside, ahead, off = residual[0, b, s], residual[1, b, s], residual[2, b, s]
            doppler = abs(beside - beside_m) > limits.doppler_m
            rate = enough_ahead and abs(ahead - ahead_m) > limits.rate_m
            rate = rate or (enough_off and abs(off - off_m) > limits.range_m)
            if abs(carrier_m[b, s] - code_m[b, s]) > limits.code_m:
                cause[b, s] |= CODE
            if doppler:
                cause[b, s] |= DOPPLER
            if rate:
                cause[b, s] |= RATE
            if b == L1:
                tested = np.isfinite(beside) or (enough_ahead and np.isfinite(ahead))
                tested = tested or (enough_off and np.isfinite(off))
                consistent = tested and not doppler and not rate
        geometry_free(carrier_m, before_mps, consistent, s, dt_s, limits, cause)
    step_m = ahead_m if enough_ahead else beside_m
    return step_m if abs(step_m) > CLOCK_STEP_M else 0.0


@compiled
def find_slips(  # type: ignore[no-untyped-def]
    code_m, carrier_m, doppler_hz, lli, range_m, before_code_m, before_carrier_m, before_doppler_hz, before_mps,
    before_mps2, before_range_m, before_followed_m, before_dt_s, dt_s, limits,
):  # fmt: skip
    """Causes and slips ``(R, bands, N)``; carriers, rates and accelerations ``(3, R, bands, N)``; followed steps and
    clock steps ``(2, R)``.

    Observations ``(R, bands, N)``, ranges ``(R, 1, N)`` and what was remembered of the epoch before, see
    :class:`gbas_core.ranging.slips.SlipState`.
    """
    shape = code_m.shape
    n_receivers, n_bands, n_sats = shape
    cause, slipped = np.zeros(shape, np.uint8), np.zeros(shape, np.bool_)
    moving, steps_m = np.full((3, *shape), np.nan), np.zeros((2, n_receivers))
    continued_m, rate_mps, rate_mps2 = moving[0], moving[1], moving[2]
    followed_m, step_m = steps_m[0], steps_m[1]
    followed_m[:] = before_followed_m
    change, residual, values = np.empty((5, *shape[1:])), np.empty((3, *shape[1:])), np.empty(n_bands * n_sats)
    compared, mean_s = 0.0 < dt_s <= limits.max_gap_s, 0.5 * (dt_s + before_dt_s)
    for r in range(n_receivers):
        for b in range(n_bands):
            for s in range(n_sats):
                continued_m[r, b, s] = carrier_m[r, b, s] + before_followed_m[r]
                change[0, b, s] = continued_m[r, b, s] - before_carrier_m[r, b, s]
                change[1, b, s] = code_m[r, b, s] - before_code_m[r, b, s]
                change[2, b, s] = range_m[r, 0, s] - before_range_m[r, 0, s]
                change[3, b, s] = -0.5 * WAVELENGTH_M[b] * (doppler_hz[r, b, s] + before_doppler_hz[r, b, s])
                change[4, b, s] = before_mps[r, b, s] + before_mps2[r, b, s] * mean_s
        true_dt_s, carriers_step_m = dt_s, 0.0
        if compared:
            step_m[r] = clock_step_m(change[1], change[4], change[3], dt_s, limits.min_satellites, residual[0], values)
            # a clock that steps forward reads a given time earlier: the interval is shorter by the step
            true_dt_s = dt_s - step_m[r] / SPEED_OF_LIGHT_MPS
            if limits.follow_code_steps and step_m[r] != 0.0:
                follow_m = step_to_follow_m(change[1], change[0], limits.min_satellites, residual[0], values)
                followed_m[r] += follow_m
                continued_m[r] += follow_m
                change[0] = continued_m[r] - before_carrier_m[r]
            carriers_step_m = tests(change, before_mps[r], dt_s, true_dt_s, limits, residual, values, cause[r])
        for b in range(n_bands):
            for s in range(n_sats):
                if np.isfinite(lli[r, b, s]) and int(lli[r, b, s]) & 1 == 1:
                    cause[r, b, s] |= LOCK
                moved_m = abs(change[0, b, s])
                if not compared:
                    cause[r, b, s] |= GAP if np.isfinite(moved_m) else 0
                elif moved_m == 0.0 or (code_m[r, b, s] == before_code_m[r, b, s] and moved_m > _FROZEN_CODE_M):
                    cause[r, b, s] |= FROZEN
                slipped[r, b, s] = cause[r, b, s] != 0
                if compared and not slipped[r, b, s]:
                    rate_mps[r, b, s] = (change[0, b, s] - carriers_step_m) / true_dt_s
                rate_mps2[r, b, s] = (rate_mps[r, b, s] - before_mps[r, b, s]) / mean_s
    return cause, slipped, moving, steps_m
