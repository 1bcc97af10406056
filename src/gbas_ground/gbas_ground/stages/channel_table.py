"""The executive's table: satellites and receivers, what state each channel is in, why, and for how long."""

from __future__ import annotations

from typing import Final

from gbas_core.record import FloatArray
from gbas_core.satellites import missing
from gbas_ground.stages.decide import Decided
from gbas_ground.stages.kernels.status import channel_table
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS, ChannelEpoch

NO_CHANNELS: Final[FloatArray] = missing(3, 1 + MAX_REFERENCE_RECEIVERS)
"""The table before the first epoch."""


def channel_epoch(decided: Decided, before: FloatArray) -> tuple[FloatArray, ChannelEpoch]:
    """The table of one epoch, as an array and as it is published; durations go on from the table `before`."""
    now, status = decided.corrected.monitored.tracked.received.now, decided.status
    elapsed_s = float(now.dt_s) if now.dt_s > 0.0 else 0.0
    table = channel_table(decided.channels, status.state, status.cause, before, elapsed_s, MAX_REFERENCE_RECEIVERS)
    state, cause, since_s = table
    return table, ChannelEpoch(
        gps_week=now.gps_week,
        tow_s=now.tow_s,
        state=state[0],
        cause=cause[0],
        since_s=since_s[0],
        channel_state=state[1:],
        channel_cause=cause[1:],
        channel_since_s=since_s[1:],
    )
