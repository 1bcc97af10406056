"""Causes and levels of integrity flags."""

from __future__ import annotations

from enum import IntEnum


class Cause(IntEnum):
    """What a flag is raised for; the first ones also have flags of satellites."""

    MASKING = 0
    """Antenna horizon and airframe."""
    SIGNAL = 1
    """Carrier to noise density."""
    MULTIPATH = 2
    TRACKING = 3
    """Jitter and dynamic stress of the loops."""
    GEOMETRY = 4
    """Estimated position errors against what the phase of flight requires."""
    PROTECTION = 5
    """Protection levels against alert limits."""
    SERVICE = 6
    """GBAS service."""
    PREDICTION = 7
    """What comes is not known, or less well than asked for."""


SATELLITE_CAUSES = (Cause.MASKING, Cause.SIGNAL, Cause.MULTIPATH, Cause.TRACKING)


class Level(IntEnum):
    """Level of a flag."""

    CLEAR = 0
    CAUTION = 1
    WARNING = 2
