"""Double differences satellite by satellite, as one would write them down; slow, and no array longer than a list."""

from __future__ import annotations

import math

import numpy as np

from gbas_core.satellites import IS_GPS, N_SATS
from gbas_core.signals import WAVELENGTH_M


def loop_double_differences(residual_m, pairs, references, sigma_m, bands, factors):
    """{(baseline, band, satellite): (residual, sigma)} with the middle one of the reference satellites."""
    found = {}
    for row, (i, j) in enumerate(pairs):
        for place, band in enumerate(bands):
            wavelength = float(WAVELENGTH_M[band])
            for satellite in range(N_SATS):
                values = []
                for other in references:
                    if other == satellite or bool(IS_GPS[other]) != bool(IS_GPS[satellite]):
                        continue
                    at_j = residual_m[j][place][satellite] - residual_m[j][place][other]
                    at_i = residual_m[i][place][satellite] - residual_m[i][place][other]
                    difference = at_j - at_i
                    if not math.isfinite(difference):
                        continue
                    # the remainder of IEEE 754 is that to the nearest multiple
                    left = math.remainder(difference, wavelength)
                    variance = sum(
                        (factors[receiver] * sigma_m[place][each]) ** 2
                        for receiver in (i, j)
                        for each in (satellite, other)
                    )
                    values.append((abs(left) / math.sqrt(variance), left, math.sqrt(variance)))
                if values:
                    values.sort(key=lambda each: each[0])
                    found[row, place, satellite] = values[(len(values) - 1) // 2][1:]
    return found


def dense(found, shape):
    """The two arrays of a result, NaN where there is none."""
    arrays = np.full((2, *shape), np.nan)
    for place, values in found.items():
        arrays[(slice(None), *place)] = values
    return arrays
