"""C/N0 of each channel."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import BoolArray, FloatArray
from gbas_ground.monitors.kernels.power import too_weak
from gbas_ground.monitors.result import MonitorResult


@parameters
class SignalPowerParams:
    """C/N0 against one limit for all elevations."""

    exclude: Annotated[bool, Parameter("channels that fail are excluded")] = True
    min_cn0_dbhz: Annotated[float, Parameter("lowest C/N0 of a channel in use", "dB-Hz", 0.0, 60.0)] = 30.0
    require_cn0: Annotated[bool, Parameter("do not use a channel whose receiver gives no C/N0")] = True


def check_signal_power(
    cn0_dbhz: FloatArray, tracked: BoolArray, minimum_dbhz: float, *, required: bool
) -> MonitorResult:
    """Fail channels whose C/N0 is below the minimum.

    Parameters
    ----------
    cn0_dbhz : (R, N) array
    tracked : (R, N) bool array
        Channels with a measurement.
    minimum_dbhz : float
    required : bool
        True: a channel without C/N0 fails. False: it is not looked at.

    Returns
    -------
    MonitorResult
        Statistic: minus C/N0, so that larger is worse like everywhere [dB-Hz]; threshold: minus the minimum.
    """
    statistic, failed = too_weak(np.ascontiguousarray(cn0_dbhz), tracked, float(minimum_dbhz), bool(required))
    return MonitorResult(statistic=statistic, threshold=np.asarray(-minimum_dbhz, dtype=np.float64), failed=failed)
