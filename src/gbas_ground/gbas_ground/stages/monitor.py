"""Monitor: what every monitor of signals says of the satellites, and what is excluded for it.

A satellite that fails is excluded from both smoothing constants and all bands, and one that a required monitor cannot
judge yet is not used yet. What a monitor says of the second band alone goes to the stage of that band
(:mod:`~gbas_ground.stages.second_band`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from gbas_core.record import BoolArray, FloatArray
from gbas_core.signals import L1, SPEED_OF_LIGHT_MPS
from gbas_ground.channels.predicted_ranges import predict_ranges
from gbas_ground.consistency import Exclusions, Finding
from gbas_ground.monitors.interface import MonitoredEpoch, MonitorInputs, MonitorOutput, SecondBandOutput, Verdict
from gbas_ground.monitors.kernels.ranges import looked_at
from gbas_ground.monitors.monitor_table import Summaries
from gbas_ground.monitors.registry import SIGNAL_MONITORS
from gbas_ground.monitors.result import MonitorResult
from gbas_ground.prepared import PreparedStation
from gbas_ground.stages.exclusion import exclude_channels, exclude_receivers, exclude_satellites
from gbas_ground.stages.track import Tracked
from gbas_msgs_py.codes import ExclusionCause


@dataclass(frozen=True, kw_only=True, eq=False)
class MonitorState:
    """Memory of this stage.

    Attributes
    ----------
    memories : tuple
        Of :data:`~gbas_ground.monitors.registry.SIGNAL_MONITORS`, in their order.
    in_use : (N,) bool array
        Satellites that were usable at the epoch before.
    """

    memories: tuple[Any, ...]
    in_use: BoolArray


class SignalFindings(NamedTuple):
    """What all monitors of signals found at one epoch.

    Attributes
    ----------
    satellites, channels : tuple of Verdict
        What has to be excluded, and why.
    receivers : MonitorResult
        ``(R,)``: satellites that point to each receiver; it fails where they name it.
    receivers_quiet : (R,) array
        1 where a receiver that is excluded would do on its baselines, 0 where not, NaN where nobody can tell.
    ready : (N,) bool array
        Satellites that every required monitor could judge.
    orbit_bound : (N,) array
        P that the ephemeris monitor supports [m/m].
    summaries : mapping from the numbers of a test to MonitorSummary
    details : mapping from a field of :class:`MonitorDetailEpoch` to its value
    second : tuple of SecondBandOutput
        What monitors said of the second band alone.
    """

    satellites: tuple[Verdict, ...]
    channels: tuple[Verdict, ...]
    receivers: MonitorResult
    receivers_quiet: FloatArray
    ready: BoolArray
    orbit_bound: FloatArray
    summaries: Summaries
    details: Mapping[str, Any]
    second: tuple[SecondBandOutput, ...] = ()

    def passed(self, share: float) -> BoolArray:
        """Satellites that were judged, not failed, and are below `share` of every threshold, ``(N,)``.

        What is excluded just above a threshold must not come back just below it.
        """
        return below(self.ready, self.satellites, share)


def below(ready: BoolArray, satellites: Iterable[Verdict], share: float) -> BoolArray:
    """Those that are ready, not failed, and below a share of every threshold, ``(N,)``."""
    passed = ready
    for _, result, power in satellites:
        passed = passed & ~result.failed
        if power:
            passed = passed & ~(result.statistic > share**power * result.threshold)
    return passed


class Monitored(NamedTuple):
    """Record of this stage.

    Attributes
    ----------
    tracked : Tracked
    signals : SignalFindings
    findings : tuple of Finding
        Satellites that were excluded, and why.
    exclusions : Exclusions
    """

    tracked: Tracked
    signals: SignalFindings
    findings: tuple[Finding, ...]
    exclusions: Exclusions


def initial_monitors(station: PreparedStation) -> tuple[Any, ...]:
    """Memories of monitors that have seen nothing."""
    return tuple(monitor.initial(station) for monitor in SIGNAL_MONITORS)


def monitor_signals(state: MonitorState, tracked: Tracked, station: PreparedStation) -> tuple[MonitorState, Monitored]:
    """Run the monitors of signals, and exclude what fails."""
    events = tracked.received.now.events
    memories, found = run_monitors(state.memories, monitor_inputs(state.in_use, tracked, station))
    exclusions = exclude_channels(tracked.exclusions, found.channels, events)
    exclusions = exclude_receivers(exclusions, found.receivers, ExclusionCause.RECEIVER_BASELINES, events)
    exclusions, findings = exclude_satellites(exclusions, found.satellites)
    return MonitorState(memories=memories, in_use=state.in_use), Monitored(tracked, found, findings, exclusions)


def run_monitors(memories: tuple[Any, ...], inputs: MonitorInputs) -> tuple[tuple[Any, ...], SignalFindings]:
    """Run every monitor over one epoch."""
    epoch = MonitoredEpoch(inputs=inputs, failed=np.zeros_like(inputs.ready))
    after, outputs = [], []
    for monitor, memory in zip(SIGNAL_MONITORS, memories, strict=True):
        memory, output = monitor.step(memory, epoch)
        for verdict in output.channels:
            epoch.failed = epoch.failed | verdict.result.failed
        after.append(memory)
        outputs.append(output)
    return tuple(after), SignalFindings(
        satellites=tuple(verdict for output in outputs for verdict in output.satellites),
        channels=tuple(verdict for output in outputs for verdict in output.channels),
        receivers=epoch.fitting.receivers,
        receivers_quiet=epoch.quiet_receivers,
        ready=_ready(inputs.due, outputs),
        orbit_bound=epoch.orbit_bound,
        summaries={key: each for output in outputs for key, each in output.summaries.items()},
        details={name: each for output in outputs for name, each in output.details.items()},
        second=tuple(output.second for output in outputs if output.second is not None),
    )


def _ready(due: BoolArray, outputs: list[MonitorOutput]) -> BoolArray:
    """Satellites that every required monitor could judge."""
    ready = np.ones_like(due)
    for output in outputs:
        if output.ready is not None:
            ready = ready & output.ready
    return ready


def monitor_inputs(in_use: BoolArray, tracked: Tracked, station: PreparedStation) -> MonitorInputs:
    """What the monitors of signals are given."""
    received, exclusions, predicted = tracked.received, tracked.exclusions, tracked.predicted
    _, n_sats = shape = tracked.channel_ok.shape
    channels, satellites = np.empty((3, *shape), dtype=bool), np.empty((2, n_sats), dtype=bool)
    looked_at(
        tracked.channel_ok,
        tracked.settled,
        exclusions.channels.excluded,
        exclusions.receivers.excluded,
        exclusions.satellites.excluded,
        predicted.elevation_rad,
        float(station.params.monitors.elevation_mask_rad),
        received.known.crc,
        station.params.receivers.minimum,
        channels,
        satellites,
    )
    return MonitorInputs(
        station=station,
        code_m=tracked.raw.code_m,
        carrier_m=tracked.tracks.carrier_m,
        cn0_dbhz=tracked.raw.cn0_dbhz,
        slipped=tracked.tracks.slipped,
        usable=channels[0],
        ready=channels[1],
        suspended=channels[2],
        in_use=in_use,
        due=satellites[0],
        may_refer=satellites[1],
        predicted=predicted,
        rebased=received.changed,
        shift_m=_shift_m(tracked, station),
        dt_s=received.now.dt_s,
    )


def _shift_m(tracked: Tracked, station: PreparedStation) -> FloatArray:
    """Range shift due to another ephemeris than that of the epoch before, ``(R, N)`` [m]."""
    received, predicted = tracked.received, tracked.predicted
    if not received.changed.any():
        return np.zeros_like(predicted.range_m)
    now, code_m = received.now, tracked.raw.code_m[:, L1]
    old = predict_ranges(received.before, now.gps_week, now.tow_s, code_m, station.site)
    shift_m = old.range_m - predicted.range_m - SPEED_OF_LIGHT_MPS * (old.clock_s - predicted.clock_s)
    return np.where(received.changed, shift_m, 0.0)
