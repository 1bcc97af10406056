# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""The two filters of divergence rates, channel by channel; what they are: :mod:`gbas_core.ranging.divergence`.

A channel's filter is value, F1, F2, time since its last measurement and age: five numbers, in this order.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.ranging.kernels.divergence import cascaded
from gbas_core.record import FloatArray
from gbas_core.satellites import N_SATS

VALUE, F1, F2, SINCE, AGE = range(5)
N_MEMORY: Final = 5


@compiled
def _goes_on(age_s, since_s, restarted, dt_s, max_gap_s):
    return dt_s > 0.0 and np.isfinite(age_s) and not restarted and since_s <= max_gap_s


@compiled
def _advanced(f1, f2, age_s, since_s, rate, going, starting, tau_s):
    """F1, F2, time since, age and output of a filter whose rate counts (`going`), that starts, or that waits."""
    if starting or not np.isfinite(age_s):
        f1, f2 = 0.0, 0.0
    if going:
        f1, f2 = cascaded(f1, f2, rate, min(since_s / tau_s, 1.0))
        return f1, f2, 0.0, age_s + since_s, f2
    return f1, f2, 0.0 if starting else since_s, age_s, np.nan


@compiled
def filter_value(value, f1, f2, since_s, age_s, now, restarted, dt_s, tau_s, max_gap_s):
    """A channel's filter one epoch later, fed with a value whose rate it takes.

    Returns
    -------
    value, f1, f2, since_s, age_s : float
        Memory.
    rate, filtered : float
        NaN where a filter starts and where there is no measurement.
    """
    since_s = since_s + dt_s if dt_s > 0.0 else since_s
    alive, present = _goes_on(age_s, since_s, restarted, dt_s, max_gap_s), np.isfinite(now)
    rate = (now - value) / since_s if alive and present else np.nan
    starting = present and not alive
    kept = age_s if alive else (0.0 if starting else np.nan)
    f1, f2, since_s, age_s, filtered = _advanced(f1, f2, kept, since_s, rate, alive and present, starting, tau_s)
    return now if present else (value if alive else np.nan), f1, f2, since_s, age_s, rate, filtered


@compiled
def filter_rate(f1, f2, since_s, age_s, rate, over_s, restarted, dt_s, tau_s, max_gap_s):
    """The same, fed with a mean rate over some time; a rate over a time that is too long counts as none.

    Returns
    -------
    f1, f2, since_s, age_s, filtered : float
    """
    since_s = since_s + dt_s if dt_s > 0.0 else since_s
    alive = _goes_on(age_s, since_s, restarted, dt_s, max_gap_s)
    usable = np.isfinite(rate) and not restarted and over_s > 0.0 and over_s <= max_gap_s
    starting = usable and not alive
    kept = age_s if alive else (0.0 if starting else np.nan)
    return _advanced(f1, f2, kept, over_s if usable else since_s, rate, usable, starting, tau_s)


def initial_memory(*leading: int) -> FloatArray:
    """Memory of filters that have seen nothing, ``(5, *leading, N)``."""
    memory = np.zeros((N_MEMORY, *leading, N_SATS))
    memory[[VALUE, AGE]] = np.nan
    return memory
