"""Protection levels a second time: scalars and loops, one satellite and one receiver after the other.

Written from RTCA DO-253's formulas alone, without any function of the suite. Directions are given as
azimuth and elevation, the projection comes from the normal equations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

# Published multipliers (DO-253 / Annex 10), by number of reference receivers.
K_FFMD = {1: 6.86, 2: 5.762, 3: 5.810, 4: 5.847}
K_MD = {2: 2.935, 3: 2.898, 4: 2.878}


@dataclass(frozen=True)
class Satellite:
    """One satellite used; `b_m` is None where a receiver is not behind the correction."""

    azimuth_rad: float  # counter-clockwise from the forward axis
    elevation_rad: float
    clock: int
    sigma_gnd_m: float
    sigma_air_m: float
    sigma_tropo_m: float
    sigma_iono_m: float
    b_m: tuple[float | None, ...] = ()
    ephemeris_error_m: float = 0.0

    @property
    def other_variance_m2(self) -> float:
        return self.sigma_air_m**2 + self.sigma_tropo_m**2 + self.sigma_iono_m**2

    @property
    def n_receivers(self) -> int:
        return max(1, sum(value is not None for value in self.b_m))


def projection(satellites: Sequence[Satellite]) -> list[list[float]]:
    """Rows x, y, z and clocks of S = (G'WG)^-1 G'W; one clock for each number that occurs."""
    clocks = sorted({satellite.clock for satellite in satellites})
    rows = []
    for satellite in satellites:
        cos_el = math.cos(satellite.elevation_rad)
        row = [-cos_el * math.cos(satellite.azimuth_rad), -cos_el * math.sin(satellite.azimuth_rad)]
        row.append(-math.sin(satellite.elevation_rad))
        row += [1.0 if satellite.clock == clock else 0.0 for clock in clocks]
        rows.append(row)
    size = len(rows[0])
    normal = [[0.0] * size for _ in range(size)]
    weighted = [[0.0] * len(rows) for _ in range(size)]
    for i, (row, satellite) in enumerate(zip(rows, satellites, strict=True)):
        weight = 1.0 / (satellite.sigma_gnd_m**2 + satellite.other_variance_m2)
        for a in range(size):
            weighted[a][i] = row[a] * weight
            for b in range(size):
                normal[a][b] += row[a] * weight * row[b]
    return np.linalg.solve(np.array(normal), np.array(weighted)).tolist()


def vertical_and_lateral(satellites: Sequence[Satellite], gpa_rad: float) -> tuple[list[float], list[float]]:
    """s_vert = s_z + s_x tan(GPA) and s_lat = s_y."""
    x, y, z = projection(satellites)[:3]
    return [zi + xi * math.tan(gpa_rad) for xi, zi in zip(x, z, strict=True)], y


def h0(s: Sequence[float], satellites: Sequence[Satellite], k_ffmd: dict[int, float]) -> float:
    """Fault-free protection level."""
    variance = 0.0
    for si, satellite in zip(s, satellites, strict=True):
        variance += si**2 * (satellite.sigma_gnd_m**2 + satellite.other_variance_m2)
    return k_ffmd[max(satellite.n_receivers for satellite in satellites)] * math.sqrt(variance)


def h1(s: Sequence[float], satellites: Sequence[Satellite], k_md: dict[int, float]) -> float:
    """Protection level of the worst single receiver fault."""
    worst = 0.0
    for j in range(4):
        bias, variance, multipliers = 0.0, 0.0, []
        for si, satellite in zip(s, satellites, strict=True):
            m = satellite.n_receivers
            b = satellite.b_m[j]
            if b is None:
                behind = m
            else:
                behind = m - 1
                bias += si * b
                multipliers.append(k_md[m])
            variance += si**2 * (m / behind * satellite.sigma_gnd_m**2 + satellite.other_variance_m2)
        if multipliers:
            worst = max(worst, abs(bias) + max(multipliers) * math.sqrt(variance))
    return worst


def ephemeris_bound(s: Sequence[float], satellites: Sequence[Satellite], k_md_e: float) -> float:
    """Ephemeris error bound of the worst satellite."""
    variance = 0.0
    for si, satellite in zip(s, satellites, strict=True):
        variance += si**2 * (satellite.sigma_gnd_m**2 + satellite.other_variance_m2)
    return max(
        abs(si) * satellite.ephemeris_error_m + k_md_e * math.sqrt(variance)
        for si, satellite in zip(s, satellites, strict=True)
    )
