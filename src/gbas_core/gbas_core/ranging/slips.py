# mypy: disable-error-code="no-untyped-call"
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
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbas_core.ranging.kernels import slips as kernel
from gbas_core.ranging.kernels.slips import SlipThresholds, find_slips
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import N_BANDS

CauseArray = NDArray[np.uint8]

# Known: jerk of DO-229 normal manoeuvres, 0.25 g/s.
NORMAL_MANOEUVRE_JERK_MPS3: Final = 0.25 * 9.80665


class SlipCause(IntFlag):
    """Why a measurement was flagged."""

    LOCK = kernel.LOCK
    GAP = kernel.GAP
    CODE = kernel.CODE
    DOPPLER = kernel.DOPPLER
    RATE = kernel.RATE
    GEOMETRY_FREE = kernel.GEOMETRY_FREE
    FROZEN = kernel.FROZEN


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


def initial_slips(n_receivers: int = 1) -> SlipState:
    """State that has seen nothing."""
    nothing = np.full((n_receivers, N_BANDS, N_SATS), np.nan)
    return SlipState(
        code_m=nothing,
        carrier_m=nothing,
        doppler_hz=nothing,
        rate_mps=nothing,
        acceleration_mps2=nothing,
        range_m=np.full((n_receivers, 1, N_SATS), np.nan),
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
    code_m, carrier_m, doppler_hz, lli = map(np.ascontiguousarray, observed[:4])
    range_m, dt_s = np.ascontiguousarray(observed.known_m), float(dt_s)
    cause, slipped, moving, steps_m = find_slips(
        code_m, carrier_m, doppler_hz, lli, range_m,
        state.code_m, state.carrier_m, state.doppler_hz, state.rate_mps, state.acceleration_mps2, state.range_m,
        state.followed_m, state.dt_s, dt_s, thresholds(params, dt_s),
    )  # fmt: skip
    carrier_m, rate_mps, acceleration_mps2 = moving
    followed_m, clock_step_m = steps_m
    new = SlipState(
        code_m=code_m,
        carrier_m=carrier_m,
        doppler_hz=doppler_hz,
        rate_mps=rate_mps,
        acceleration_mps2=acceleration_mps2,
        range_m=range_m,
        followed_m=followed_m,
        dt_s=dt_s,
    )
    return new, SlipResult(slipped=slipped, cause=cause, clock_step_m=clock_step_m, carrier_m=carrier_m)


@lru_cache(maxsize=64)
def thresholds(params: SlipParams, dt_s: float) -> SlipThresholds:
    """Thresholds of all tests at an interval between epochs [s]."""
    jerk_mps3 = params.satellite_jerk_mps3, 2.0 * params.receiver_jerk_mps3  # the receiver's counts twice
    by_doppler_m, by_rate_m = ((jerk_mps3[0] * per, jerk_mps3[1] * per) for per in (dt_s**3 / 12.0, dt_s**3))
    acceleration_m = params.geometry_free_acceleration_mps2 * dt_s**2
    return SlipThresholds(
        code_m=float(params.code_base_m + params.code_rate_mps * dt_s),
        doppler_m=float(params.doppler_base_m + params.doppler_noise_mps * dt_s + by_doppler_m[0] + by_doppler_m[1]),
        rate_m=float(params.rate_base_m + by_rate_m[0] + by_rate_m[1]),
        range_m=float(params.rate_base_m + params.range_rate_mps * dt_s),
        geometry_free_m=float(params.geometry_free_base_m + acceleration_m),
        geometry_free_new_m=float(params.geometry_free_base_m + params.geometry_free_rate_mps * dt_s),
        max_gap_s=float(params.max_gap_s),
        min_satellites=int(params.min_satellites),
        follow_code_steps=bool(params.follow_code_steps),
    )
