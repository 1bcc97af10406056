"""Failures become exclusions, and exclusions events."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from gbas_core.satellites import SAT_IDS
from gbas_ground.consistency import Exclusions, Finding
from gbas_ground.exclusions import exclude, release
from gbas_ground.monitors.interface import Verdict
from gbas_ground.monitors.result import MonitorResult
from gbas_ground.params import GroundParams
from gbas_msgs_py.codes import EventKind, ExclusionCause
from gbas_msgs_py.events import EventLog


def released(exclusions: Exclusions, params: GroundParams, events: EventLog, of: str = "") -> Exclusions:
    """End what has been clear for the re-admission time; `of` is what the subjects of events end with."""
    times = params.monitors.readmission_time_s, params.monitors.readmission_longest_s
    channels, channels_ended = release(exclusions.channels, *times)
    receivers, receivers_ended = release(exclusions.receivers, *times)
    satellites, _ = release(exclusions.satellites, *times)  # told when they are usable again
    for row in np.flatnonzero(receivers_ended):
        cause = ExclusionCause(int(exclusions.receivers.cause[row]))
        waited_s = max(params.monitors.readmission_time_s, float(exclusions.receivers.wait_s[row]))
        events.add(EventKind.READMISSION, f"rr{row + 1}{of}", cause.word, waited_s)
    for row, satellite in np.argwhere(channels_ended) if channels_ended.any() else ():
        cause = ExclusionCause(int(exclusions.channels.cause[row, satellite]))
        waited_s = max(params.monitors.readmission_time_s, float(exclusions.channels.wait_s[row, satellite]))
        events.add(EventKind.READMISSION, f"rr{row + 1}/{SAT_IDS[satellite]}{of}", cause.word, waited_s)
    return Exclusions(channels=channels, receivers=receivers, satellites=satellites)


def exclude_channels(exclusions: Exclusions, checks: Iterable[Verdict], events: EventLog, of: str = "") -> Exclusions:
    """Exclude the channels that fail, each with an event; `of` is what its subject ends with."""
    channels = exclusions.channels
    for cause, check, _ in checks:
        if not check.failed.any():
            continue
        for row, satellite in np.argwhere(check.failed & ~channels.excluded):
            value, threshold = check.at(row, satellite)
            events.add(EventKind.EXCLUSION, f"rr{row + 1}/{SAT_IDS[satellite]}{of}", cause.word, value, threshold)
        channels = exclude(channels, check.failed, cause)
    return replace(exclusions, channels=channels)


def exclude_receivers(
    exclusions: Exclusions, result: MonitorResult, cause: ExclusionCause, events: EventLog
) -> Exclusions:
    """Exclude the receivers that fail, each with an event."""
    if not result.failed.any():
        return exclusions
    for row in np.flatnonzero(result.failed & ~exclusions.receivers.excluded):
        events.add(EventKind.EXCLUSION, f"rr{row + 1}", cause.word, *result.at(int(row)))
    return replace(exclusions, receivers=exclude(exclusions.receivers, result.failed, cause))


def exclude_satellites(exclusions: Exclusions, failures: Iterable[Verdict]) -> tuple[Exclusions, tuple[Finding, ...]]:
    """Exclude the satellites that monitors of signals fail; several may fail one, and each says so."""
    satellites, findings = exclusions.satellites, []
    for cause, result, _ in failures:
        if not result.failed.any():
            continue
        for satellite in np.flatnonzero(result.failed & ~exclusions.satellites.excluded):
            value, threshold = result.at(int(satellite))
            findings.append(Finding(subject=SAT_IDS[satellite], cause=cause, value=value, threshold=threshold))
        satellites = exclude(satellites, result.failed, cause)
    return replace(exclusions, satellites=satellites), tuple(findings)
