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
from gbas_ground.corrections.formation import range_correction_m
from gbas_ground.corrections.second_band import BAND
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

CHECKS: Final = (EXPECTED_RANGE.key("residual"), SIGNAL_POWER.key("cn0"))
"""Tests of single channels, in their order."""
_EVERY_BAND: Final = slice(None)


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
    second_range : Verdict or None
        Of the second band's raw codes, of a station that corrects it.
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
    second_range: Verdict | None = None


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
    second_range = None if station.second is None else _second_range(raw, predicted, params)
    if second_range is not None:
        clean = _without(clean, second_range.result.failed, BAND)
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
        summaries={key: summarise(check.result, tracked) for key, check in zip(CHECKS, checks, strict=True)},
        exclusions=exclusions,
        second_range=second_range,
    )


def _channel_checks(
    raw: RawEpoch, correction_m: FloatArray, tracked: BoolArray, comparable: BoolArray, params: GroundParams
) -> tuple[Verdict, ...]:
    """Monitors of single channels, each ``(R, N)``; the first also keeps measurements out of the filters."""
    residual = check_expected_range(correction_m, comparable, params.expected_range.max_residual_m)
    power = check_signal_power(
        raw.cn0_dbhz[:, L1], tracked, params.signal_power.min_cn0_dbhz, required=params.signal_power.require_cn0
    )
    return tuple(Verdict(TESTS[key][1].cause, result) for key, result in zip(CHECKS, (residual, power), strict=True))


def _second_range(raw: RawEpoch, predicted: PredictedRanges, params: GroundParams) -> Verdict:
    """Raw codes of the second band against the expected ranges; the satellite clock is that of L1, as the corrections
    of every band have it."""
    code_m = raw.code_m[:, BAND]
    comparable = np.isfinite(code_m + raw.carrier_m[:, BAND] + predicted.clock_s)
    correction_m = range_correction_m(predicted.range_m, code_m, predicted.clock_s)
    result = check_expected_range(correction_m, comparable, params.expected_range.max_residual_m)
    return Verdict(TESTS[CHECKS[0]][1].cause, result)


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


def _without(raw: RawEpoch, failed: BoolArray, bands: int | slice = _EVERY_BAND) -> RawEpoch:
    """Raw observations without the codes that must not enter a filter."""
    if not failed.any():
        return raw
    code_m = raw.code_m.copy()
    code_m[:, bands] = np.where(failed if isinstance(bands, int) else failed[:, np.newaxis], np.nan, code_m[:, bands])
    return raw._replace(code_m=code_m)
