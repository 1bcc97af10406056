"""One receiver's observations of one epoch."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from gbas_core.gnss.gpstime import epoch_key
from gbas_core.record import FloatArray, Record, per_satellite, scalar
from gbas_core.signals import BANDS

LARGEST_OBSERVATION: Final = 1e12
"""No receiver measures more, in whatever unit: beyond it a number is damage, and would only overflow."""


def _by_band(quantity: str, unit_suffix: str) -> tuple[str, ...]:
    return tuple(f"{quantity}_{band.lower()}{unit_suffix}" for band in BANDS)


@dataclass(frozen=True, kw_only=True, eq=False)
class ObservationEpoch(Record):
    """Raw observations of one receiver at one epoch; arrays are (N_BANDS, N_SATS), missing is NaN.

    The epoch is the receiver's time tag. The carrier is in metres and grows with range (wavelength times the RINEX
    phase in cycles). `lli` is RINEX' loss-of-lock indicator (bit 0: lock lost since the last epoch).
    """

    simulated: float = scalar("-", "1 if a simulator made these observations, 0 if a receiver did")
    code_m: FloatArray = per_satellite("m", "pseudorange", columns=_by_band("code", "_m"))
    carrier_m: FloatArray = per_satellite("m", "carrier range", columns=_by_band("carrier", "_m"))
    doppler_hz: FloatArray = per_satellite(
        "Hz", "Doppler, positive when approaching", columns=_by_band("doppler", "_hz")
    )
    cn0_dbhz: FloatArray = per_satellite("dB-Hz", "carrier to noise density", columns=_by_band("cn0", "_dbhz"))
    lli: FloatArray = per_satellite("-", "loss-of-lock indicator", columns=_by_band("lli", ""))

    @property
    def empty(self) -> bool:
        """Whether no satellite has any value: the receiver has nothing to say for this epoch, as if it were absent."""
        values = (self.code_m, self.carrier_m, self.doppler_hz, self.cn0_dbhz, self.lli)
        return all(bool(np.isnan(each).all()) for each in values)

    def is_of(self, gps_week: int, tow_s: float) -> bool:
        """Whether the time tag is that epoch, to the millisecond; a tag that is no time never is."""
        if not (math.isfinite(self.gps_week) and math.isfinite(self.tow_s)):
            return False
        return epoch_key(self.gps_week, self.tow_s) == epoch_key(gps_week, tow_s)
