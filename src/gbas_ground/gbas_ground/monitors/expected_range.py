# mypy: disable-error-code="no-untyped-call"
"""Raw pseudoranges against what they should be: gross faults of a channel or an ephemeris."""

from __future__ import annotations

from typing import Annotated, Final

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.parameters import Parameter, parameters
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_core.satellites import CLOCK_GROUPS
from gbas_ground.monitors.result import MonitorResult

_CONSTELLATION: Final[IntArray] = CLOCK_GROUPS.argmax(axis=0)


@parameters
class ExpectedRangeParams:
    """Raw pseudoranges against the expected ones."""

    max_residual_m: Annotated[
        float, Parameter("raw pseudorange against the expected one", "m", 10.0, 10_000.0)
    ] = 150.0  # fmt: skip


def check_expected_range(raw_correction_m: FloatArray, tracked: BoolArray, limit_m: float) -> MonitorResult:
    """Compare each raw pseudorange with the one the broadcast orbit and clock give at the known antenna.

    Parameters
    ----------
    raw_correction_m : (R, N) array
        Expected less measured pseudorange, with the receiver clock in it [m]: PR_sc of the unsmoothed range.
    tracked : (R, N) bool array
        Channels with a pseudorange and an ephemeris.
    limit_m : float
        Largest residual [m].

    Returns
    -------
    MonitorResult
        Statistic: size of the residual less the median of the receiver's satellites of the same constellation [m].

    Notes
    -----
    The median estimates the receiver clock, so that a minority of gross errors does not shift it. What is left holds
    the troposphere (25 m at 5 degrees) and the ionosphere (65 m in the storms of 2003); the limit has to pass both.
    With one satellite of a constellation the residual is zero and with two a fault shows on both: the smallest common
    set of the corrections is larger than that.
    """
    statistic, failed = _residuals_m(
        np.ascontiguousarray(raw_correction_m), np.ascontiguousarray(tracked), _CONSTELLATION, float(limit_m)
    )
    return MonitorResult(statistic=statistic, threshold=np.array(float(limit_m)), failed=failed)


@compiled
def _residuals_m(raw_correction_m, tracked, constellation, limit_m):  # type: ignore[no-untyped-def]
    """Sizes of the residuals, NaN where there is none, and where they fail: ``(R, N)``."""
    n_receivers, n_sats = tracked.shape
    residual_m, failed = np.full(tracked.shape, np.nan), tracked.copy()
    values = np.empty(n_sats)
    for r in range(n_receivers):
        for group in range(constellation.max() + 1):
            n = 0
            for s in range(n_sats):
                if tracked[r, s] and constellation[s] == group and np.isfinite(raw_correction_m[r, s]):
                    values[n] = raw_correction_m[r, s]
                    n += 1
            clock_m = np.median(values[:n]) if n > 0 else np.nan
            for s in range(n_sats):
                if tracked[r, s] and constellation[s] == group:
                    residual_m[r, s] = abs(raw_correction_m[r, s] - clock_m)
                    failed[r, s] = not residual_m[r, s] <= limit_m
    return residual_m, failed


def row_median(values: FloatArray) -> FloatArray:
    """Median of the finite values of each row, as a column; NaN for a row without any."""
    ordered = np.sort(values, axis=-1)  # NaN last
    count = np.isfinite(values).sum(axis=-1, keepdims=True)
    low, high = np.maximum(count - 1, 0) // 2, count // 2
    pair = np.take_along_axis(ordered, np.concatenate([low, high], axis=-1), axis=-1)
    return np.asarray(0.5 * (pair[..., :1] + pair[..., 1:]))
