# mypy: disable-error-code="no-untyped-call"
"""Raw pseudoranges against what they should be: gross faults of a channel or an ephemeris."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import CLOCK_GROUPS
from gbas_ground.monitors.kernels.ranges import expected_ranges
from gbas_ground.monitors.result import MonitorResult


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
    size, failed = expected_ranges(np.ascontiguousarray(raw_correction_m), tracked, CLOCK_GROUPS, float(limit_m))
    return MonitorResult(statistic=size, threshold=np.asarray(limit_m, dtype=np.float64), failed=failed)
