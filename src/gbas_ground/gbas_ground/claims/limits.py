"""The largest values messages carry: what a station broadcasts that claims nothing."""

from __future__ import annotations

from typing import Final

MAX_Y_EIG_M: Final = 3.0
"""Largest ionospheric error at the station that additional data block 3 carries [m]."""
MAX_M_EIG: Final = 0.7e-3
"""Largest growth of it with distance [m/m]."""
MAX_DECORRELATION: Final = 1.275e-3
"""Largest ephemeris decorrelation parameter that a type 1 or type 11 message carries [m/m]."""
