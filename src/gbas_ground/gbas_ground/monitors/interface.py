"""What a monitor of signals is given and what it answers: one interface for all of them.

A monitor is a module of this package that has ``MONITOR``, a :class:`SignalMonitor`: its entry in the contract, its
parameters, its memory before the first epoch, and its step. The station runs those of
:mod:`gbas_ground.monitors.registry`, in that order, each blind to what the others make of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from gbas_core.ranging.predicted_ranges import PredictedRanges
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import CLOCK_GROUPS
from gbas_ground.monitors.double_difference import carrier_residual_m
from gbas_ground.monitors.kernels.ranges import common_channels
from gbas_ground.monitors.monitor_table import Summaries
from gbas_ground.monitors.receiver_baselines import FittingDifferences, fitting_differences, quiet_receivers
from gbas_ground.monitors.result import MonitorResult
from gbas_msgs_py.codes import ExclusionCause
from gbas_msgs_py.monitors import Monitor

if TYPE_CHECKING:
    from gbas_ground.prepared import PreparedStation

_NOTHING: Final[Mapping[str, Any]] = {}


@dataclass(frozen=True, kw_only=True, eq=False)
class MonitorInputs:
    """What monitors may look at, at one epoch.

    Attributes
    ----------
    station : PreparedStation
    code_m, carrier_m, cn0_dbhz : (R, N_BANDS, N) arrays
        Of all channels that were measured; NaN where not.
    slipped : (R, N_BANDS, N) bool array
        Cycle slips: where a carrier and the one before do not belong together.
    usable : (R, N) bool array
        Channels of satellites above the mask that are tracked, and that nothing excludes, nor their satellite.
    ready : (R, N) bool array
        Channels whose smoothing filter has settled, and whose receiver is not excluded either.
    suspended : (R, N) bool array
        Channels that have settled too, of receivers that are excluded.
    in_use : (N,) bool array
        Satellites that were broadcast at the epoch before.
    due : (N,) bool array
        Satellites eligible for broadcast before monitoring.
    may_refer : (N,) bool array
        Satellites others may be compared with.
    predicted : PredictedRanges
    rebased : (N,) bool array
        Satellites whose ephemeris is another than at the epoch before.
    shift_m : (R, N) array
        Range shift due to that change [m].
    dt_s : float
        Time since the epoch before; NaN at the first [s].
    """

    station: PreparedStation
    code_m: FloatArray
    carrier_m: FloatArray
    cn0_dbhz: FloatArray
    slipped: BoolArray
    usable: BoolArray
    ready: BoolArray
    suspended: BoolArray
    in_use: BoolArray
    due: BoolArray
    may_refer: BoolArray
    predicted: PredictedRanges
    rebased: BoolArray
    shift_m: FloatArray
    dt_s: float

    def residual_of(self, bands: tuple[int, ...]) -> FloatArray:
        """Carriers of some bands without what is expected of them, ``(R, F, N)`` [m]."""
        if bands not in self._residuals:
            predicted = self.predicted
            expected = predicted.range_m, predicted.clock_s, self._delay_m
            self._residuals[bands] = carrier_residual_m(self.carrier_m, *expected, bands)
        return self._residuals[bands]

    @cached_property
    def _residuals(self) -> dict[tuple[int, ...], FloatArray]:
        return {}

    @cached_property
    def _delay_m(self) -> FloatArray:
        """Of the troposphere, ``(R, N)`` [m]."""
        station, predicted = self.station, self.predicted
        place_m = station.gradient_site.baselines.place_m
        return station.troposphere.delay_m(predicted.elevation_rad, predicted.azimuth_rad, place_m)


@dataclass(eq=False)
class MonitoredEpoch:
    """One epoch on its way through the monitors: the inputs, and what the monitors before have failed.

    Attributes
    ----------
    inputs : MonitorInputs
    failed : (R, N) bool array
        Channels that a monitor before has failed.
    """

    inputs: MonitorInputs
    failed: BoolArray

    @cached_property
    def steady(self) -> BoolArray:
        """Channels to take double differences of, ``(R, N)``.

        A channel that jumped alone must not make a gradient of its satellite, nor what is left of a receiver's channels
        when there are not enough of them.
        """
        steady = np.empty(self.failed.shape, dtype=bool)
        least = self.inputs.station.params.monitors.min_common_satellites
        common_channels(self.inputs.ready, self.failed, CLOCK_GROUPS, least, steady)
        return steady

    @cached_property
    def fitting(self) -> FittingDifferences:
        """Double differences, and the receiver that they name."""
        return fitting_differences(self.steady, self.inputs, self.inputs.station)

    @cached_property
    def orbit_bound(self) -> FloatArray:
        """P that the ephemeris monitor supports, ``(N,)``; nothing when it excludes nothing [m/m]."""
        return self.inputs.station.orbit_bound(self.fitting.differences, self.inputs.predicted.elevation_rad)

    @cached_property
    def quiet_receivers(self) -> FloatArray:
        """1 where an excluded receiver would do on its baselines, 0 where not, NaN where nobody can tell, ``(R,)``."""
        return quiet_receivers(self.steady, self.inputs, self.inputs.station)


class Verdict(NamedTuple):
    """What a monitor decided about satellites ``(N,)`` or channels ``(R, N)``, where that counts.

    Attributes
    ----------
    cause : ExclusionCause
    result : MonitorResult
    power : int
        Of noise in the statistic, 1 for a size and 2 for its square: a share s of the threshold is then s or s^2 of
        it. 0 where a share of the threshold means nothing.
    """

    cause: ExclusionCause
    result: MonitorResult
    power: int = 0


class SecondBandOutput(NamedTuple):
    """What a monitor says of the second band where the first must not pay for it.

    Attributes
    ----------
    summaries : mapping from the numbers of a test to MonitorSummary
    satellites, channels : tuple of Verdict
        Whose corrections of that band must not be used, and why.
    ready : (N,) bool array or None
        Satellites it could judge, where that is required.
    """

    summaries: Summaries
    satellites: tuple[Verdict, ...] = ()
    channels: tuple[Verdict, ...] = ()
    ready: BoolArray | None = None


class MonitorOutput(NamedTuple):
    """What a monitor has to say.

    Attributes
    ----------
    summaries : mapping from the numbers of a test to MonitorSummary
    details : mapping from a field of :class:`MonitorDetailEpoch` to its value
    satellites, channels : tuple of Verdict
        What follows from it; nothing from a monitor that is only watched.
    ready : (N,) bool array or None
        Satellites it could judge, where that is required.
    second : SecondBandOutput or None
        The same of the second band alone, of a station that corrects it.
    """

    summaries: Summaries
    details: Mapping[str, Any] = _NOTHING
    satellites: tuple[Verdict, ...] = ()
    channels: tuple[Verdict, ...] = ()
    ready: BoolArray | None = None
    second: SecondBandOutput | None = None


@dataclass(frozen=True, kw_only=True)
class SignalMonitor:
    """A monitor of signals.

    Attributes
    ----------
    entry : Monitor
        Number, name, tests with cause and unit, what it judges, and what it looks for.
    parameters : type or None
        Its section in a station's file; None when there is nothing to set.
    initial : callable
        ``initial(station) -> state`` before the first epoch.
    step : callable
        ``step(state, epoch) -> (state, MonitorOutput)``; `epoch` is a :class:`MonitoredEpoch`.
    """

    entry: Monitor
    parameters: type | None
    initial: Callable[[PreparedStation], Any]
    step: Callable[[Any, MonitoredEpoch], tuple[Any, MonitorOutput]]


def no_memory(_: PreparedStation) -> None:
    """The memory of a monitor that has none."""


def verdicts(
    exclude: bool, cause: ExclusionCause, result: MonitorResult, due: BoolArray, power: int = 0
) -> tuple[Verdict, ...]:
    """The failures of satellites that are due, unless the monitor is only watched."""
    if not exclude:
        return ()
    return (Verdict(cause, MonitorResult(result.statistic, result.threshold, result.failed & due), power),)
