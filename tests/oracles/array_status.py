"""States of satellites and channels by whole arrays, reason by reason: the second formulation of the compiled loops.

States: 0 not tracked, 1 settling, 2 usable, 3 excluded, 4 recovering. Causes: 1 not tracked, 2 settling, 3 below the
mask, 4 no ephemeris, 5 too few receivers, 6 too few common satellites, 7 sigma too large, 8 no rate, 9 unmonitored;
from 32 on a monitor's.
"""

from __future__ import annotations

import numpy as np

MAX_SIGMA_M = 5.08


def chosen(reasons, state, cause):
    """State and cause of the first reason that holds."""
    for mask, its_state, its_cause in reversed(reasons):
        state, cause = np.where(mask, its_state, state), np.where(mask, its_cause, cause)
    return state, cause


def recovering(clear_s):
    return np.where(clear_s > 0.0, 4.0, 3.0)


def satellites(channels, sats, least, mask_rad):
    """State and cause of every satellite."""
    seen, visible = channels.tracked.any(axis=0), sats.elevation_rad >= mask_rad
    by_receiver = np.broadcast_to(channels.receiver_cause[:, np.newaxis], channels.cause.shape)
    usable = (channels.cause == 0) & (by_receiver == 0)
    is_ready = channels.settled & sats.judged
    ready = (usable & is_ready).sum(axis=0)
    settling = (usable & np.isfinite(channels.age_s) & ~is_ready).sum(axis=0)
    short = sats.receivers < least
    waiting = short & (ready < least) & (ready + settling >= least)
    unmonitored = waiting & ~sats.judged & ((usable & channels.settled).sum(axis=0) >= least)
    of_channels = np.where(channels.tracked & (by_receiver != 0), by_receiver, channels.cause).max(axis=0)
    no_rate = ~np.isfinite(sats.prc_m + sats.rrc_mps).all(axis=0)
    too_large = ~((sats.sigmas_m > 0.0) & (sats.sigmas_m <= MAX_SIGMA_M)).all(axis=0)
    reasons = (
        (~seen & ~visible, 0, 0), (~seen, 0, 1), (np.isnan(sats.elevation_rad + sats.ephemeris_crc), 3, 4),
        (~visible, 3, 3), (sats.cause != 0, recovering(sats.clear_s), sats.cause), (unmonitored, 1, 9),
        (waiting, 1, 2), (short & (of_channels >= 32), 3, of_channels), (short & (ready >= least), 3, 6),
        (short, 3, 5), (too_large, 3, 7), (no_rate, 3, 8),
    )  # fmt: skip
    return chosen(reasons, np.full(seen.shape, 2.0), np.zeros(seen.shape))


def of_channels(channels, state, cause):
    """State and cause of every channel, where its satellite has a row and a channel is tracked or excluded."""
    by_receiver = np.broadcast_to(channels.receiver_cause[:, np.newaxis], channels.cause.shape)
    settling = np.isfinite(channels.age_s) & ~channels.settled & (cause != 3)
    reasons = (
        (channels.cause != 0, recovering(channels.clear_s), channels.cause),
        (by_receiver != 0, recovering(channels.receiver_clear_s)[:, np.newaxis], by_receiver),
        (~channels.tracked, 0, 1), (channels.used & (state == 2), 2, 0), (settling, 1, 2),
    )  # fmt: skip
    rest = np.where(state == 2, 3.0, state), np.where(cause == 0, 6.0, cause)
    its_state, its_cause = chosen(reasons, *(np.broadcast_to(each, channels.cause.shape) for each in rest))
    shown = ((state != 0) | (cause != 0)) & (channels.tracked | (channels.cause != 0)).any(axis=0)
    return np.where(shown, its_state, np.nan), np.where(shown, its_cause, np.nan)
