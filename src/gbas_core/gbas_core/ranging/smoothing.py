# mypy: disable-error-code="no-untyped-call"
"""Carrier smoothing of code ranges: the Hatch filter both ends of a GBAS run.

The filter is ``P_n = w R_n + (1 - w) (P_{n-1} + phi_n - phi_{n-1})``, ``P_1 = R_1``, with ``w = T / tau`` once it has
settled. There are three ways to start:

- *variable*: ``w = max(1/n, T/tau)``, n counting the epochs since the (re)start, the first included: a running mean.
- *elapsed*: ``w = max(T/t, T/tau)``, t being the time since the first epoch, so that the second epoch's code
  replaces the first one's.
- *invariant*: ``w = T/tau`` from the second epoch on.

Arrays are (..., N_SATS): usually (receivers, bands, satellites). One state carries several time constants at once: its
smoothed range has the time constants as its first axis, and everything that does not depend on the time constant (last
carrier, count, age) has not.

Source: ICAO Annex 10 Vol. I, App. B 3.6.8.3.5.1 (tau = 100 s); Jiang, Milner, Macabiau, ENC 2015, eq (19) to (23)
(tau = 30 s, the two starts).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal, NamedTuple, get_args

import numpy as np

from gbas_core.ranging.kernels.smoothing import ELAPSED, INVARIANT, VARIABLE, smooth
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_core.satellites import N_SATS

Start = Literal["variable", "elapsed", "invariant"]

_FIRST: Final[IntArray] = np.zeros(1, dtype=np.int64)

# Known: the two time constants of the message types 1 (GAST C) and 11 (GAST D).
TAU_100_S: Final = 100.0
TAU_30_S: Final = 30.0


@dataclass(frozen=True, kw_only=True)
class SmoothingParams:
    """What the smoothing filter is set to.

    Attributes
    ----------
    tau_s : tuple of float
        Time constants; each is one entry of the leading axis of the smoothed range [s]. 0 is no smoothing: the range
        is the raw code, where there is a carrier.
    start : {"variable", "elapsed", "invariant"}
        Weight while the filter fills, see above. Only the invariant start is within 0.25 m of the settled filter 200 s
        after a restart at a divergence of 0.018 m/s (1.8 m / e^2 = 0.24 m); the variable one, with less noise, takes
        229 s (0.9 m / e at 200 s). The tables of the ENC 2015 paper belong to "elapsed", its "variant".
    max_gap_s : float
        A longer interval between two epochs restarts every filter [s]. Uncertain, ours: it must be above the data's
        interval (0.5 s or 1 s), so raise it for 30 s data.
    """

    tau_s: tuple[float, ...] = (TAU_100_S, TAU_30_S)
    start: Start = "variable"
    max_gap_s: float = 3.5

    def __post_init__(self) -> None:
        if not self.tau_s or not all(np.isfinite(tau) and tau >= 0.0 for tau in self.tau_s):
            raise ValueError(f"tau_s is {self.tau_s}: every time constant must be 0 s or more, and there must be one")
        if self.start not in get_args(Start):
            raise ValueError(f"start is {self.start!r}: it must be one of {', '.join(get_args(Start))}")
        if not (np.isfinite(self.max_gap_s) and self.max_gap_s > 0.0):
            raise ValueError(f"max_gap_s is {self.max_gap_s}: it must be above 0 s")

    @cached_property
    def tau_array_s(self) -> FloatArray:
        """The time constants as an array [s]."""
        return np.array(self.tau_s, dtype=np.float64)

    @cached_property
    def start_number(self) -> int:
        """The start as the kernel has it."""
        return {"variable": VARIABLE, "elapsed": ELAPSED, "invariant": INVARIANT}[self.start]


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothingState:
    """What the filters remember; arrays are never changed in place.

    Attributes
    ----------
    smoothed_m : (n_tau, ..., N_SATS) array
        Smoothed code range, NaN where there is none [m].
    carrier_m : (..., N_SATS) array
        Carrier range of the last epoch [m].
    count : (..., N_SATS) array
        Epochs in the filter since its last start, the first included; 0 where there is none [-].
    elapsed_s : (..., N_SATS) array
        Time since the filter's last start; NaN where there is none [s].
    """

    smoothed_m: FloatArray
    carrier_m: FloatArray
    count: FloatArray
    elapsed_s: FloatArray


def initial_smoothing(params: SmoothingParams, *leading: int, n_sats: int = N_SATS) -> SmoothingState:
    """State of filters that have seen nothing, for observations of shape ``(*leading, n_sats)``."""
    shape = (*leading, n_sats)
    return SmoothingState(
        smoothed_m=np.full((len(params.tau_s), *shape), np.nan),
        carrier_m=np.full(shape, np.nan),
        count=np.zeros(shape),
        elapsed_s=np.full(shape, np.nan),
    )


def smooth_step(
    state: SmoothingState,
    code_m: FloatArray,
    carrier_m: FloatArray,
    slipped: BoolArray,
    dt_s: float,
    params: SmoothingParams,
) -> tuple[SmoothingState, FloatArray]:
    """Advance every filter by one epoch.

    A filter restarts with the raw code where `slipped` says so and where it was empty; all restart when `dt_s` is not
    finite, not positive or above ``params.max_gap_s`` (so NaN does for the first epoch). A satellite without finite
    code and carrier is cleared and gives NaN: it restarts when it comes back.

    Parameters
    ----------
    state : SmoothingState
        From :func:`initial_smoothing` or the previous step.
    code_m, carrier_m : (..., N_SATS) arrays
        Raw code range and carrier range of this epoch [m].
    slipped : (..., N_SATS) bool array
        Where the carrier (or the code) may have jumped since the last epoch.
    dt_s : float
        Time since the last epoch [s].
    params : SmoothingParams

    Returns
    -------
    state : SmoothingState
    smoothed_m : (n_tau, ..., N_SATS) array
        Smoothed range, one row per time constant [m]; the same array the state holds, so do not write into it.
    """
    shape, n_sats = code_m.shape, code_m.shape[-1]
    rows = (-1, 1, n_sats)
    before = SmoothingState(
        smoothed_m=state.smoothed_m.reshape(len(params.tau_s), *rows),
        carrier_m=state.carrier_m.reshape(rows),
        count=state.count.reshape(rows),
        elapsed_s=state.elapsed_s.reshape(rows),
    )
    code, carrier = (np.ascontiguousarray(each, dtype=np.float64).reshape(rows) for each in (code_m, carrier_m))
    slip = np.ascontiguousarray(slipped, dtype=np.bool_).reshape(rows)
    after, smoothed_m = smooth_bands(before, Measured(code, carrier, slip), _FIRST, dt_s, params)
    new = SmoothingState(
        smoothed_m=smoothed_m.reshape(len(params.tau_s), *shape),
        carrier_m=after.carrier_m.reshape(shape),
        count=after.count.reshape(shape),
        elapsed_s=after.elapsed_s.reshape(shape),
    )
    return new, new.smoothed_m


class Measured(NamedTuple):
    """Code and carrier of an epoch [m], and where they may have jumped since the last."""

    code_m: FloatArray
    carrier_m: FloatArray
    slipped: BoolArray


def smooth_bands(
    state: SmoothingState, measured: Measured, bands: IntArray, dt_s: float, params: SmoothingParams
) -> tuple[SmoothingState, FloatArray]:
    """The same for some of the bands: observations ``(R, N_BANDS, N_SATS)``, the state ``(R, bands, N_SATS)``.

    Parameters
    ----------
    bands : (bands,) int array
        Their places on the band axis of the observations.
    """
    smoothed_m, memory = smooth(
        *measured, bands, state.smoothed_m, state.carrier_m, state.count, state.elapsed_s,
        float(dt_s), float(params.max_gap_s), params.tau_array_s, params.start_number,
    )  # fmt: skip
    last_m, count, elapsed_s = memory
    return SmoothingState(smoothed_m=smoothed_m, carrier_m=last_m, count=count, elapsed_s=elapsed_s), smoothed_m


def settled(state: SmoothingState, settle_s: float) -> BoolArray:
    """Where the filter has run for at least `settle_s` since its last start; False where there is none.

    Parameters
    ----------
    state : SmoothingState
    settle_s : float
        Required age [s].

    Returns
    -------
    (..., N_SATS) bool array
    """
    result: BoolArray = state.elapsed_s >= settle_s
    return result
