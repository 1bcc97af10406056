# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Attitudes that may come, from what is flown now and what is planned, and when they cost too many satellites."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from gbas_airborne.abia.prediction.kernels.masking import count_seen, is_harmless, rotation
from gbas_core.compiled import compiled

GRAVITY_MPS2: Final = 9.80665
HOLD, ROLL, PLAN = range(3)
"""Kinds of hypotheses: bank held, roll rate extrapolated and then held, plan followed."""
FADE_RAD: Final = math.radians(10.0)
"""Planned bank from which an error of bank counts whole; wings level there is none. Ours."""
BANK, PITCH, HEADING, ROLL_RATE, SPEED = range(5)
"""Places in the vector of what is flown now [rad, rad, rad, rad/s, m/s]."""
SHIFT, ERROR, WEIGHT = range(3)
"""Rows of hypotheses: how late the plan is flown [s], error of bank in turns [rad], weight [-]."""
HORIZON, STEP, ROLL_TIME, BANK_LIMIT, ANCHOR = range(5)
"""Places in the vector of how to look ahead [s, s, s, rad, rad]; for the last see :func:`bank_ahead`."""


@compiled
def interpolated(values, place):
    """Value between samples; the ends go on as they are."""
    last = values.shape[0] - 1
    place = min(max(place, 0.0), float(last))
    k = min(int(place), last - 1) if last > 0 else 0
    part = place - k
    return values[k] if part == 0.0 else values[k] + part * (values[k + 1] - values[k])


@compiled
def turn_rate(bank, speed):
    """Rate of heading in a level turn without sideslip [rad/s]: g tan(bank) / speed."""
    return GRAVITY_MPS2 * math.tan(bank) / speed


@compiled
def planned_bank(plan_bank, place, error):
    """Bank of the plan with an error in turns, in the sense of the turn."""
    bank = interpolated(plan_bank, place)
    return bank + error * min(max(bank / FADE_RAD, -1.0), 1.0)


@compiled
def bank_ahead(kind, now, plan_bank, place, error, ahead, offset, look):
    """Bank of a hypothesis some time ahead [rad].

    A followed plan is flown with ``offset``: what is flown now less the hypothesis, within the anchor, so that a
    hypothesis stands for all errors about it.
    """
    if kind == PLAN:
        return planned_bank(plan_bank, place, error) + offset
    if kind == HOLD:
        return now[BANK]
    bank = now[BANK] + now[ROLL_RATE] * min(ahead, look[ROLL_TIME])
    return min(max(bank, -max(look[BANK_LIMIT], abs(now[BANK]))), max(look[BANK_LIMIT], abs(now[BANK])))


@compiled
def fill_trajectory(kind, hypothesis, now, plan_bank, plan_pitch, place, plan_step, look, attitudes):
    """Attitudes of one hypothesis, (K, 3) bank, pitch and heading, at 0, step, ... up to the horizon.

    place is where now is in the samples of the plan. The attitude now is what is flown; the heading goes on with the
    rate of turn of the bank.
    """
    behind = place - hypothesis[SHIFT] / plan_step
    offset = 0.0
    if kind == PLAN:
        offset = now[BANK] - planned_bank(plan_bank, behind, hypothesis[ERROR])
        offset = min(max(offset, -look[ANCHOR]), look[ANCHOR])
    bank, heading = now[BANK], now[HEADING]
    for k in range(attitudes.shape[0]):
        ahead = k * look[STEP]
        if k > 0:
            at = behind + ahead / plan_step
            after = bank_ahead(kind, now, plan_bank, at, hypothesis[ERROR], ahead, offset, look)
            heading += look[STEP] * turn_rate(0.5 * (bank + after), now[SPEED])
            bank = after
        attitudes[k, 0], attitudes[k, 2] = bank, heading
        attitudes[k, 1] = interpolated(plan_pitch, behind + ahead / plan_step) if kind == PLAN and k else now[PITCH]


@compiled
def steps_of(look):
    """Attitudes of a trajectory: now and each step up to the horizon."""
    return round(look[HORIZON] / look[STEP]) + 1


@compiled
def trajectories(kinds, hypotheses, now, plan_bank, plan_pitch, place, plan_step, look):
    """Attitudes of all hypotheses, (H, K, 3)."""
    attitudes = np.empty((kinds.shape[0], steps_of(look), 3))
    for h in range(kinds.shape[0]):
        fill_trajectory(kinds[h], hypotheses[h], now, plan_bank, plan_pitch, place, plan_step, look, attitudes[h])
    return attitudes


@compiled
def first_short(attitudes, step, los, harmless, blocked, antenna, required, rot):
    """Time at which fewer satellites than required are seen first [s], infinite when never.

    harmless are tilts that cost no satellites that are required, as :func:`~.masking.harmless_tilts` has them; empty:
    all attitudes are looked at.
    """
    for k in range(attitudes.shape[0]):
        if is_harmless(attitudes[k, 0], attitudes[k, 1], attitudes[k, 2], harmless):
            continue
        rotation(attitudes[k, 0], attitudes[k, 1], attitudes[k, 2], antenna, rot)
        if count_seen(rot, los, blocked, antenna) < required:
            return k * step
    return math.inf


@compiled
def loss_probability(
    kinds, hypotheses, now, plan_bank, plan_pitch, place, plan_step, look, los, harmless, blocked, antenna,
    required, attitudes, rot, least,
):  # fmt: skip
    """Weight of the hypotheses that lose too many satellites, and the soonest loss among them [s].

    Hypotheses below the least weight are not flown.
    """
    probability, soonest = 0.0, math.inf
    for h in range(kinds.shape[0]):
        if not hypotheses[h, WEIGHT] > least:
            continue
        fill_trajectory(kinds[h], hypotheses[h], now, plan_bank, plan_pitch, place, plan_step, look, attitudes)
        found = first_short(attitudes, look[STEP], los, harmless, blocked, antenna, required, rot)
        if found < math.inf:
            probability += hypotheses[h, WEIGHT]
            soonest = min(soonest, found)
    return probability, soonest
