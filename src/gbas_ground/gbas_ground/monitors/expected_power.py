"""C/N0 against what is expected at the satellite's elevation: low power.

A satellite that transmits with less power than it should is seen by all receivers; its C/N0, averaged over a short time
and over the receivers, is compared with a minimum that depends on the elevation. Beside the table of the configuration
a station can learn what its receivers see at each elevation; what it has learnt can raise a minimum but never lower it
below the table, so that power that fades slowly is still found in the end. A channel of its own is only compared with
the table less a margin; see also :mod:`~gbas_ground.monitors.signal_power` for the absolute minimum.

Axes: receivers R, bands F, satellites N, bins of elevation E.

Source: LAAS signal power monitor, average over receivers against a threshold by elevation (known as a principle,
numbers ours).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.parameters import Derived, Parameter, ParameterError, parameters
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1, L5, N_BANDS
from gbas_ground.monitors.false_alarm import EPOCH_S, FALSE_EXCLUSION, false_alarm_multiplier
from gbas_ground.monitors.interface import (
    MonitoredEpoch,
    MonitorOutput,
    SecondBandOutput,
    SignalMonitor,
    Verdict,
    verdicts,
)
from gbas_ground.monitors.kernels import power as kernels
from gbas_ground.monitors.monitor_table import moved, signal_of, summarise, worst_of
from gbas_ground.monitors.result import MonitorResult
from gbas_msgs_py.monitors import EXPECTED_POWER

if TYPE_CHECKING:
    from gbas_ground.prepared import PreparedStation

BIN_RAD: Final = float(np.radians(5.0))
"""Width of the bins of elevation a station learns in [rad]. Ours."""
N_BINS: Final = 18

# Uncertain, ours: what two geodetic receivers of 2024 never went below, less 2 dB, which is also about what the
# specified minimum powers give (-158.5 dBW on L1 over -201.5 dBW/Hz: 43 dB-Hz, less the gain lost towards the horizon
# and 5 dB for losses and fading). To be replaced by the site's own.
_ELEVATION_RAD: Final = tuple(float(each) for each in np.radians([5.0, 15.0, 30.0, 60.0, 90.0]))
_MINIMUM_DBHZ: Final = (
    (29.0, 32.0, 34.0, 37.0, 37.0),
    (25.0, 28.0, 30.0, 33.0, 33.0),
    (26.0, 28.0, 30.0, 33.0, 34.0),
)


@parameters
class PowerExpectationParams:
    """C/N0 against what is expected at the elevation.

    The first of the bands is due wherever a channel is, the others where they are measured. With the average of 1 s, at
    two epochs a second, a drop by twice the margin there is is found at once, and one by 1.07 of it in 1.5 s.
    """

    exclude: Annotated[bool, Parameter("satellites and channels that fail are excluded")] = True
    elevation_rad: Annotated[
        tuple[float, ...], Parameter("nodes of the table, rising; constant beyond them", "deg", 0.0, 90.0)
    ] = _ELEVATION_RAD
    minimum_l1_dbhz: Annotated[tuple[float, ...], Parameter("at the nodes", "dB-Hz", 0.0, 70.0)] = _MINIMUM_DBHZ[0]
    minimum_l2_dbhz: Annotated[tuple[float, ...], Parameter("at the nodes", "dB-Hz", 0.0, 70.0)] = _MINIMUM_DBHZ[1]
    minimum_l5_dbhz: Annotated[tuple[float, ...], Parameter("at the nodes", "dB-Hz", 0.0, 70.0)] = _MINIMUM_DBHZ[2]
    channel_margin_db: Annotated[
        float, Parameter("a single channel may be this much lower: fading of one antenna", "dB", 0.0, 40.0)
    ] = 4.0
    average_s: Annotated[float, Parameter("time constant of the average", "s", 0.1, 600.0)] = 1.0
    learn: Annotated[bool, Parameter("let what the receivers saw raise the minimum")] = False
    drop_db: Annotated[
        float, Parameter("a satellite may be this much below what was learnt: satellites differ", "dB", 0.1, 40.0)
    ] = 6.0
    learn_s: Annotated[float, Parameter("time constant of what is learnt", "s", 1.0, 1e7)] = 86_400.0
    learnt_after_s: Annotated[float, Parameter("time a bin is learnt for before it counts", "s", 1.0, 1e7)] = 3600.0
    max_gap_s: Annotated[float, Derived("longest gap, that of the smoothing", "s", 0.1, 3600.0)] = 3.5
    bands: Annotated[tuple[int, ...], Derived("bands tested", "-", 0, N_BANDS - 1)] = (L1, L5)

    def __post_init__(self) -> None:
        nodes = np.array(self.elevation_rad)
        if nodes.size == 0 or (np.diff(nodes) <= 0.0).any():
            raise ParameterError("elevation_deg is not one node or more, rising")
        for name in ("minimum_l1_dbhz", "minimum_l2_dbhz", "minimum_l5_dbhz"):
            if len(getattr(self, name)) != nodes.size:
                raise ParameterError(f"{name} = {getattr(self, name)} is not one number a node of elevation_deg")
        if not self.bands or len(set(self.bands)) != len(self.bands):
            raise ParameterError(f"bands = {self.bands} is not one or more, each once")

    @property
    def minimum_dbhz(self) -> tuple[tuple[float, ...], ...]:
        """Minimum at the nodes, one row for each of the bands L1, L2, L5 [dB-Hz]."""
        return (self.minimum_l1_dbhz, self.minimum_l2_dbhz, self.minimum_l5_dbhz)

    @cached_property
    def tables(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """Bands tested ``(F,)``, nodes ``(K,)`` [rad] and their minimum ``(F, K)`` [dB-Hz]."""
        values = [self.minimum_dbhz[band] for band in self.bands]
        return np.array(self.bands), np.array(self.elevation_rad, dtype=float), np.array(values, dtype=float)


def minimum_from_expectation(
    expected_dbhz: ArrayLike,
    sigma_db: float,
    n_receivers: int,
    *,
    probability: float = FALSE_EXCLUSION,
    interval_s: float = EPOCH_S,
) -> FloatArray:
    """Minimum for a table, from the C/N0 a site expects and how much the average of a receiver varies.

    Parameters
    ----------
    expected_dbhz : (...) array
        Mean of the weakest healthy satellite at each elevation [dB-Hz].
    sigma_db : float
        Sigma of one receiver's averaged C/N0 about it [dB].
    n_receivers : int
        Receivers whose fading is independent.
    probability, interval_s
        As of :func:`~gbas_ground.monitors.false_alarm.false_alarm_multiplier`; one-sided.
    """
    k = false_alarm_multiplier(probability, sides=1, interval_s=interval_s)
    return np.asarray(np.asarray(expected_dbhz, dtype=np.float64) - k * sigma_db / np.sqrt(n_receivers))


@dataclass(frozen=True, kw_only=True, eq=False)
class PowerExpectationState:
    """Averages, and what was learnt.

    Attributes
    ----------
    averages : (2, R, F, N) array
        Averaged C/N0, NaN where there is none; time since C/N0 was last there, NaN if it never was [s].
    learnt : (2, R, F, E) array
        Mean C/N0 in each bin of elevation; time learnt [s].
    """

    averages: FloatArray
    learnt: FloatArray


def initial_power_expectation(n_receivers: int, params: PowerExpectationParams) -> PowerExpectationState:
    """A monitor that has seen nothing."""
    leading = (2, n_receivers, len(params.bands))
    return PowerExpectationState(averages=np.full((*leading, N_SATS), np.nan), learnt=np.zeros((*leading, N_BINS)))


class PowerExpectationResult(NamedTuple):
    """Minus C/N0, so that larger is worse like everywhere, and minus the minimum [dB-Hz].

    Attributes
    ----------
    channels : MonitorResult
        ``(R, F, N)``.
    satellites : MonitorResult
        ``(F, N)``, averaged over the receivers.
    """

    channels: MonitorResult
    satellites: MonitorResult


def power_expectation_step(
    state: PowerExpectationState,
    cn0_dbhz: FloatArray,
    due: BoolArray,
    elevation_rad: FloatArray,
    dt_s: float,
    params: PowerExpectationParams,
) -> tuple[PowerExpectationState, PowerExpectationResult]:
    """Test one epoch.

    Parameters
    ----------
    state : PowerExpectationState
    cn0_dbhz : (R, N_BANDS, N) array
        NaN where a receiver gives none.
    due : (R, N) bool array
        Channels that must be monitored: without C/N0 they fail. Only these are learnt from.
    elevation_rad : (N,) array
    dt_s : float
        Time since the epoch before [s]; NaN at the first.
    params : PowerExpectationParams

    Returns
    -------
    state : PowerExpectationState
    result : PowerExpectationResult
        A channel that fails alone still has a part in the average: that its own power is low lowers the mean of four
        receivers by a quarter of it, and the table's margin has to pass that.
    """
    _, n_bands, n_sats = shape = state.averages.shape[1:]
    averages, learnt = np.empty(state.averages.shape), state.learnt
    channels, channels_failed = np.empty((2, *shape)), np.empty(shape, dtype=bool)
    satellites, satellites_failed = np.empty((2, n_bands, n_sats)), np.empty((n_bands, n_sats), dtype=bool)
    bands, dt_s = params.tables[0], float(dt_s)
    kernels.step(
        state.averages,
        learnt,
        cn0_dbhz,
        due,
        elevation_rad,
        *params.tables,
        float(params.channel_margin_db),
        bool(params.learn),
        float(params.drop_db),
        float(params.learnt_after_s),
        BIN_RAD,
        dt_s,
        float(params.average_s),
        float(params.max_gap_s),
        averages,
        channels,
        channels_failed,
        satellites,
        satellites_failed,
    )
    if params.learn and 0.0 < dt_s <= params.max_gap_s:
        failed, learnt = (channels_failed, satellites_failed), np.empty(learnt.shape)
        kernels.teach(
            state.learnt, cn0_dbhz, bands, due, *failed, elevation_rad, dt_s, float(params.learn_s), BIN_RAD, learnt
        )
    return PowerExpectationState(averages=averages, learnt=learnt), PowerExpectationResult(
        channels=MonitorResult(statistic=channels[0], threshold=channels[1], failed=channels_failed),
        satellites=MonitorResult(statistic=satellites[0], threshold=satellites[1], failed=satellites_failed),
    )


# --- in the station


def _initial(station: PreparedStation) -> PowerExpectationState:
    return initial_power_expectation(station.params.n_receivers, station.expected_power)


def _step(state: PowerExpectationState, epoch: MonitoredEpoch) -> tuple[PowerExpectationState, MonitorOutput]:
    """A receiver that gives no C/N0 fails where the station requires it, and is not looked at otherwise."""
    inputs, params = epoch.inputs, epoch.inputs.station.expected_power
    due = inputs.ready & inputs.due
    if not inputs.station.params.signal_power.require_cn0:
        due = due & np.isfinite(inputs.cn0_dbhz[:, L1])
    state, found = power_expectation_step(
        state, inputs.cn0_dbhz, due, inputs.predicted.elevation_rad, inputs.dt_s, params
    )
    if inputs.station.second is not None and len(params.bands) > 1:
        return state, _by_band(found, np.logical_or.reduce(due), epoch)
    summary = summarise(found.satellites, np.logical_or.reduce(due), signal_of(params.bands))
    satellites = MonitorResult(statistic=summary.statistic, threshold=summary.threshold, failed=summary.failed)
    test = EXPECTED_POWER.test("satellite")
    channels: tuple[Verdict, ...] = ()
    if params.exclude and found.channels.failed.any():
        channels = (Verdict(test.cause, worst_of(moved(found.channels, 1, 0), axes=1)),)
    return state, MonitorOutput(
        summaries={EXPECTED_POWER.key(test.name): summary},
        satellites=verdicts(params.exclude, test.cause, satellites, inputs.due),
        channels=channels,
    )


def _by_band(found: PowerExpectationResult, due: BoolArray, epoch: MonitoredEpoch) -> MonitorOutput:
    """The same where both bands are corrected: power is of the band, and what L5 fails is not used there alone."""
    inputs, params = epoch.inputs, epoch.inputs.station.expected_power
    test, key = EXPECTED_POWER.test("satellite"), EXPECTED_POWER.key("satellite")
    said: list[SecondBandOutput] = []
    for band in (L1, L5):
        place = params.bands.index(band)
        result = _of_band(found.satellites, np.s_[place])
        measured = due if band == L1 else due & np.isfinite(result.statistic)
        summary = summarise(result, measured, signal_of((band,)))
        channels = _of_band(found.channels, np.s_[:, place])
        of_channels = (Verdict(test.cause, channels),) if params.exclude and channels.failed.any() else ()
        said.append(SecondBandOutput(
            summaries={key: summary}, satellites=verdicts(params.exclude, test.cause, result, inputs.due),
            channels=of_channels,
        ))  # fmt: skip
    first, second = said
    return MonitorOutput(summaries=first.summaries, satellites=first.satellites, channels=first.channels, second=second)


def _of_band(result: MonitorResult, place: Any) -> MonitorResult:
    """What a result says at a place of its axes."""
    threshold = np.broadcast_to(result.threshold, result.statistic.shape)
    return MonitorResult(statistic=result.statistic[place], threshold=threshold[place], failed=result.failed[place])


MONITOR: Final = SignalMonitor(entry=EXPECTED_POWER, parameters=PowerExpectationParams, initial=_initial, step=_step)
