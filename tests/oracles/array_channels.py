"""Slip tests and smoothing of :mod:`gbas_core.ranging` as array expressions: what the compiled loops must agree with.

Nothing of the suite is imported; parameters and states are anything with the same attributes.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

L1, L2, L5 = 0, 1, 2
SPEED_OF_LIGHT_MPS = 299_792_458.0
LAMBDA_M = SPEED_OF_LIGHT_MPS / (np.array([154.0, 120.0, 115.0]) * 10.23e6)[:, np.newaxis]
LOCK, GAP, CODE, DOPPLER, RATE, GEOMETRY_FREE, FROZEN = (1 << bit for bit in range(7))
CLOCK_STEP_M = 150.0
MILLISECOND_M = SPEED_OF_LIGHT_MPS * 1e-3


class _Epoch(NamedTuple):
    """Changes since the last epoch."""

    carrier_m: np.ndarray  # (R, N_BANDS, N_SATS)
    code_m: np.ndarray
    doppler_mps: np.ndarray  # mean rate over the interval from the Dopplers
    range_m: np.ndarray  # (R, 1, N_SATS)
    predicted_mps: np.ndarray  # carrier rate extrapolated to this interval
    dt_s: np.ndarray  # (R, 1, 1) true interval between the samples


def slip_step(state, observed, dt_s, params):
    """Test one epoch of several receivers."""
    observed = observed._replace(carrier_m=observed.carrier_m + state.followed_m[:, np.newaxis, np.newaxis])
    cause, followed_m, clock_step_m = _lock_lost(observed.lli), state.followed_m, np.zeros(len(observed.code_m))
    if 0.0 < dt_s <= params.max_gap_s:
        epoch = _changes(state, observed, dt_s)
        epoch, clock_step_m = _clock_step(epoch, params)
        if params.follow_code_steps and clock_step_m.any():
            step_m = _steps_to_follow(epoch, clock_step_m, params)
            followed_m = followed_m + step_m
            observed = observed._replace(carrier_m=observed.carrier_m + step_m[:, np.newaxis, np.newaxis])
            epoch = epoch._replace(carrier_m=observed.carrier_m - state.carrier_m)
        found, rate_mps = _tests(epoch, state, dt_s, params)
        cause |= found | _frozen(state, observed.code_m, observed.carrier_m)
        rate_mps = np.where(cause == 0, rate_mps, np.nan)
    else:
        cause |= _flag(np.isfinite(observed.carrier_m - state.carrier_m), GAP)
        rate_mps = np.full_like(observed.carrier_m, np.nan)
    new = SimpleNamespace(
        code_m=observed.code_m,
        carrier_m=observed.carrier_m,
        doppler_hz=observed.doppler_hz,
        rate_mps=rate_mps,
        acceleration_mps2=(rate_mps - state.rate_mps) / (0.5 * (dt_s + state.dt_s)),
        range_m=observed.known_m,
        followed_m=followed_m,
        dt_s=dt_s,
    )
    result = SimpleNamespace(slipped=cause != 0, cause=cause, clock_step_m=clock_step_m, carrier_m=observed.carrier_m)
    return new, result


def _lock_lost(lli):
    """Bit 0 of the indicator as a cause."""
    bits = np.where(np.isfinite(lli), lli, 0.0).astype(np.int64)
    return _flag(bits & 1 == 1, LOCK)


def _frozen(state, code_m, carrier_m):
    """Repeated measurements; a static receiver may meet one by chance for an instant, when a range turns round."""
    moved = np.abs(carrier_m - state.carrier_m) > 1.0
    return _flag((carrier_m == state.carrier_m) | ((code_m == state.code_m) & moved), FROZEN)


def _flag(found, cause):
    return found.astype(np.uint8) * np.uint8(cause)


def _changes(state, observed, dt_s):
    return _Epoch(
        carrier_m=observed.carrier_m - state.carrier_m,
        code_m=observed.code_m - state.code_m,
        doppler_mps=-0.5 * LAMBDA_M * (observed.doppler_hz + state.doppler_hz),
        range_m=observed.known_m - state.range_m,
        predicted_mps=state.rate_mps + state.acceleration_mps2 * (0.5 * (dt_s + state.dt_s)),
        dt_s=np.full((len(observed.code_m), 1, 1), dt_s),
    )


def _clock_step(epoch, params):
    """Common step of the codes (R,) [m], and the epoch with the true interval between the samples.

    A clock that steps forward reads a given time earlier: the interval is shorter by the step.
    """
    rate_mps = np.where(np.isfinite(epoch.predicted_mps), epoch.predicted_mps, epoch.doppler_mps)
    surprise_m = epoch.code_m - rate_mps * epoch.dt_s
    if not (np.abs(surprise_m) > CLOCK_STEP_M).any():  # then their median is none either
        return epoch, np.zeros(len(surprise_m))
    common_m, _ = _common(surprise_m, params.min_satellites)
    step_m = np.where(np.abs(common_m) > CLOCK_STEP_M, common_m, 0.0)
    return epoch._replace(dt_s=epoch.dt_s - step_m / SPEED_OF_LIGHT_MPS), step_m[:, 0, 0]


def _steps_to_follow(epoch, clock_step_m, params):
    """Steps (R,) of whole milliseconds that the codes made and the carriers did not [m]."""
    apart_m, enough = _common(epoch.code_m - epoch.carrier_m, params.min_satellites)
    whole_m = np.round(apart_m / MILLISECOND_M) * MILLISECOND_M
    whole = enough & (np.abs(apart_m - whole_m) < 15.0)
    return np.where(whole[:, 0, 0] & (clock_step_m != 0.0), whole_m[:, 0, 0], 0.0)


def _tests(epoch, state, dt_s, params):
    """Causes found by comparison with the past, and carrier rates [m/s] for the epochs to come."""
    code = np.abs(epoch.carrier_m - epoch.code_m) > params.code_base_m + params.code_rate_mps * dt_s

    beside_m = epoch.carrier_m - epoch.doppler_mps * epoch.dt_s
    ahead_m = epoch.carrier_m - epoch.predicted_mps * epoch.dt_s
    off_m = epoch.carrier_m - epoch.range_m
    common_m, enough = _common(np.concatenate([beside_m, ahead_m, off_m]), params.min_satellites)
    beside_common_m, ahead_common_m, off_common_m = np.split(common_m, 3)
    _, enough_ahead, enough_off = np.split(enough, 3)

    still_m = params.doppler_base_m + params.doppler_noise_mps * dt_s
    doppler = _apart(beside_m - beside_common_m, still_m, dt_s**3 / 12.0, params)

    rate = enough_ahead & _apart(ahead_m - ahead_common_m, params.rate_base_m, dt_s**3, params)

    rate |= enough_off & (np.abs(off_m - off_common_m) > params.rate_base_m + params.range_rate_mps * dt_s)

    tested = np.isfinite(beside_m) | (enough_ahead & np.isfinite(ahead_m)) | (enough_off & np.isfinite(off_m))
    jumped = _geometry_free(epoch, state, tested & ~doppler & ~rate, dt_s, params)
    cause = _flag(code, CODE) | _flag(doppler, DOPPLER)
    cause |= _flag(rate, RATE) | _flag(jumped, GEOMETRY_FREE)
    step_m = np.where(enough_ahead, ahead_common_m, beside_common_m)
    step_m = np.where(np.abs(step_m) > CLOCK_STEP_M, step_m, 0.0)
    return cause, (epoch.carrier_m - step_m) / epoch.dt_s


def _apart(surprise_m, base_m, per_jerk_s3, params):
    """Where a carrier left its prediction by more than noise and motion explain, (R, N_BANDS, N_SATS).

    `per_jerk_s3` is how a jerk shows in the surprise.
    """
    still_m = base_m + params.satellite_jerk_mps3 * per_jerk_s3
    return np.asarray(np.abs(surprise_m) > still_m + 2.0 * params.receiver_jerk_mps3 * per_jerk_s3)


def _common(residual_m, min_satellites):
    """Median over satellites and bands (R, 1, 1), 0 if there are too few satellites, and whether there are enough."""
    present = np.isfinite(residual_m)
    enough = present.any(axis=1).sum(axis=-1) >= max(min_satellites, 1)
    ordered = np.sort(residual_m.reshape(len(residual_m), -1), axis=-1)  # NaN last
    number = present.reshape(ordered.shape).sum(axis=-1)
    rows = np.arange(len(ordered))
    low, high = np.maximum(number - 1, 0) // 2, np.minimum(number // 2, ordered.shape[-1] - 1)
    median = np.where(enough, 0.5 * (ordered[rows, low] + ordered[rows, high]), 0.0)
    return median[:, np.newaxis, np.newaxis], enough[:, np.newaxis, np.newaxis]


def _geometry_free(epoch, state, consistent, dt_s, params):
    """Bands taking part in a jump of a geometry-free difference, (R, N_BANDS, N_SATS).

    A jump between L1 and L2 is put down to L2 alone where L1 agrees with L5 and passed a test of its own: codeless
    tracking of L2 slips often, and L1 is what the corrections are made of.
    """
    jumped15, tested15 = _pair_jump(epoch, state, L5, dt_s, params)
    jumped12, _ = _pair_jump(epoch, state, L2, dt_s, params)
    cleared = tested15 & ~jumped15 & consistent[:, L1]
    found = np.zeros(consistent.shape, dtype=bool)
    found[:, L1] = jumped15 | (jumped12 & ~cleared)
    found[:, L2] = jumped12
    found[:, L5] = jumped15
    return found


def _pair_jump(epoch, state, other, dt_s, params):
    """Where the carrier of L1 minus that of another band jumped, and where it could be tested, both (R, N_SATS)."""
    change_m = epoch.carrier_m[:, L1] - epoch.carrier_m[:, other]
    surprise_m = change_m - (state.rate_mps[:, L1] - state.rate_mps[:, other]) * dt_s
    followed = np.isfinite(surprise_m)
    limit_m = np.where(
        followed,
        params.geometry_free_base_m + params.geometry_free_acceleration_mps2 * dt_s**2,
        params.geometry_free_base_m + params.geometry_free_rate_mps * dt_s,
    )
    return np.abs(np.where(followed, surprise_m, change_m)) > limit_m, np.isfinite(change_m)


def hatch_step(smoothed_m, code_m, delta_phase_m, weight):
    """Advance a carrier-smoothed code range by one epoch."""
    return weight * code_m + (1.0 - weight) * (smoothed_m + delta_phase_m)


def smooth_step(state, code_m, carrier_m, slipped, dt_s, params):
    """Advance every filter by one epoch.

    A filter restarts with the raw code where `slipped` says so and where it was empty; all restart when `dt_s` is not
    finite, not positive or above ``params.max_gap_s`` (so NaN does for the first epoch). A satellite without finite
    code and carrier is cleared and gives NaN: it restarts when it comes back."""
    present = np.isfinite(code_m + carrier_m)
    if 0.0 < dt_s <= params.max_gap_s:
        kept = present & (state.count > 0.0) & ~slipped
    else:
        kept, dt_s = np.zeros_like(present), 0.0
    count = np.where(kept, state.count + 1.0, present)
    elapsed_s = np.where(kept, state.elapsed_s + dt_s, np.where(present, 0.0, np.nan))
    weight = _weight(count, elapsed_s, dt_s, params)
    smoothed_m = hatch_step(state.smoothed_m, code_m, carrier_m - state.carrier_m, weight)
    smoothed_m = np.where(kept, smoothed_m, np.where(present, code_m, np.nan))
    carrier_m = np.where(present, carrier_m, np.nan)
    return SimpleNamespace(smoothed_m=smoothed_m, carrier_m=carrier_m, count=count, elapsed_s=elapsed_s), smoothed_m


def _weight(count, elapsed_s, dt_s, params):
    """Filter weight of every time constant, (n_tau, ..., N_SATS) or broadcastable to it, where a filter goes on."""
    tau_s = np.array(params.tau_s)
    # with a time constant of 0, or an interval above it, the filter is the raw code
    share = np.divide(dt_s, tau_s, out=np.ones(tau_s.shape), where=tau_s > dt_s)
    steady = share.reshape(-1, *(1,) * count.ndim)
    if params.start == "invariant":
        return steady
    if params.start == "variable":
        return np.maximum(1.0 / np.maximum(count, 1.0), steady)
    return np.maximum(dt_s / np.where(elapsed_s > 0.0, elapsed_s, np.inf), steady)
