"""Cycle slips and code jumps: where a carrier-smoothed range must start anew.

Every test compares one epoch with what the epochs before it predict, so a satellite's first epoch is never flagged (its
filter starts anyway). The tests:

- **lock**: the receiver's loss-of-lock indicator, bit 0.
- **gap**: the time since the last epoch is missing, not positive, or too long for a prediction.
- **code**: carrier change against code change, a coarse net for large slips and for jumps of the code alone.
- **Doppler**: carrier change against the integrated Doppler (trapezoid).
- **rate**: carrier change against its own extrapolation, and against the geometric range where the caller knows it.
- **geometry-free**: change of the difference of two carriers, L1-L5 and L1-L2.
- **frozen**: a carrier equal to the last one to the last bit, or such a code while the carrier moved on, was not
  measured anew.

The Doppler and rate tests first remove what all satellites of a receiver have in common: its clock and, for a moving
receiver whose lines of sight the caller knows, its motion. Receivers step their clock, mostly by whole milliseconds. A
step that moves code and carrier together is no slip. A step of the code alone is caught by the code test on every
satellite, unless the caller asks for the carriers to follow the code. Either way the receiver samples at another
instant than its time tag says from then on, and the predictions allow for that.

Arrays are (R, N_BANDS, N_SATS).

Source: the standards leave slip detection to the manufacturer; these tests are the usual ones (Kaplan and Hegarty,
Understanding GPS/GNSS, 3rd ed., ch. 12; Blewitt, GRL 17(3), 1990, for the geometry-free one).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1, L2, L5, N_BANDS, SPEED_OF_LIGHT_MPS, WAVELENGTH_M

CauseArray = NDArray[np.uint8]

# Known: jerk of DO-229 normal manoeuvres, 0.25 g/s.
NORMAL_MANOEUVRE_JERK_MPS3: Final = 0.25 * 9.80665
# Uncertain, ours: a smaller common step is put down to the noise of the clock (0.5 microseconds).
CLOCK_STEP_M: Final = 150.0

_LAMBDA_M: Final = WAVELENGTH_M[:, np.newaxis]
_MILLISECOND_M: Final = SPEED_OF_LIGHT_MPS * 1e-3
# Codes smoothed by the receiver repeat by chance while the range stands still, but not beyond their noise.
_FROZEN_CODE_M: Final = 1.0
_WHOLE_MILLISECONDS_M: Final = 15.0  # a code step this close to whole milliseconds is one


class SlipCause(IntFlag):
    """Why a measurement was flagged."""

    LOCK = 1
    GAP = 2
    CODE = 4
    DOPPLER = 8
    RATE = 16
    GEOMETRY_FREE = 32
    FROZEN = 64


@dataclass(frozen=True, kw_only=True)
class SlipParams:
    """Thresholds of the slip tests. They grow with the interval T between epochs.

    All are uncertain (ours): set so that quiet 1 Hz recordings of five geodetic receivers give next to no false alarm,
    and one cycle of L1 is found.

    Attributes
    ----------
    max_gap_s : float
        A longer interval flags everything [s].
    code_base_m, code_rate_mps : float
        Code test, ``base + rate T``: noise and multipath of two codes, divergence by the ionosphere [m, m/s].
    doppler_base_m, doppler_noise_mps : float
        Doppler test, ``base + noise T + (satellite jerk + 2 receiver jerk) T^3 / 12``: noise of two carriers, of the
        mean Doppler [m, m/s].
    rate_base_m : float
        Rate test by extrapolation, ``base + (satellite jerk + 2 receiver jerk) T^3``: noise of four carriers [m].
    range_rate_mps : float
        Rate test with known ranges, ``base + rate T``: atmosphere, orbit and satellite clock [m/s].
    satellite_jerk_mps3 : float
        Change of a range acceleration by satellite motion, static receiver [m/s^3].
    receiver_jerk_mps3 : float
        Jerk of the receiver; 0 on the ground, for an aircraft see :data:`NORMAL_MANOEUVRE_JERK_MPS3` [m/s^3]. It counts
        twice because satellites ahead and behind see it with opposite signs, and the median removed lies anywhere
        between.
    geometry_free_base_m, geometry_free_rate_mps, geometry_free_acceleration_mps2 : float
        Geometry-free test, ``base + acceleration T^2`` against the last change, or ``base + rate T`` where there is
        none: noise, rate of the ionosphere in a storm, change of that rate [m, m/s, m/s^2].
    min_satellites : int
        Satellites needed to tell the receiver's clock from slips; with fewer the rate test is not made.
    follow_code_steps : bool
        Let carriers follow a step of all codes by whole milliseconds, instead of flagging all satellites. Who sets it
        must smooth with ``SlipResult.carrier_m``.
    """

    max_gap_s: float = 35.0
    code_base_m: float = 10.0
    code_rate_mps: float = 0.3
    doppler_base_m: float = 0.05
    doppler_noise_mps: float = 0.10
    rate_base_m: float = 0.10
    range_rate_mps: float = 0.05
    satellite_jerk_mps3: float = 4e-5
    receiver_jerk_mps3: float = 0.0
    geometry_free_base_m: float = 0.06
    geometry_free_rate_mps: float = 0.07
    geometry_free_acceleration_mps2: float = 3e-4
    min_satellites: int = 3
    follow_code_steps: bool = False

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"slips: {name} is {value}, it must be finite and not negative")


@dataclass(frozen=True, kw_only=True, eq=False)
class SlipState:
    """What the tests remember of the last epoch; arrays are never changed in place.

    Attributes
    ----------
    code_m, carrier_m, doppler_hz : (R, N_BANDS, N_SATS) arrays
        Observations of the last epoch, the carriers continued over followed code steps.
    rate_mps, acceleration_mps2 : (R, N_BANDS, N_SATS) arrays
        Carrier rate over the last interval and its change since the one before, without clock steps.
    range_m : (R, 1, N_SATS) array
        Known ranges of the last epoch [m].
    followed_m : (R,) array
        Sum of the code steps the carriers followed [m].
    dt_s : float
        Length of the last interval [s].
    """

    code_m: FloatArray
    carrier_m: FloatArray
    doppler_hz: FloatArray
    rate_mps: FloatArray
    acceleration_mps2: FloatArray
    range_m: FloatArray
    followed_m: FloatArray
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
        Step of the receiver's clock as its codes show it, 0 if there was none [m].
    carrier_m : (R, N_BANDS, N_SATS) array
        The carriers, continued over the code steps they followed: the given ones unless ``follow_code_steps`` [m].
    """

    slipped: BoolArray
    cause: CauseArray
    clock_step_m: FloatArray
    carrier_m: FloatArray


class ChannelObservations(NamedTuple):
    """Observations of several receivers at one epoch.

    Attributes
    ----------
    code_m, carrier_m, doppler_hz, lli : (R, N_BANDS, N_SATS) arrays
        As in :class:`gbas_core.gnss.observations.ObservationEpoch`; missing is NaN.
    range_m : (R, N_SATS) array, optional
        Geometric range minus satellite clock, where the receiver's position is known [m]; the rate test then needs no
        history and stays sharp at long intervals. NaN for satellites without an ephemeris.
    """

    code_m: FloatArray
    carrier_m: FloatArray
    doppler_hz: FloatArray
    lli: FloatArray
    range_m: FloatArray | None = None

    @property
    def known_m(self) -> FloatArray:
        """Known ranges (R, 1, N_SATS) [m], NaN where there are none."""
        if self.range_m is None:
            return np.full((len(self.code_m), 1, N_SATS), np.nan)
        return self.range_m[:, np.newaxis, :]


class _Epoch(NamedTuple):
    """Changes since the last epoch."""

    carrier_m: FloatArray  # (R, N_BANDS, N_SATS)
    code_m: FloatArray
    doppler_mps: FloatArray  # mean rate over the interval from the Dopplers
    range_m: FloatArray  # (R, 1, N_SATS)
    predicted_mps: FloatArray  # carrier rate extrapolated to this interval
    dt_s: FloatArray  # (R, 1, 1) true interval between the samples


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
        followed_m=np.zeros(n_receivers),
        dt_s=float("nan"),
    )


def slip_step(
    state: SlipState, observed: ChannelObservations, dt_s: float, params: SlipParams
) -> tuple[SlipState, SlipResult]:
    """Test one epoch of several receivers.

    Parameters
    ----------
    state : SlipState
        From :func:`initial_slips` or the previous step.
    observed : ChannelObservations
    dt_s : float
        Time since the last epoch [s]; NaN for the first.
    params : SlipParams

    Returns
    -------
    state : SlipState
    result : SlipResult
    """
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
        cause |= _flag(np.isfinite(observed.carrier_m - state.carrier_m), SlipCause.GAP)
        rate_mps = np.full_like(observed.carrier_m, np.nan)
    new = SlipState(
        code_m=observed.code_m,
        carrier_m=observed.carrier_m,
        doppler_hz=observed.doppler_hz,
        rate_mps=rate_mps,
        acceleration_mps2=(rate_mps - state.rate_mps) / (0.5 * (dt_s + state.dt_s)),
        range_m=observed.known_m,
        followed_m=followed_m,
        dt_s=dt_s,
    )
    result = SlipResult(slipped=cause != 0, cause=cause, clock_step_m=clock_step_m, carrier_m=observed.carrier_m)
    return new, result


def _lock_lost(lli: FloatArray) -> CauseArray:
    """Bit 0 of the indicator as a cause."""
    bits = np.where(np.isfinite(lli), lli, 0.0).astype(np.int64)
    return _flag(bits & 1 == 1, SlipCause.LOCK)


def _frozen(state: SlipState, code_m: FloatArray, carrier_m: FloatArray) -> CauseArray:
    """Repeated measurements; a static receiver may meet one by chance for an instant, when a range turns round."""
    moved = np.abs(carrier_m - state.carrier_m) > _FROZEN_CODE_M
    return _flag((carrier_m == state.carrier_m) | ((code_m == state.code_m) & moved), SlipCause.FROZEN)


def _flag(found: BoolArray, cause: SlipCause) -> CauseArray:
    return found.astype(np.uint8) * np.uint8(cause)


def _changes(state: SlipState, observed: ChannelObservations, dt_s: float) -> _Epoch:
    return _Epoch(
        carrier_m=observed.carrier_m - state.carrier_m,
        code_m=observed.code_m - state.code_m,
        doppler_mps=-0.5 * _LAMBDA_M * (observed.doppler_hz + state.doppler_hz),
        range_m=observed.known_m - state.range_m,
        predicted_mps=state.rate_mps + state.acceleration_mps2 * (0.5 * (dt_s + state.dt_s)),
        dt_s=np.full((len(observed.code_m), 1, 1), dt_s),
    )


def _clock_step(epoch: _Epoch, params: SlipParams) -> tuple[_Epoch, FloatArray]:
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


def _steps_to_follow(epoch: _Epoch, clock_step_m: FloatArray, params: SlipParams) -> FloatArray:
    """Steps (R,) of whole milliseconds that the codes made and the carriers did not [m]."""
    apart_m, enough = _common(epoch.code_m - epoch.carrier_m, params.min_satellites)
    whole_m = np.round(apart_m / _MILLISECOND_M) * _MILLISECOND_M
    whole = enough & (np.abs(apart_m - whole_m) < _WHOLE_MILLISECONDS_M)
    result: FloatArray = np.where(whole[:, 0, 0] & (clock_step_m != 0.0), whole_m[:, 0, 0], 0.0)
    return result


def _tests(epoch: _Epoch, state: SlipState, dt_s: float, params: SlipParams) -> tuple[CauseArray, FloatArray]:
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
    cause = _flag(code, SlipCause.CODE) | _flag(doppler, SlipCause.DOPPLER)
    cause |= _flag(rate, SlipCause.RATE) | _flag(jumped, SlipCause.GEOMETRY_FREE)
    step_m = np.where(enough_ahead, ahead_common_m, beside_common_m)
    step_m = np.where(np.abs(step_m) > CLOCK_STEP_M, step_m, 0.0)
    return cause, (epoch.carrier_m - step_m) / epoch.dt_s


def _apart(surprise_m: FloatArray, base_m: float, per_jerk_s3: float, params: SlipParams) -> BoolArray:
    """Where a carrier left its prediction by more than noise and motion explain, (R, N_BANDS, N_SATS).

    `per_jerk_s3` is how a jerk shows in the surprise.
    """
    still_m = base_m + params.satellite_jerk_mps3 * per_jerk_s3
    return np.asarray(np.abs(surprise_m) > still_m + 2.0 * params.receiver_jerk_mps3 * per_jerk_s3)


def _common(residual_m: FloatArray, min_satellites: int) -> tuple[FloatArray, BoolArray]:
    """Median over satellites and bands (R, 1, 1), 0 if there are too few satellites, and whether there are enough."""
    present = np.isfinite(residual_m)
    enough = present.any(axis=1).sum(axis=-1) >= max(min_satellites, 1)
    ordered = np.sort(residual_m.reshape(len(residual_m), -1), axis=-1)  # NaN last
    number = present.reshape(ordered.shape).sum(axis=-1)
    rows = np.arange(len(ordered))
    low, high = np.maximum(number - 1, 0) // 2, np.minimum(number // 2, ordered.shape[-1] - 1)
    median = np.where(enough, 0.5 * (ordered[rows, low] + ordered[rows, high]), 0.0)
    return median[:, np.newaxis, np.newaxis], enough[:, np.newaxis, np.newaxis]


def _geometry_free(
    epoch: _Epoch, state: SlipState, consistent: BoolArray, dt_s: float, params: SlipParams
) -> BoolArray:
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


def _pair_jump(
    epoch: _Epoch, state: SlipState, other: int, dt_s: float, params: SlipParams
) -> tuple[BoolArray, BoolArray]:
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
