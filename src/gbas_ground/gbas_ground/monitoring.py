"""All monitors of the satellites' signals at one epoch: what they need, in which order, and what their verdict means.

The monitors themselves are in :mod:`gbas_ground.monitors`, each blind to the others. Here they are given the same
channels, and their verdicts become exclusions of satellites: a satellite that fails is excluded from both smoothing
constants and all bands, and one that a required monitor cannot judge yet is not used yet.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np

from gbas_core.ranging.divergence import DivergenceState
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import CLOCK_GROUPS, missing
from gbas_core.signals import L1, L5, N_BANDS
from gbas_ground.channels.predicted_ranges import PredictedRanges
from gbas_ground.claims.limits import MAX_DECORRELATION
from gbas_ground.claims.orbit_claim import OrbitSite, orbit_bound
from gbas_ground.monitors.carrier_acceleration import (
    CarrierAccelerationParams,
    CarrierAccelerationResult,
    CarrierAccelerationState,
    carrier_acceleration_step,
    initial_carrier_acceleration,
)
from gbas_ground.monitors.code_carrier_divergence import CcdParams, ccd_step, initial_ccd
from gbas_ground.monitors.common_slip import check_common_slip
from gbas_ground.monitors.divergence_classification import MODES, NO_FAULT, classify
from gbas_ground.monitors.double_difference import (
    DoubleDifferences,
    Troposphere,
    carrier_residual_m,
    double_differences,
    reference_satellites,
)
from gbas_ground.monitors.ephemeris_residual import (
    EphemerisResidualParams,
    EphemerisResidualState,
    ephemeris_residual_step,
    initial_ephemeris_residual,
)
from gbas_ground.monitors.ionosphere_gradient import (
    GradientResult,
    GradientSite,
    IonosphereGradientParams,
    check_ionosphere_gradient,
    gradient_site,
)
from gbas_ground.monitors.monitor_table import MonitorSummary, place_of_worst, summarise, worst_of
from gbas_ground.monitors.power_expectation import (
    PowerExpectationParams,
    PowerExpectationState,
    initial_power_expectation,
    power_expectation_step,
)
from gbas_ground.monitors.result import MonitorResult
from gbas_ground.monitors.shared_receiver import Planes, SharedReceiver, planes_of, seen_quiet, shared_receiver
from gbas_ground.monitors.two_frequency_divergence import (
    TwoFrequencyEpoch,
    TwoFrequencyInput,
    TwoFrequencyParams,
    TwoFrequencyState,
    initial_two_frequency,
    two_frequency_step,
)
from gbas_ground.params import GroundParams
from gbas_msgs_py.codes import ExclusionCause
from gbas_msgs_py.records import BASELINES, MAX_REFERENCE_RECEIVERS

_CARRIER_CAUSES: Final = (
    ("carrier_step", ExclusionCause.CARRIER_STEP),
    ("carrier_rate", ExclusionCause.CARRIER_RATE),
    ("acceleration", ExclusionCause.CARRIER_ACCELERATION),
)
"""Names and causes in the order of the acceleration monitor's statistics."""
_GRADUAL: Final = frozenset(
    {
        ExclusionCause.CODE_CARRIER_DIVERGENCE,
        ExclusionCause.TWO_FREQUENCY_DIVERGENCE,  # a square
        ExclusionCause.IONOSPHERE_GRADIENT,
        ExclusionCause.EPHEMERIS_RESIDUAL,
    }
)
"""Causes whose statistic is a size in noise; a share of its threshold means something."""


class MonitorInputs(NamedTuple):
    """What monitors may look at, at one epoch.

    Attributes
    ----------
    code_m, carrier_m, cn0_dbhz : (R, N_BANDS, N) arrays
        Of all channels that were measured; NaN where not.
    slipped : (R, N_BANDS, N) bool array
        Where a carrier and the one before do not belong together.
    usable : (R, N) bool array
        Channels of satellites above the mask that are tracked, and that nothing excludes, nor their satellite.
    ready : (R, N) bool array
        Channels whose smoothing filter has settled, and whose receiver is not excluded either.
    suspended : (R, N) bool array
        Channels that have settled too, of receivers that are excluded.
    in_use : (N,) bool array
        Satellites that were broadcast at the epoch before.
    due : (N,) bool array
        Satellites that would be broadcast if nothing else were against it.
    may_refer : (N,) bool array
        Satellites others may be compared with.
    expected : PredictedRanges
    rebased : (N,) bool array
        Satellites whose ephemeris is another than at the epoch before.
    shift_m : (R, N) array
        What another ephemeris adds to a carrier less what is expected of it [m].
    dt_s : float
        Time since the epoch before; NaN at the first [s].
    """

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


@dataclass(frozen=True, kw_only=True, eq=False)
class MonitoringState:
    """What the monitors remember between epochs."""

    ccd: DivergenceState
    ccd_f: TwoFrequencyState
    acceleration: CarrierAccelerationState
    ephemeris: EphemerisResidualState
    power: PowerExpectationState


class Verdict(NamedTuple):
    """What one monitor decided about satellites ``(N,)`` or channels ``(R, N)``, where that counts."""

    cause: ExclusionCause
    result: MonitorResult


class _MonitorOutput(NamedTuple):
    """What one monitor has to say.

    Attributes
    ----------
    summaries : mapping from a monitor's name to MonitorSummary
    details : mapping from a field of :class:`MonitorEpoch` to its value
    satellites, channels : tuple of Verdict
        What follows from it; nothing from a monitor that is only watched.
    ready : (N,) bool array or None
        Satellites it could judge, where that is required.
    """

    summaries: Mapping[str, MonitorSummary]
    details: Mapping[str, Any] = {}
    satellites: tuple[Verdict, ...] = ()
    channels: tuple[Verdict, ...] = ()
    ready: BoolArray | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class MonitoringResult:
    """What all monitors found at one epoch.

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
        P that the ephemeris monitor supports, :func:`~gbas_ground.claims.orbit_claim.orbit_bound` [m/m].
    summaries : mapping from a monitor's name to MonitorSummary
    details : mapping from a field of :class:`MonitorEpoch` to its value
    """

    satellites: tuple[Verdict, ...]
    channels: tuple[Verdict, ...]
    receivers: MonitorResult
    receivers_quiet: FloatArray
    ready: BoolArray
    orbit_bound: FloatArray
    summaries: Mapping[str, MonitorSummary]
    details: Mapping[str, Any]

    def passed(self, share: float) -> BoolArray:
        """Satellites that were judged, not failed, and are below `share` of every threshold, ``(N,)``.

        What is excluded just above a threshold must not come back just below it.
        """
        passed = self.ready
        for cause, result in self.satellites:
            passed = passed & ~result.failed
            if cause in _GRADUAL:
                part = share**2 if cause == ExclusionCause.TWO_FREQUENCY_DIVERGENCE else share
                passed = passed & ~(result.statistic > part * result.threshold)
        return passed


class _Settings(NamedTuple):
    """Parameters and constants of the monitors; made once from the station's parameters."""

    ccd: CcdParams
    ccd_f: TwoFrequencyParams
    acceleration: CarrierAccelerationParams
    gradient: IonosphereGradientParams
    gradient_required: bool
    ephemeris: EphemerisResidualParams
    orbit_required: bool
    power: PowerExpectationParams
    site: GradientSite
    orbit_site: OrbitSite
    planes: tuple[Planes, ...]
    troposphere: Troposphere


@lru_cache(maxsize=8)
def _settings(params: GroundParams) -> _Settings:
    gradient = params.gradient_monitor()
    site = gradient_site(params.receiver_positions_m(), params.reference_point_m(), gradient)
    return _Settings(
        ccd=params.ccd_monitor(),
        ccd_f=params.ccd_f_monitor(),
        acceleration=params.carrier_acceleration_monitor(),
        gradient=gradient,
        gradient_required=gradient.required or params.gast_d.enabled,
        ephemeris=params.ephemeris_monitor(),
        orbit_required=not params.ephemeris.external_monitor
        and (params.ephemeris_residual.required or params.gast_d.enabled),
        power=params.expected_power_monitor(),
        site=site,
        orbit_site=params.orbit_site(),
        planes=planes_of(site.baselines, gradient.bands),
        troposphere=Troposphere(
            refractivity=params.atmosphere.refractivity, scale_height_m=params.atmosphere.scale_height_m
        ),
    )


def initial_monitoring(params: GroundParams) -> MonitoringState:
    """Monitors that have seen nothing."""
    settings, count = _settings(params), params.n_receivers
    return MonitoringState(
        ccd=initial_ccd(settings.ccd, count),
        ccd_f=initial_two_frequency(settings.ccd_f, count),
        acceleration=initial_carrier_acceleration(count, settings.acceleration),
        ephemeris=initial_ephemeris_residual(len(settings.site.baselines), settings.ephemeris),
        power=initial_power_expectation(count, settings.power),
    )


def run_monitors(
    state: MonitoringState, inputs: MonitorInputs, params: GroundParams
) -> tuple[MonitoringState, MonitoringResult]:
    """Run every monitor over one epoch."""
    settings = _settings(params)
    residual_m = _residual_m(inputs, settings)
    ccd, divergence = _ccd(state.ccd, inputs, settings, exclude=params.ccd.exclude)
    ccd_f, two_frequency = _ccd_f(state.ccd_f, inputs, settings, params.ccd_f.exclude)
    acceleration, carrier = _acceleration(
        state.acceleration, residual_m, inputs, settings, exclude=params.carrier_acceleration.exclude
    )
    # A channel that jumped alone must not make a gradient of its satellite, nor what is left of a receiver's channels.
    steady = inputs.ready & _enough(inputs.ready, params.monitors.min_common_satellites)
    for verdict in carrier.channels:
        steady = steady & ~verdict.result.failed
    differences, receivers = _fitting_differences(residual_m, steady, inputs, settings, params)
    gradient = _gradient(differences, inputs, settings, exclude=params.ionosphere_gradient.exclude)
    ephemeris, orbit, bound = _ephemeris(
        state.ephemeris, differences, inputs, settings, exclude=params.ephemeris_residual.exclude
    )
    power, expectation = _power(
        state.power, inputs, settings, exclude=params.expected_power.exclude, required=params.signal_power.require_cn0
    )
    parts = (_common_slip(inputs), divergence, two_frequency, carrier, gradient, orbit, expectation)
    ready = np.ones_like(inputs.due)
    for part in parts:
        if part.ready is not None:
            ready = ready & part.ready
    result = MonitoringResult(
        satellites=tuple(verdict for part in parts for verdict in part.satellites),
        channels=tuple(verdict for part in parts for verdict in part.channels),
        receivers=receivers,
        receivers_quiet=_quiet_receivers(residual_m, steady, inputs, settings, params),
        ready=ready,
        orbit_bound=bound,
        summaries={name: each for part in parts for name, each in part.summaries.items()},
        details={name: each for part in parts for name, each in part.details.items()},
    )
    state = MonitoringState(ccd=ccd, ccd_f=ccd_f, acceleration=acceleration, ephemeris=ephemeris, power=power)
    return state, result


def _common_slip(inputs: MonitorInputs) -> _MonitorOutput:
    """A satellite that steps has no settled filters any more, so `due` does not have it."""
    tracked = np.isfinite(inputs.code_m[:, L1] + inputs.carrier_m[:, L1])
    result = check_common_slip(inputs.slipped[:, L1], tracked, inputs.in_use)
    return _MonitorOutput(
        summaries={"common_slip": summarise(result, inputs.in_use)},
        satellites=(Verdict(ExclusionCause.COMMON_SLIP, result),),
    )


def _ccd(
    state: DivergenceState, inputs: MonitorInputs, settings: _Settings, *, exclude: bool
) -> tuple[DivergenceState, _MonitorOutput]:
    state, epoch = ccd_step(
        state, inputs.code_m, inputs.carrier_m, inputs.slipped, inputs.ready, inputs.dt_s, settings.ccd
    )
    result = _row(epoch.satellites, L1)
    by_receiver = missing(MAX_REFERENCE_RECEIVERS)
    by_receiver[: len(epoch.receiver_mps)] = epoch.receiver_mps[:, L1]
    return state, _MonitorOutput(
        summaries={"ccd": summarise(result, inputs.due)},
        details={"ccd_receiver_mps": by_receiver},
        satellites=_verdicts(exclude, (ExclusionCause.CODE_CARRIER_DIVERGENCE, result), inputs.due),
        ready=epoch.receivers[L1] > 0 if exclude else None,
    )


def _ccd_f(
    state: TwoFrequencyState, inputs: MonitorInputs, settings: _Settings, exclude: str
) -> tuple[TwoFrequencyState, _MonitorOutput]:
    """Where a satellite has no second band there is nothing to judge: the single-band monitor has it."""
    params = settings.ccd_f
    given = TwoFrequencyInput(
        code_m=inputs.code_m,
        carrier_m=inputs.carrier_m,
        restarted=inputs.slipped,
        range_m=inputs.predicted.range_m,
        clock_s=inputs.predicted.clock_s,
        rebased=inputs.rebased,
        elevation_rad=inputs.predicted.elevation_rad,
        used=inputs.ready,
        clock_used=inputs.usable,
    )
    state, epoch = two_frequency_step(state, given, inputs.dt_s, params)
    forms = {"full_rank": epoch.sound, "published": epoch.paper}
    due = inputs.due & (epoch.receivers > 0)
    chosen = forms.get(exclude)
    return state, _MonitorOutput(
        summaries={"ccd_f": summarise(epoch.sound, due), "ccd_f_paper": summarise(epoch.paper, due)},
        details={"divergence_mps": epoch.mean_mps, **_likeliest_mode(epoch, due, params)},
        satellites=() if chosen is None else _verdicts(True, (ExclusionCause.TWO_FREQUENCY_DIVERGENCE, chosen), due),
    )


def _likeliest_mode(epoch: TwoFrequencyEpoch, due: BoolArray, params: TwoFrequencyParams) -> dict[str, FloatArray]:
    """Mode and its probability of the satellites that fail; missing for the rest."""
    failed = due & epoch.sound.failed & np.isfinite(epoch.sound.statistic)
    if not failed.any():
        return {}
    found = classify(epoch.mean_mps[[0, 1, 3]][:, failed], epoch.covariance[failed], params.band, params.other)
    mode, probability = missing(), missing()
    number = found.posterior.argmax(axis=0)
    mode[failed] = np.where(number == MODES.index(NO_FAULT), 0, number + 1)
    probability[failed] = found.posterior.max(axis=0)
    return {"ccd_f_mode": mode, "ccd_f_mode_probability": probability}


def _acceleration(
    state: CarrierAccelerationState,
    residual_m: FloatArray,
    inputs: MonitorInputs,
    settings: _Settings,
    *,
    exclude: bool,
) -> tuple[CarrierAccelerationState, _MonitorOutput]:
    params = settings.acceleration
    state, found = carrier_acceleration_step(
        state,
        residual_m[:, list(params.bands)],
        inputs.slipped[:, list(params.bands)],
        inputs.ready & inputs.due,
        inputs.predicted.elevation_rad,
        inputs.dt_s,
        params,
        shift_m=inputs.shift_m,
    )
    known = np.isfinite(found.satellites.statistic[0, 0])
    each = [_row(found.satellites, number) for number in range(len(_CARRIER_CAUSES))]
    summaries = {name: summarise(result, inputs.due) for (name, _), result in zip(_CARRIER_CAUSES, each, strict=True)}
    return state, _MonitorOutput(
        summaries=summaries,
        satellites=_carrier_verdicts(found, inputs.due & known) if exclude else (),
        channels=_channel_verdicts(found) if exclude else (),
        ready=known if exclude else None,
    )


def _carrier_verdicts(found: CarrierAccelerationResult, due: BoolArray) -> tuple[Verdict, ...]:
    """A satellite's cause is the statistic that is furthest over its threshold."""
    failed = due & found.failed_satellites
    if not failed.any():
        return ()
    worst = worst_of(found.satellites, axes=2)
    number, _ = place_of_worst(found.satellites, axes=2)
    return tuple(
        Verdict(cause, replace(worst, failed=failed & (number == place)))
        for place, (_, cause) in enumerate(_CARRIER_CAUSES)
    )


def _channel_verdicts(found: CarrierAccelerationResult) -> tuple[Verdict, ...]:
    """The worst statistic of each channel; one that is missing makes nobody fail, but is not ready."""
    if not found.failed_channels.any():
        return ()
    worst = worst_of(_moved(found.channels, 2, 1), axes=2)
    failed = found.failed_channels & (worst.statistic > worst.threshold)
    return (Verdict(ExclusionCause.CARRIER_ACCELERATION, replace(worst, failed=failed)),)


def _double_differences(
    residual_m: FloatArray, channels: BoolArray, inputs: MonitorInputs, settings: _Settings
) -> DoubleDifferences:
    """Of the channels given, over all baselines."""
    params, elevation_rad = settings.gradient, inputs.predicted.elevation_rad
    references = reference_satellites(inputs.may_refer, elevation_rad, params.references)
    used_m = np.where(channels[:, np.newaxis], residual_m[:, list(params.bands)], np.nan)
    return double_differences(used_m, settings.site.baselines, references, elevation_rad, params.noise, params.bands)


def _enough(channels: BoolArray, least: int) -> BoolArray:
    """Channels of receivers that have enough of them in a constellation to be in use there, ``(R, N)``."""
    number = channels.astype(np.int64) @ CLOCK_GROUPS.T.astype(np.int64)
    return np.asarray((number >= least) @ CLOCK_GROUPS)


def _fitting_differences(
    residual_m: FloatArray, channels: BoolArray, inputs: MonitorInputs, settings: _Settings, params: GroundParams
) -> tuple[DoubleDifferences, MonitorResult]:
    """Double differences to judge satellites by, and the receiver that is named by them.

    When most satellites point to one receiver, theirs are those without it: they are judged at once as it will be from
    now on. Otherwise the satellites bear it as if nothing were known of the receiver.
    """
    differences = _double_differences(residual_m, channels, inputs, settings)
    found = _shared_receiver(differences, inputs, settings, params)
    if not found.most:
        return differences, found.receivers
    kept = channels & ~found.receivers.failed[:, np.newaxis]
    return _double_differences(residual_m, kept, inputs, settings), found.receivers


def _shared_receiver(
    differences: DoubleDifferences, inputs: MonitorInputs, settings: _Settings, params: GroundParams
) -> SharedReceiver:
    threshold_m = settings.site.k_ffd * differences.sigma_m
    due = inputs.due & (np.abs(differences.residual_m) > threshold_m).any(axis=(0, 1))
    if not (due.any() and params.ionosphere_gradient.exclude):
        count = len(inputs.code_m)
        least = np.full(count, float(params.monitors.receiver_fault_channels))
        nobody = MonitorResult(statistic=np.zeros(count), threshold=least, failed=np.zeros(count, dtype=bool))
        return SharedReceiver(receivers=nobody, most=False)
    return shared_receiver(
        differences,
        threshold_m,
        settings.site.baselines,
        settings.planes,
        inputs.due,
        inputs.predicted.elevation_rad,
        inputs.predicted.azimuth_rad,
        params.monitors.receiver_fault_channels,
    )


def _quiet_receivers(
    residual_m: FloatArray, channels: BoolArray, inputs: MonitorInputs, settings: _Settings, params: GroundParams
) -> FloatArray:
    """1 for receivers that would do on their baselines, 0 for those that would not, NaN where nobody can tell, (R,)."""
    quiet = np.ones(len(inputs.code_m))
    baselines = settings.site.baselines
    for receiver in np.flatnonzero(inputs.suspended.any(axis=1)):
        again = channels.copy()
        again[receiver] |= inputs.suspended[receiver]
        differences = _double_differences(residual_m, again, inputs, settings)
        threshold_m = settings.site.k_ffd * differences.sigma_m
        found = seen_quiet(differences, threshold_m, baselines, int(receiver), params.monitors.min_common_satellites)
        quiet[receiver] = np.nan if found is None else float(found)
    return quiet


def _gradient(
    differences: DoubleDifferences, inputs: MonitorInputs, settings: _Settings, *, exclude: bool
) -> _MonitorOutput:
    site, params = settings.site, settings.gradient
    found = check_ionosphere_gradient(differences, inputs.due, site, params)
    due = inputs.due & (len(site.baselines) > 0)
    return _MonitorOutput(
        summaries={"gradient": summarise(found.verdict, due)},
        details=_gradient_details(found, differences, settings),
        satellites=_verdicts(exclude, (ExclusionCause.IONOSPHERE_GRADIENT, found.verdict), due),
        ready=found.monitored if settings.gradient_required else None,
    )


def _ephemeris(
    state: EphemerisResidualState,
    differences: DoubleDifferences,
    inputs: MonitorInputs,
    settings: _Settings,
    *,
    exclude: bool,
) -> tuple[EphemerisResidualState, _MonitorOutput, FloatArray]:
    """Verdicts, and what an orbit that passes may be wrong by."""
    baselines = settings.site.baselines
    state, result = ephemeris_residual_step(
        state, differences, baselines, inputs.due, inputs.dt_s, settings.ephemeris, shift_m=inputs.shift_m
    )
    bound = orbit_bound(differences, inputs.predicted.elevation_rad, settings.orbit_site)
    if not exclude:
        bound = np.full(bound.shape, np.inf)
    part = _MonitorOutput(
        summaries={"ephemeris": summarise(result, inputs.due & (len(baselines) > 0))},
        satellites=_verdicts(exclude, (ExclusionCause.EPHEMERIS_RESIDUAL, result), inputs.due),
        ready=bound <= MAX_DECORRELATION if settings.orbit_required else None,
    )
    return state, part, bound


def _power(
    state: PowerExpectationState, inputs: MonitorInputs, settings: _Settings, *, exclude: bool, required: bool
) -> tuple[PowerExpectationState, _MonitorOutput]:
    """A receiver that gives no C/N0 fails where the station requires it, and is not looked at otherwise."""
    given = np.isfinite(inputs.cn0_dbhz[:, L1])
    due = inputs.ready & inputs.due & (given | required)
    state, found = power_expectation_step(
        state, inputs.cn0_dbhz, due, inputs.predicted.elevation_rad, inputs.dt_s, settings.power
    )
    worst = worst_of(found.satellites, axes=1)
    satellites = replace(worst, failed=np.logical_or.reduce(found.satellites.failed))
    channels: tuple[Verdict, ...] = ()
    if exclude and found.channels.failed.any():
        channels = (Verdict(ExclusionCause.EXPECTED_POWER, worst_of(_moved(found.channels, 1, 0), axes=1)),)
    return state, _MonitorOutput(
        summaries={"expected_power": summarise(satellites, np.logical_or.reduce(due))},
        satellites=_verdicts(exclude, (ExclusionCause.EXPECTED_POWER, satellites), inputs.due),
        channels=channels,
    )


def _gradient_details(found: GradientResult, differences: DoubleDifferences, settings: _Settings) -> dict[str, Any]:
    details = {"gradient": found.gradient, "gradient_coverage": found.coverage}
    baselines, bands = settings.site.baselines, settings.gradient.bands
    places = [BASELINES.index((i + 1, j + 1)) for i, j in zip(baselines.first, baselines.second, strict=True)]
    for name, band in (("double_difference_m", L1), ("double_difference_l5_m", L5)):
        if band in bands:
            details[name] = missing(len(BASELINES))
            details[name][places] = differences.residual_m[:, bands.index(band)]
    return details


def _residual_m(inputs: MonitorInputs, settings: _Settings) -> FloatArray:
    """Carriers of all bands without what is expected of them, ``(R, N_BANDS, N)``."""
    predicted = inputs.predicted
    delay_m = settings.troposphere.delay_m(
        predicted.elevation_rad, predicted.azimuth_rad, settings.site.baselines.place_m
    )
    return carrier_residual_m(inputs.carrier_m, predicted.range_m, predicted.clock_s, delay_m, tuple(range(N_BANDS)))


def _verdicts(exclude: bool, verdict: tuple[ExclusionCause, MonitorResult], due: BoolArray) -> tuple[Verdict, ...]:
    """The failures of satellites that are due, unless the monitor is only watched."""
    cause, result = verdict
    return (Verdict(cause, replace(result, failed=result.failed & due)),) if exclude else ()


def _moved(result: MonitorResult, source: int, destination: int) -> MonitorResult:
    """The same with one axis elsewhere."""
    shape = result.statistic.shape
    return MonitorResult(
        statistic=np.moveaxis(result.statistic, source, destination),
        threshold=np.moveaxis(np.broadcast_to(result.threshold, shape), source, destination),
        failed=np.moveaxis(np.broadcast_to(result.failed, shape), source, destination),
    )


def _row(result: MonitorResult, row: int) -> MonitorResult:
    """One row of a result's first axis."""
    threshold = np.broadcast_to(result.threshold, result.statistic.shape)
    return MonitorResult(statistic=result.statistic[row], threshold=threshold[row], failed=result.failed[row])
