"""A VDB burst as it passes between nodes."""

from __future__ import annotations

from dataclasses import dataclass

SLOT_NAMES = "ABCDEFGH"
SLOT_DURATION_S = 0.0625
FRAME_DURATION_S = 0.5


@dataclass(frozen=True, kw_only=True)
class Burst:
    """Application data and FEC of one burst, with what the radio knows of its arrival.

    Attributes
    ----------
    gps_week, tow_s
        Start of the 0.5 s TDMA frame.
    slot : int
        Slot in the frame, 0 (A) to 7 (H).
    bursts_in_frame : int
        Bursts the station sends in this frame: lets a data-driven reader know when a frame is complete. Nothing else
        may be concluded from it.
    payload : bytes
        Application data (message blocks back to back, at most 222 bytes) and the 6 bytes of application FEC.
    """

    gps_week: int
    tow_s: float
    slot: int
    bursts_in_frame: int
    payload: bytes
