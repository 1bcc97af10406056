"""C/N0 of each channel."""

from __future__ import annotations

from gbas_core.record import BoolArray, FloatArray
from gbas_ground.monitors.result import MonitorResult, upper_limit


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
    applies = tracked if required else tracked & (cn0_dbhz == cn0_dbhz)
    return upper_limit(-cn0_dbhz, -minimum_dbhz, applies)
