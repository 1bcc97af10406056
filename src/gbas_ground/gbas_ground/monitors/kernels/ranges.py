# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Which channels are judged together; carriers that several receivers lose count of; raw against expected ranges."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled
from gbas_ground.monitors.kernels.median import median


@compiled
def common_slips(slipped, tracked, due, most_share, number, failed):
    """Receivers with a slip, into ``number`` (N,), and the satellites that are due and slip at several, unless most do.

    ``slipped``, ``tracked`` (R, N); ``failed`` (N,).
    """
    n_sats = len(due)
    several, seen = 0, 0
    for sat in range(n_sats):
        any_tracked, number[sat] = False, 0.0
        for row in range(len(slipped)):
            any_tracked = any_tracked or tracked[row, sat]
            if slipped[row, sat] and tracked[row, sat]:
                number[sat] += 1.0
        several += 1 if number[sat] > 1.0 else 0
        seen += 1 if any_tracked else 0
    for sat in range(n_sats):
        failed[sat] = due[sat] and number[sat] > 1.0 and several <= most_share * max(1, seen)


@compiled
def expected_ranges(raw_correction_m, tracked, groups, limit_m):
    """Sizes of the residuals less the median of the receiver and constellation ``(R, N)``, and which are too large."""
    size = np.full(raw_correction_m.shape, np.nan)
    failed = np.zeros(raw_correction_m.shape, dtype=np.bool_)
    own = np.empty(raw_correction_m.shape[1])
    for row in range(raw_correction_m.shape[0]):
        for group in range(len(groups)):
            for sat in range(len(own)):
                own[sat] = raw_correction_m[row, sat] if tracked[row, sat] and groups[group, sat] else np.nan
            middle = median(own)
            for sat in range(len(own)):
                if groups[group, sat]:
                    size[row, sat] = np.abs(own[sat] - middle)
                    failed[row, sat] = tracked[row, sat] and not size[row, sat] <= limit_m
    return size, failed


@compiled
def common_channels(ready, failed, groups, least, steady):
    """Ready channels ``(R, N)`` that nothing has failed, of constellations with enough ready ones at the receiver."""
    for row in range(len(ready)):
        for group in range(len(groups)):
            number = 0
            for sat in range(ready.shape[1]):
                number += 1 if ready[row, sat] and groups[group, sat] else 0
            for sat in range(ready.shape[1]):
                if groups[group, sat]:
                    steady[row, sat] = ready[row, sat] and number >= least and not failed[row, sat]


@compiled
def looked_at(
    channel_ok, settled, channel_excluded, receiver_excluded, satellite_excluded, elevation_rad, mask_rad, crc, minimum,
    channels, satellites,
):  # fmt: skip
    """What monitors may look at.

    Parameters
    ----------
    channel_ok, settled, channel_excluded : (R, N) bool arrays
    receiver_excluded, satellite_excluded : (R,) and (N,) bool arrays
    elevation_rad, crc : (N,) arrays
    mask_rad : float
    minimum : int
        Receivers a satellite needs.
    channels : (3, R, N) bool array
        Filled in: usable above the mask with their satellite, ready, and ready but for their receiver.
    satellites : (2, N) bool array
        Filled in: due, and due and not excluded.
    """
    for sat in range(len(crc)):
        ready = 0
        for row in range(len(receiver_excluded)):
            not_excluded = channel_ok[row, sat] and not channel_excluded[row, sat]
            usable = not_excluded and not receiver_excluded[row]
            channels[0, row, sat] = usable and elevation_rad[sat] >= mask_rad and not satellite_excluded[sat]
            channels[1, row, sat] = usable and settled[row, sat]
            channels[2, row, sat] = not_excluded and receiver_excluded[row] and settled[row, sat]
            ready += 1 if channels[1, row, sat] else 0
        satellites[0, sat] = ready >= minimum and np.isfinite(crc[sat])
        satellites[1, sat] = satellites[0, sat] and not satellite_excluded[sat]
