"""Carrier frequencies and the band axis.

A band is a place in the spectrum that GPS and Galileo share: ``L1`` (L1 C/A, E1), ``L2`` (L2; GPS only) and ``L5``
(L5, E5a). Arrays with a band axis have it in this order.

Source: IS-GPS-200N 3.3.1.1, IS-GPS-705J 3.3.1.1, Galileo OS SIS ICD 2.1 table 2.
"""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

Band = Literal["L1", "L2", "L5"]
SPEED_OF_LIGHT_MPS: Final = 299_792_458.0

BANDS: Final[tuple[Band, ...]] = ("L1", "L2", "L5")
N_BANDS: Final = len(BANDS)
BAND_INDEX: Final[dict[str, int]] = {band: index for index, band in enumerate(BANDS)}
L1: Final = BAND_INDEX["L1"]
L2: Final = BAND_INDEX["L2"]
L5: Final = BAND_INDEX["L5"]

FREQUENCY_HZ: Final[NDArray[np.float64]] = np.array([154.0, 120.0, 115.0]) * 10.23e6
WAVELENGTH_M: Final[NDArray[np.float64]] = SPEED_OF_LIGHT_MPS / FREQUENCY_HZ

# Ratio of ionospheric delays, (f_L1 / f_band)^2: 1, 1.6469, 1.7933.
IONO_RATIO: Final[NDArray[np.float64]] = (FREQUENCY_HZ[L1] / FREQUENCY_HZ) ** 2
