"""The sigma monitor in the station: B values over minutes and hours against the sigmas that are broadcast.

It looks at corrections that are made already, and what it fails is excluded from the next epoch on: it takes minutes to
see anything, so half a second more is nothing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from gbas_core.record import BoolArray
from gbas_core.satellites import SAT_IDS
from gbas_ground.consistency import Corrections, Exclusions, Finding
from gbas_ground.exclusions import exclude
from gbas_ground.monitors.monitor_table import Summaries, summarise_each, worst_of
from gbas_ground.monitors.result import MonitorResult
from gbas_ground.monitors.sigma_monitor import (
    SigmaMonitorResult,
    SigmaMonitorState,
    initial_sigma_monitor,
    normalised_b,
    sigma_monitor_step,
)
from gbas_ground.params import GroundParams
from gbas_msgs_py.codes import ExclusionCause
from gbas_msgs_py.monitors import SIGMA_MONITOR

_KEYS: Final = (SIGMA_MONITOR.key("mean"), SIGMA_MONITOR.key("spread"))


def initial_long_term(params: GroundParams) -> SigmaMonitorState:
    """A monitor that has seen nothing."""
    return initial_sigma_monitor(params.n_receivers, params.sigma_monitor)


def monitor_sigmas(
    state: SigmaMonitorState, corrections: Corrections, exclusions: Exclusions, dt_s: float, params: GroundParams
) -> tuple[SigmaMonitorState, Exclusions, tuple[Finding, ...], Summaries]:
    """Take the B values of one epoch.

    Returns
    -------
    state : SigmaMonitorState
    exclusions : Exclusions
        With the channels and receivers that fail, from the next epoch on.
    findings : tuple of Finding
    summaries : mapping from the numbers of a test to MonitorSummary
    """
    settings, used = params.sigma_monitor, corrections.used & (corrections.count >= 2)
    # What is excluded, alone or with its receiver, has no B values; its old estimates count until they are forgotten.
    remembered = (state.count > 0.0) & (state.since_s + max(dt_s, 0.0) <= settings.forget_s)
    due = used | (~exclusions.usable_channels() & remembered)
    normalised = normalised_b(corrections.b_m, corrections.channel_sigma_m, used)
    state, result = sigma_monitor_step(state, normalised, due, dt_s, settings)
    summaries = dict(zip(_KEYS, summarise_each(result.channels, np.logical_or.reduce(used)), strict=True))
    if not params.sigma_monitor.exclude or not (result.channels.failed.any() or result.receivers.failed.any()):
        return state, exclusions, (), summaries
    exclusions, findings = _excluded(exclusions, result)
    return state, exclusions, findings, summaries


def _excluded(exclusions: Exclusions, result: SigmaMonitorResult) -> tuple[Exclusions, tuple[Finding, ...]]:
    findings: list[Finding] = []
    channels, receivers = exclusions.channels, exclusions.receivers
    failed: BoolArray
    for cause, each in ((ExclusionCause.SIGMA_MEAN, result.mean), (ExclusionCause.SIGMA_SPREAD, result.variance)):
        failed = np.logical_or.reduce(each.failed, axis=(0, 1))
        if failed.any():
            worst = worst_of(each, axes=2)
            findings += [
                _finding(f"rr{row + 1}/{SAT_IDS[satellite]}", cause, worst, (row, satellite))
                for row, satellite in np.argwhere(failed & ~channels.excluded)
            ]
            channels = exclude(channels, failed, cause)
    failed = np.logical_or.reduce(result.receivers.failed, axis=(0, 1))
    if failed.any():
        worst = worst_of(result.receivers, axes=2)
        findings += [
            _finding(f"rr{row + 1}", ExclusionCause.SIGMA_SPREAD, worst, (int(row),))
            for row in np.flatnonzero(failed & ~receivers.excluded)
        ]
        receivers = exclude(receivers, failed, ExclusionCause.SIGMA_SPREAD)
    return replace(exclusions, channels=channels, receivers=receivers), tuple(findings)


def _finding(subject: str, cause: ExclusionCause, result: MonitorResult, place: tuple[int, ...]) -> Finding:
    value, threshold = result.at(*place)
    return Finding(subject=subject, cause=cause, value=value, threshold=threshold)
