"""Excessive acceleration, carrier rate and carrier step: does a satellite's carrier go on as it went?

Over the last few epochs the carrier without geometry, satellite clock and troposphere is

    phi* = a + b t + c t^2 / 2,

with the receiver's clock in it. The clock at each epoch is the weighted mean of the satellites that were there all the
time, all but the one it is taken off. Three statistics of each channel are left: the newest carrier against the line
through those before it (step), the slope (rate) and c (acceleration); and each of them again averaged over the
receivers, because what a satellite does all receivers see, with independent noise.

One channel in three or more that fails alone is the channel's fault and has no part in the satellite's average; two, or
one of two, are the satellite's.

Axes: statistics S = 3, receivers R, bands F, satellites N.

Source: Xie, Pullen, Luo, Normark, Akos, Lee, Enge, Pervan, Integrity design and updated test results for the Stanford
LAAS integrity monitor testbed, ION AM 2001 (principle: acceleration, ramp and step of the carrier over some epochs);
Jiang, Milner, Macabiau, ENC 2015 (budget). The removal of the clocks and the thresholds are ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

import numpy as np
from scipy.special import bdtrc

from gbas_core.parameters import Derived, Parameter, ParameterError, parameters
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1, L5, N_BANDS
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.false_alarm import EPOCH_S, EXPOSURE_S, FALSE_EXCLUSION, false_alarm_multiplier
from gbas_ground.monitors.interface import MonitoredEpoch, MonitorOutput, SignalMonitor, Verdict
from gbas_ground.monitors.kernels import carrier_acceleration as kernels
from gbas_ground.monitors.monitor_table import moved, place_of_worst, signal_of, summarise_each, worst_of
from gbas_ground.monitors.result import MonitorResult, upper_limit
from gbas_msgs_py.codes import ExclusionCause
from gbas_msgs_py.monitors import CARRIER_ACCELERATION

if TYPE_CHECKING:
    from gbas_ground.prepared import PreparedStation

STATISTICS: Final = ("step_m", "rate_mps", "acceleration_mps2")
Triple = tuple[float, float, float]
_LEAST_POINTS: Final = 4  # a parabola and one to spare
_MOST_OTHERS: Final = 35
FAULT_RATE_PER_H: Final = 1e-5
"""Faults of one satellite. Known: GPS SPS Performance Standard 2020, major service failures."""


def fewest_others(p_false_alarm: float) -> int:
    """Fewest other satellites a receiver's clock may be taken from.

    A fault of another satellite is in that clock, and with one other a fault of either looks the same: of two, the one
    at fault is further from the clock of the rest. So two have to be left when all that fault at once are out of the
    set, and more than so many may fault only with less than the budget.

    Parameters
    ----------
    p_false_alarm : float
        For one source in 15 s.
    """
    faults = 0
    while bdtrc(faults, _MOST_OTHERS, FAULT_RATE_PER_H * EXPOSURE_S / 3600.0) > p_false_alarm:
        faults += 1
    return faults + 2


FEWEST_OTHERS: Final = fewest_others(FALSE_EXCLUSION)


@parameters
class CarrierAccelerationParams:
    """Step, rate and acceleration of the carriers.

    The noise is that between epochs: white, so less than that of the gradient monitor, which has slow multipath in it.
    What the receivers share (satellite clocks, ionosphere) and what is natural are uncertain, ours: 0.1 m/s is more
    than the ionosphere did in the storm of 30 October 2003 (0.06 to 0.09 m/s on L1), and enters and leaves the
    corrections as it should. The first of the bands is due wherever a channel is, the others where there are epochs
    enough.
    """

    exclude: Annotated[bool, Parameter("satellites and channels that fail are excluded")] = True
    window_s: Annotated[float, Parameter("oldest epoch in the fit", "s", 1.0, 600.0)] = 5.0
    points: Annotated[int, Parameter("most epochs in the fit", "-", _LEAST_POINTS, 120)] = 10
    least_points: Annotated[int, Parameter("fewest epochs in it", "-", _LEAST_POINTS, 120)] = 5
    min_satellites: Annotated[
        int, Parameter("others a receiver's clock is taken from (fewest_others)", "-", 2, 35)
    ] = FEWEST_OTHERS  # fmt: skip
    common: Annotated[
        Triple, Parameter("sigma of step, rate and acceleration that all receivers share", "m, m/s, m/s2", 0.0, 1.0)
    ] = (0.0015, 0.001, 0.0005)
    natural: Annotated[
        Triple, Parameter("largest step, rate and acceleration that are no fault", "m, m/s, m/s2", 0.0, 10.0)
    ] = (0.0, 0.1, 0.005)
    p_false_alarm: Annotated[
        float, Parameter("of one source in 15 s, over all statistics, bands and receivers", "-", 1e-12, 0.5)
    ] = FALSE_EXCLUSION
    max_gap_s: Annotated[float, Derived("longest gap, that of the smoothing", "s", 0.1, 3600.0)] = 3.5
    receiver_factor: Annotated[
        tuple[float, ...], Derived("on the sigma of rr1, rr2, ..., or one for all", "-", 0.1, 10.0)
    ] = (1.0,)
    bands: Annotated[tuple[int, ...], Derived("carriers tested", "-", 0, N_BANDS - 1)] = (L1, L5)
    interval_s: Annotated[float, Derived("between epochs, for the budget", "s", 0.01, 3600.0)] = EPOCH_S

    def __post_init__(self) -> None:
        if not self.bands or len(set(self.bands)) != len(self.bands):
            raise ParameterError(f"bands = {self.bands} is not one or more, each once")
        if self.least_points > self.points:
            raise ParameterError(f"least_points = {self.least_points} is more than points = {self.points}")

    @cached_property
    def noise(self) -> CarrierNoise:
        """Noise between epochs."""
        return CarrierNoise(
            floor_m=(0.0015, 0.0015, 0.003), low_m=(0.006, 0.006, 0.010), receiver_factor=self.receiver_factor
        )

    def multiplier(self, n_receivers: int) -> float:
        """Standard deviations of every threshold: each channel and the average can exclude the source."""
        tests = len(STATISTICS) * len(self.bands) * (n_receivers + 1)
        return false_alarm_multiplier(self.p_false_alarm, tests=tests, interval_s=self.interval_s)

    @cached_property
    def common_and_natural(self) -> FloatArray:
        """What the receivers share and what is no fault, ``(2, S)``."""
        return np.array((self.common, self.natural), dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class CarrierAccelerationState:
    """The last epochs, the newest first.

    Attributes
    ----------
    residual_m : (W, R, F, N) array
        Carriers without geometry; NaN where there is none, or one that does not belong to the newest [m].
    age_s : (W,) array
        Time before the newest epoch; NaN where there is none [s].
    unseen_s : (R, F, N) array
        Time since each carrier was last there; NaN if it never was [s].
    """

    residual_m: FloatArray
    age_s: FloatArray
    unseen_s: FloatArray


def initial_carrier_acceleration(n_receivers: int, params: CarrierAccelerationParams) -> CarrierAccelerationState:
    """A monitor that has seen nothing."""
    return CarrierAccelerationState(
        residual_m=np.full((params.points, n_receivers, len(params.bands), N_SATS), np.nan),
        age_s=np.full(params.points, np.nan),
        unseen_s=np.full((n_receivers, len(params.bands), N_SATS), np.nan),
    )


class Carriers(NamedTuple):
    """What the monitor looks at, at one epoch.

    Attributes
    ----------
    residual_m : (R, F, N) array
        From :func:`~gbas_ground.monitors.double_difference.carrier_residual_m`, of the bands tested [m].
    restarted : (R, F, N) bool array
        Carriers that do not go on from the epoch before.
    due : (R, N) bool array
        Channels that must be monitored: a missing statistic fails.
    elevation_rad : (N,) array
    shift_m : (R, N) array, optional
        Residual of this epoch less what it would be with the ephemerides of the epoch before: what a new ephemeris
        changes, 0 elsewhere [m]. Without it, a new ephemeris is a step.
    """

    residual_m: FloatArray
    restarted: BoolArray
    due: BoolArray
    elevation_rad: FloatArray
    shift_m: FloatArray | None = None


class CarrierAccelerationResult(NamedTuple):
    """What was found.

    Attributes
    ----------
    known : (3, R, F, S, N) array
        Statistics of the channels, their variances and thresholds.
    due : (R, N) bool array
    satellites : MonitorResult
        ``(S, F, N)``: averaged over the receivers. Also failed where channels of several receivers are.
    failed_channels : (R, N) bool array
        Channels that failed alone, or had no statistic.
    failed_satellites : (N,) bool array
    """

    known: FloatArray
    due: BoolArray
    satellites: MonitorResult
    failed_channels: BoolArray
    failed_satellites: BoolArray

    @property
    def channels(self) -> MonitorResult:
        """Size of the statistics of each channel, in the order of :data:`STATISTICS`, ``(S, R, F, N)``."""
        statistic, _, threshold = np.moveaxis(self.known, 3, 1)
        first = (np.arange(statistic.shape[2]) == 0)[:, np.newaxis]
        wanted = self.due[:, np.newaxis] & (first | np.isfinite(statistic[0]))
        return upper_limit(np.abs(statistic), threshold, wanted)


def carrier_acceleration_step(
    state: CarrierAccelerationState, seen: Carriers, dt_s: float, params: CarrierAccelerationParams
) -> tuple[CarrierAccelerationState, CarrierAccelerationResult]:
    """Test one epoch.

    Parameters
    ----------
    state : CarrierAccelerationState
    seen : Carriers
    dt_s : float
        Time since the epoch before [s]; NaN at the first.
    params : CarrierAccelerationParams
    """
    n_receivers, n_bands, n_sats = shape = seen.residual_m.shape
    n_statistics = len(STATISTICS)
    history_m, age_s, unseen_s = np.empty(state.residual_m.shape), np.empty(len(state.age_s)), np.empty(shape)
    known = np.empty((3, n_receivers, n_bands, n_statistics, n_sats))
    satellites = np.empty((2, n_statistics, n_bands, n_sats))
    failed = np.empty(satellites.shape[1:], dtype=bool)
    failed_channels, failed_satellites = np.empty(seen.due.shape, dtype=bool), np.empty(n_sats, dtype=bool)
    kernels.step(
        (state.residual_m, state.age_s, state.unseen_s),
        seen.residual_m,
        seen.restarted,
        seen.due,
        params.noise.sigma_m(seen.elevation_rad, params.bands),
        params.noise.factors(n_receivers),
        np.zeros(seen.due.shape) if seen.shift_m is None else seen.shift_m,
        params.common_and_natural,
        float(dt_s),
        float(params.window_s),
        float(params.max_gap_s),
        params.multiplier(n_receivers),
        params.least_points,
        params.min_satellites,
        (history_m, age_s, unseen_s),
        known,
        satellites,
        failed,
        failed_channels,
        failed_satellites,
    )
    judged = MonitorResult(statistic=satellites[0], threshold=satellites[1], failed=failed)
    return CarrierAccelerationState(residual_m=history_m, age_s=age_s, unseen_s=unseen_s), CarrierAccelerationResult(
        known, seen.due, judged, failed_channels, failed_satellites
    )


# --- in the station


_TESTS: Final = tuple(CARRIER_ACCELERATION.test(name) for name in ("step", "rate", "acceleration"))
"""In the order of the statistics."""
_KEYS: Final = tuple(CARRIER_ACCELERATION.key(test.name) for test in _TESTS)


def _initial(station: PreparedStation) -> CarrierAccelerationState:
    return initial_carrier_acceleration(station.params.n_receivers, station.carrier_acceleration)


def _step(state: CarrierAccelerationState, epoch: MonitoredEpoch) -> tuple[CarrierAccelerationState, MonitorOutput]:
    inputs, params = epoch.inputs, epoch.inputs.station.carrier_acceleration
    seen = Carriers(
        inputs.residual_of(params.bands),
        inputs.slipped.take(params.bands, axis=1),
        inputs.ready & inputs.due,
        inputs.predicted.elevation_rad,
        inputs.shift_m,
    )
    state, found = carrier_acceleration_step(state, seen, inputs.dt_s, params)
    known = np.isfinite(found.satellites.statistic[0, 0])
    signal = signal_of(params.bands)
    return state, MonitorOutput(
        summaries=dict(zip(_KEYS, summarise_each(found.satellites, inputs.due, signal), strict=True)),
        satellites=_satellite_verdicts(found, inputs.due & known) if params.exclude else (),
        channels=_channel_verdicts(found) if params.exclude else (),
        ready=known if params.exclude else None,
    )


def _satellite_verdicts(found: CarrierAccelerationResult, due: BoolArray) -> tuple[Verdict, ...]:
    """A satellite's cause is the statistic that is furthest over its threshold."""
    failed = due & found.failed_satellites
    if not failed.any():
        return ()
    worst = worst_of(found.satellites, axes=2)
    number, _ = place_of_worst(found.satellites, axes=2)
    return tuple(
        Verdict(test.cause, worst._replace(failed=failed & (number == place))) for place, test in enumerate(_TESTS)
    )


def _channel_verdicts(found: CarrierAccelerationResult) -> tuple[Verdict, ...]:
    """The worst statistic of each channel; one that is missing makes nobody fail, but is not ready."""
    if not found.failed_channels.any():
        return ()
    worst = worst_of(moved(found.channels, 2, 1), axes=2)
    failed = found.failed_channels & (worst.statistic > worst.threshold)
    return (Verdict(ExclusionCause.CARRIER_ACCELERATION, worst._replace(failed=failed)),)


MONITOR: Final = SignalMonitor(
    entry=CARRIER_ACCELERATION, parameters=CarrierAccelerationParams, initial=_initial, step=_step
)
