# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Channels of all receivers, receivers x bands x satellites, before and after they are smoothed."""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.gnss.observations import LARGEST_OBSERVATION
from gbas_core.signals import L1, SPEED_OF_LIGHT_MPS
from gbas_ground.corrections.formation import range_correction_m

MAX_LLI: Final = 9  # one decimal digit in RINEX

_range_correction_m: Final = compiled(range_correction_m)


@compiled
def keep_sensible(values, satellites):
    """Make missing what is no measurement, or of a satellite not in use; ``values`` (quantity, R, bands, N) changes.

    The last of the quantities is the loss-of-lock indicator: one that means nothing counts as lock lost.
    """
    n_quantities, n_receivers, n_bands, n_sats = values.shape
    for quantity in range(n_quantities):
        indicator = quantity == n_quantities - 1
        for r in range(n_receivers):
            for b in range(n_bands):
                for s in range(n_sats):
                    value = values[quantity, r, b, s]
                    if not (satellites[s] and abs(value) <= LARGEST_OBSERVATION):
                        values[quantity, r, b, s] = np.nan
                    elif indicator and (value < 0.0 or value > MAX_LLI):
                        values[quantity, r, b, s] = 1.0


@compiled
def compare(code_m, carrier_m, range_m, clock_s, changed):
    """Channels against what is expected of them.

    Observations ``(R, bands, N)``, expected ranges and clocks ``(R, N)``, satellites with another ephemeris ``(N,)``.

    Returns
    -------
    channels : (2, R, N) bool array
        With code and carrier; and with an ephemeris, too.
    ranges_m : (2, R, N) array
        PR_sc of the raw code; expected range less satellite clock, for the slip tests, which is missing where another
        ephemeris would look like a slip.
    """
    channels, ranges_m = np.zeros((2, *range_m.shape), np.bool_), np.full((2, *range_m.shape), np.nan)
    tracked, comparable, correction_m, known_m = channels[0], channels[1], ranges_m[0], ranges_m[1]
    for r in range(range_m.shape[0]):
        for s in range(range_m.shape[1]):
            code, expected, clock = code_m[r, L1, s], range_m[r, s], clock_s[r, s]
            tracked[r, s] = np.isfinite(code + carrier_m[r, L1, s])
            comparable[r, s] = tracked[r, s] and np.isfinite(clock)
            correction_m[r, s] = _range_correction_m(expected, code, clock)
            if not changed[s]:
                known_m[r, s] = expected - SPEED_OF_LIGHT_MPS * clock
    return channels, ranges_m


@compiled
def finish(smoothed_m, age_s, place, range_m, clock_s, elevation_rad, mask_rad, settle_s):
    """PR_sc of one of the smoothed bands ``(tau, R, N)``, and the channels ``(R, N)`` that may be used.

    Those have filters that have run long enough, and a satellite above the mask. Smoothed ranges
    ``(tau, R, bands, N)``, ages ``(R, bands, N)``; `place` is that of the band.
    """
    n_tau, n_receivers, _, n_sats = smoothed_m.shape
    correction_m, settled = np.empty((n_tau, n_receivers, n_sats)), np.zeros((n_receivers, n_sats), np.bool_)
    for r in range(n_receivers):
        for s in range(n_sats):
            complete = age_s[r, place, s] >= settle_s and elevation_rad[s] >= mask_rad
            for t in range(n_tau):
                correction_m[t, r, s] = _range_correction_m(range_m[r, s], smoothed_m[t, r, place, s], clock_s[r, s])
                complete = complete and np.isfinite(correction_m[t, r, s])
            settled[r, s] = complete
    return correction_m, settled
