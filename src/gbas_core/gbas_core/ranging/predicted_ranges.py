"""What receivers should measure."""

from __future__ import annotations

from typing import NamedTuple

from gbas_core.record import FloatArray


class PredictedRanges(NamedTuple):
    """Expected ranges and clocks ``(R, N)`` [m], [s]; elevations and azimuths at the reference point ``(N,)`` [rad]."""

    range_m: FloatArray
    clock_s: FloatArray
    elevation_rad: FloatArray
    azimuth_rad: FloatArray
