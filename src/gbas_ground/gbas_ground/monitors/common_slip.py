"""Carriers of a satellite that several receivers lose count of at one epoch: then it is the satellite that stepped.

A step of more than a few centimetres restarts the filters of every receiver by itself
(:mod:`gbas_core.ranging.slips`); this says why, and blames the satellite.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_core.record import BoolArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1
from gbas_ground.monitors.interface import MonitoredEpoch, MonitorOutput, SignalMonitor, Verdict, no_memory
from gbas_ground.monitors.kernels.ranges import common_slips
from gbas_ground.monitors.monitor_table import summarise
from gbas_ground.monitors.result import MonitorResult
from gbas_msgs_py.monitors import COMMON_SLIP

_MOST_SHARE = 0.5
"""When more of the tracked satellites slip at once, it is not the satellites. Ours."""
_ONE: Final = np.ones(N_SATS)


def check_common_slip(slipped: BoolArray, tracked: BoolArray, due: BoolArray) -> MonitorResult:
    """Count the receivers that lost count.

    Parameters
    ----------
    slipped : (R, N) bool array
        Slips found at this epoch.
    tracked : (R, N) bool array
        Channels that are tracked.
    due : (N,) bool array
        Satellites that were in use.

    Returns
    -------
    MonitorResult
        Statistic: receivers with a slip; threshold: one.

    Source: ours; slips of receivers are independent, but for interference and scintillation, which end the use of the
    satellite in any case.
    """
    number, failed = np.empty(N_SATS), np.empty(N_SATS, dtype=bool)
    common_slips(slipped, tracked, due, _MOST_SHARE, number, failed)
    return MonitorResult(statistic=number, threshold=_ONE, failed=failed)


# --- in the station


def _step(state: None, epoch: MonitoredEpoch) -> tuple[None, MonitorOutput]:
    """A satellite that steps has no settled filters any more, so `due` does not have it."""
    inputs = epoch.inputs
    tracked = np.isfinite(inputs.code_m[:, L1] + inputs.carrier_m[:, L1])
    result = check_common_slip(np.ascontiguousarray(inputs.slipped[:, L1]), tracked, inputs.in_use)
    test = COMMON_SLIP.test("slips")
    return state, MonitorOutput(
        summaries={COMMON_SLIP.key(test.name): summarise(result, inputs.in_use)},
        satellites=(Verdict(test.cause, result),),
    )


MONITOR: Final = SignalMonitor(entry=COMMON_SLIP, parameters=None, initial=no_memory, step=_step)
