"""The largest undetected error per metre, by going round all angles an orbit error can have."""

from __future__ import annotations

import math

import numpy as np


def scanned_decorrelation(vectors, thresholds, los, *, descent_rad=0.0, steps=7200):
    """P of one satellite: over directions of the angle across the line of sight, its largest size not detected."""
    los = np.asarray(los, dtype=float)
    first = np.cross(los, [0.0, 0.0, 1.0])
    first /= np.linalg.norm(first)
    second = np.cross(los, first)
    worst = 0.0
    for number in range(steps):
        angle = 2.0 * math.pi * number / steps
        turn = math.cos(angle) * first + math.sin(angle) * second
        size = min(
            threshold / max(abs(float(np.dot(vector, turn))), 1e-300)
            for vector, threshold in zip(vectors, thresholds, strict=True)
            if math.isfinite(threshold)
        )
        level = math.hypot(turn[0], turn[1]) * math.cos(descent_rad) + abs(turn[2]) * math.sin(descent_rad)
        worst = max(worst, size * level)
    return worst
