# mypy: disable-error-code="no-untyped-call"
"""Track: ranges predicted, channels checked against them, and smoothed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from gbas_core.ranging.predicted_ranges import PredictedRanges
from gbas_core.record import BoolArray, FloatArray
from gbas_core.signals import L1
from gbas_ground.channels.kernels.channels import compare, finish
from gbas_ground.channels.predicted_ranges import predict_ranges
from gbas_ground.channels.tracking import RawEpoch, TrackGroup, Tracks, track
from gbas_ground.consistency import Exclusions
from gbas_ground.monitors.expected_range import check_expected_range
from gbas_ground.monitors.interface import Verdict
from gbas_ground.monitors.monitor_table import Summaries, summarise
from gbas_ground.monitors.result import MonitorResult
from gbas_ground.monitors.signal_power import check_signal_power
from gbas_ground.params import GroundParams
from gbas_ground.prepared import PreparedStation
from gbas_ground.stages.exclusion import exclude_channels, exclude_receivers
from gbas_ground.stages.receive import Received
from gbas_msgs_py.codes import ExclusionCause
from gbas_msgs_py.monitors import EXPECTED_RANGE, SIGNAL_POWER, TESTS

_CHECKS: Final = (EXPECTED_RANGE.key("residual"), SIGNAL_POWER.key("cn0"))
"""Tests of single channels, in their order."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TrackState:
    """Memory of this stage: filters, receivers in groups of those that share their last epoch."""

    groups: tuple[TrackGroup, ...]


class Tracked(NamedTuple):
    """Record of this stage: what the receivers measured, checked, followed over slips and smoothed.

    Attributes
    ----------
    received : Received
    raw : RawEpoch
        Without measurements far from what is expected.
    predicted : PredictedRanges
    tracked, channel_ok, settled : (R, N) bool arrays
        Channels with code and carrier; those that pass the checks of channels; those whose filters have settled.
    tracks : Tracks
    correction_m : (tau, R, N) array
        PR_sc [m].
    summaries : mapping from the numbers of a test to MonitorSummary
    exclusions : Exclusions
    """

    received: Received
    raw: RawEpoch
    predicted: PredictedRanges
    tracked: BoolArray
    channel_ok: BoolArray
    settled: BoolArray
    tracks: Tracks
    correction_m: FloatArray
    summaries: Summaries
    exclusions: Exclusions


def track_channels(state: TrackState, received: Received, station: PreparedStation) -> tuple[TrackState, Tracked]:
    """Check the channels, exclude what fails, and smooth the rest."""
    now, raw, params = received.now, received.raw, station.params
    predicted = predict_ranges(received.known.current, now.gps_week, now.tow_s, raw.code_m[:, L1], station.site)
    (tracked, comparable), (correction_m, known_m) = compare(
        raw.code_m, raw.carrier_m, predicted.range_m, predicted.clock_s, received.changed
    )
    checks = _channel_checks(raw, correction_m, tracked, comparable, params)
    excluding = checks if params.signal_power.exclude else checks[:1]
    exclusions = exclude_channels(received.exclusions, excluding, now.events)
    far = _far_receivers(checks[0].result, params)
    exclusions = exclude_receivers(exclusions, far, ExclusionCause.RECEIVER_FAULT, now.events)
    clean = _without(raw, checks[0].result.failed)
    groups, tracks = track(state.groups, clean, now.epoch_ms, known_m, station.filters)
    smoothed_correction_m, settled = finish(
        tracks.smoothed_m, tracks.age_s, tracks.bands.index(L1), predicted.range_m, predicted.clock_s,
        predicted.elevation_rad, params.monitors.elevation_mask_rad, params.smoothing.settle_time_s,
    )  # fmt: skip
    return TrackState(groups=groups), Tracked(
        received=received,
        raw=clean,
        predicted=predicted,
        tracked=tracked,
        channel_ok=_passing(tracked, excluding),
        settled=settled,
        tracks=tracks,
        correction_m=smoothed_correction_m,
        summaries={key: summarise(check.result, tracked) for key, check in zip(_CHECKS, checks, strict=True)},
        exclusions=exclusions,
    )


def _channel_checks(
    raw: RawEpoch, correction_m: FloatArray, tracked: BoolArray, comparable: BoolArray, params: GroundParams
) -> tuple[Verdict, ...]:
    """Monitors of single channels, each ``(R, N)``; the first also keeps measurements out of the filters."""
    residual = check_expected_range(correction_m, comparable, params.expected_range.max_residual_m)
    power = check_signal_power(
        raw.cn0_dbhz[:, L1], tracked, params.signal_power.min_cn0_dbhz, required=params.signal_power.require_cn0
    )
    return tuple(Verdict(TESTS[key][1].cause, result) for key, result in zip(_CHECKS, (residual, power), strict=True))


def _passing(tracked: BoolArray, checks: tuple[Verdict, ...]) -> BoolArray:
    """Channels that are tracked and pass these checks."""
    for check in checks:
        tracked = tracked & ~check.result.failed
    return tracked


def _far_receivers(residual: MonitorResult, params: GroundParams) -> MonitorResult:
    """Receivers far from the expected ranges on several satellites: how many, ``(R,)``.

    Then it is not the satellites but the receiver, its time tag or its position, and what is within the limit is wrong
    too.
    """
    failures = residual.failed.sum(axis=1)
    least = params.monitors.receiver_fault_channels
    return MonitorResult(
        statistic=failures.astype(np.float64), threshold=np.array(float(least)), failed=failures >= least
    )


def _without(raw: RawEpoch, failed: BoolArray) -> RawEpoch:
    """Raw observations without those that must not enter a filter."""
    if not failed.any():
        return raw
    return raw._replace(code_m=np.where(failed[:, np.newaxis, :], np.nan, raw.code_m))
