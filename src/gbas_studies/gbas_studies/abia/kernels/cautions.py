# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""A flight time by time, by the kernels of the prediction."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from gbas_airborne.abia.prediction.kernels.identification import identify
from gbas_airborne.abia.prediction.kernels.masking import count_seen, harmless_tilts, rotation
from gbas_airborne.abia.prediction.kernels.trajectories import (
    ANCHOR,
    BANK,
    HEADING,
    HORIZON,
    PITCH,
    PLAN,
    ROLL,
    ROLL_RATE,
    ROLL_TIME,
    WEIGHT,
    loss_probability,
    steps_of,
)
from gbas_core.compiled import compiled

SECTORS: Final = 72
"""Of azimuth, for which harmless tilts are kept."""
TOGETHER: Final = 10
MOVED_RAD: Final = 2.5e-3
"""Skies, a second apart, that share harmless tilts, and a bound of what satellites move in so many [rad]: at most
2 pi radians in eleven hours of a circle seen from within are less than 2.5e-4 rad/s."""


@compiled
def seen_counts(flown, los, times_a_sky, blocked, antenna):
    """Satellites seen at each time of a flight, (T,); flown (T, 5) as in the prediction, los (S, 3, N)."""
    counts = np.empty(flown.shape[0], np.int64)
    rot = np.empty((4, 3))
    for t in range(flown.shape[0]):
        rotation(flown[t, BANK], flown[t, PITCH], flown[t, HEADING], antenna, rot)
        counts[t] = count_seen(rot, los[t // times_a_sky], blocked, antenna)
    return counts


@compiled
def harmless_by_sky(los, sin_horizon, required):
    """Harmless tilts of each sky, (S, SECTORS): those of some skies together, less how far satellites move in them."""
    tilts = np.empty((los.shape[0], SECTORS))
    for first in range(0, los.shape[0], TOGETHER):
        last = min(first + TOGETHER, los.shape[0])
        shared = los[first].copy()
        for i in range(los.shape[2]):
            for s in range(first, last):
                if not np.isfinite(los[s, 2, i]):
                    shared[:, i] = np.nan
        tilts[first:last] = harmless_tilts(shared, sin_horizon, required, SECTORS) - MOVED_RAD
    return tilts


@compiled
def steepest_planned(plan_bank, steps):
    """Steepest planned bank in each block of so many samples, (B,)."""
    blocks = np.zeros(plan_bank.shape[0] // steps + 1)
    for k in range(plan_bank.shape[0]):
        blocks[k // steps] = max(blocks[k // steps], abs(plan_bank[k]))
    return blocks


@compiled
def steepest_ahead(kinds, now, blocks, place, reach, error, roll_time):
    """Bound of the bank of all hypotheses over the horizon [rad]; places of blocks and reach are in blocks."""
    bound = abs(now[BANK])
    for h in range(kinds.shape[0]):
        if kinds[h] == ROLL:
            bound = max(bound, abs(now[BANK]) + abs(now[ROLL_RATE]) * roll_time)
            break
    if kinds.shape[0] and kinds[0] == PLAN:
        first = max(math.floor(place - reach[0]), 0)
        last = min(math.ceil(place + reach[1]), blocks.shape[0] - 1)
        for k in range(first, last + 1):
            bound = max(bound, blocks[k] + error)
    return bound


@compiled
def loss_probabilities(
    flown, elapsed, every, times_a_sky, plan_bank, plan_pitch, plan_step, kinds, hypotheses, look, shifts, errors,
    prior_shift, prior_error, how, los, harmless, blocked, antenna, required, least,
):  # fmt: skip
    """Weight of the hypotheses that lose too many satellites, (T,), looked at anew each so many times.

    Plans begin with the flight. harmless are those of each sky, (S, sectors), with no sectors when there is an
    airframe; times at which no hypothesis tilts the antenna enough to lose any satellite are passed over.
    """
    n = flown.shape[0]
    found = np.zeros(n)
    values = hypotheses.copy()
    attitudes, rot = np.empty((steps_of(look), 3)), np.empty((4, 3))
    a_block = max(round(1.0 / plan_step), 1)
    blocks = steepest_planned(plan_bank, a_block)
    lateness, error = 0.0, 0.0
    for h in range(kinds.shape[0]):
        lateness, error = max(lateness, abs(hypotheses[h, 0])), max(error, abs(hypotheses[h, 1]))
    reach = np.array([lateness + 1.0, lateness + look[HORIZON] + 1.0]) / (a_block * plan_step)
    error += look[ANCHOR]
    tilt, sky = -1.0, -1
    for t in range(n):
        if t % every:
            found[t] = found[t - 1]
            continue
        place = t * elapsed / plan_step
        if shifts.shape[0] > 1 and t > 0:
            weights = values[:, WEIGHT].copy()
            identify(
                weights, prior_shift, prior_error, shifts, errors, flown[t, BANK], plan_bank, place, plan_step,
                every * elapsed, how,
            )  # fmt: skip
            values[:, WEIGHT] = weights
        if t // times_a_sky != sky:
            sky = t // times_a_sky
            tilt = harmless[sky].min() if harmless.shape[1] else -1.0
        steepest = steepest_ahead(kinds, flown[t], blocks, place / a_block, reach, error, look[ROLL_TIME])
        if steepest + abs(flown[t, PITCH]) < tilt:
            continue
        found[t], _ = loss_probability(
            kinds, values, flown[t], plan_bank, plan_pitch, place, plan_step, look, los[sky], harmless[sky], blocked,
            antenna, required, attitudes, rot, least,
        )  # fmt: skip
    return found
