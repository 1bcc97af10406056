"""Geometry screening a second time: every subset listed, every solution by least squares, no search."""

from __future__ import annotations

import itertools
import math

import numpy as np


def subsets(groups, combinations, max_missing):
    """Sets of satellites with a position, as frozen sets of places."""
    found = set()
    for combination in combinations:
        available = [i for i in range(groups.shape[1]) if any(groups[k, i] for k in combination)]
        for missing in range(max_missing + 1):
            for chosen in itertools.combinations(available, len(available) - missing):
                clocks = sum(any(groups[k, i] for i in chosen) for k in range(len(groups)))
                if len(chosen) >= 3 + clocks:
                    found.add(frozenset(chosen))
    return found


def level_and_error(los, sigma, nominal, front, groups, chosen, tan_gpa, k_ffmd, k_noise, affected):
    """Vertical and lateral protection level and error of one subset, by numpy's least squares."""
    chosen = sorted(chosen)
    clocks = [row[chosen].astype(float) for row in groups if row[chosen].any()]
    design = np.column_stack([-los[:, chosen].T, *clocks])
    weighted = design / sigma[chosen, None]
    projection = np.linalg.pinv(weighted) / sigma[chosen]
    result = []
    for s in (projection[2] + tan_gpa * projection[0], projection[1]):
        level = k_ffmd * math.sqrt(sum((a * b) ** 2 for a, b in zip(s, sigma[chosen], strict=True)))
        noise = k_noise * math.sqrt(sum((a * b) ** 2 for a, b in zip(s, nominal[chosen], strict=True)))
        result.append((level, noise + sum(sorted(np.abs(s) * front[chosen])[-affected:])))
    return result
