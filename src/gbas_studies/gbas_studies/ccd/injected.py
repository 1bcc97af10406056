"""The monitors on a simulated station of four receivers: fault modes, nominal days, an ionospheric front.

A nominal world is simulated once; a fault is then added to what its receivers measured, by the simulator's own fault,
from an epoch at which the monitors had settled on. What the monitors say is compared with the differential error the
fault has made at a user whose filter is settled, or started at the worst time, by then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from gbas_core.io.recording import RecordedEpoch
from gbas_core.ranging.combinations import combination_matrix
from gbas_core.ranging.divergence import GROUND, ramp_response
from gbas_core.ranging.fault_modes import fault_direction
from gbas_core.record import FloatArray
from gbas_core.satellites import N_SATS, SAT_IDS
from gbas_core.signals import L1, L5
from gbas_ground.monitors.ccd import CcdParams, CcdState, ccd_step, initial_ccd
from gbas_ground.monitors.ccd_f import (
    TwoFrequencyInput,
    TwoFrequencyParams,
    TwoFrequencyState,
    initial_two_frequency,
    two_frequency_step,
)
from gbas_ground.monitors.divergence_classification import classify
from gbas_ground.monitors.divergence_covariance import StatisticCovariance
from gbas_ground.monitors.divergence_forms import full_rank_form, published_form, threshold
from gbas_sim.atmosphere.fronts import WedgeFront
from gbas_sim.atmosphere.ionosphere import IonosphereParams
from gbas_sim.atmosphere.troposphere import Troposphere
from gbas_sim.faults.fault_base import Moment, SignalEffect
from gbas_sim.faults.signal_faults import CodeCarrierDivergence
from gbas_sim.receivers.presets import receiver_preset
from gbas_sim.world import World
from gbas_sim.world_params import WorldParams
from gbas_studies.ccd.monitors import TAU_S
from gbas_studies.ccd.recorded import MonitoredSeries, Observer, monitor_epochs

T_S: Final = 0.5
# Published: antennas of an experimental station at Braunschweig; the fourth is ours.
ANTENNAS_M: Final = (
    (3840619.039, 715604.228, 5024909.863),
    (3840835.113, 714861.969, 5024848.587),
    (3841202.939, 715429.959, 5024488.675),
    (3840882.0, 715289.0, 5024753.0),
)
TROPOSPHERE: Final = Troposphere(refractivity=330.0, scale_height_m=7900.0)
ZENITH_DELAY_M: Final = 330.0e-6 * 7900.0
SETTLE_EPOCHS: Final = round(GROUND.settle_s / T_S) + 2


def nominal_world(seconds: float, *, seed: int = 1, fronts: tuple[WedgeFront, ...] = ()) -> World:
    """Four receivers with noise, multipath and reflections as accuracy designator C, atmosphere, GPS and Galileo."""
    params = WorldParams(
        receiver_ecef_m=ANTENNAS_M, flight=None, duration_s=seconds, troposphere=TROPOSPHERE,
        ionosphere=IonosphereParams(), ground=receiver_preset("gad_c", interval_s=T_S), interval_s=T_S, seed=seed,
        fronts=fronts,
    )  # fmt: skip
    return World(params)


def double_params(covariance: StatisticCovariance | None = None) -> TwoFrequencyParams:
    """The two-frequency monitor of this station."""
    params = TwoFrequencyParams(zenith_delay_m=ZENITH_DELAY_M)
    return params if covariance is None else params.with_covariance(covariance)


def monitored(world: World, *, covariance: StatisticCovariance | None = None) -> MonitoredSeries:
    """Both monitors over a whole world."""
    epochs = (RecordedEpoch(key=each.key, ground=each.ground, user=None) for each in world)
    return monitor_epochs(epochs, world.ephemerides, np.array(ANTENNAS_M), CcdParams(), double_params(covariance))


@dataclass(frozen=True, kw_only=True, eq=False)
class Base:
    """A settled station and the epochs that follow.

    Attributes
    ----------
    single : CcdState
    double : TwoFrequencyState
        After the last epoch before the fault.
    following : tuple of TwoFrequencyInput
        What comes then, without a fault.
    params : TwoFrequencyParams
    """

    single: CcdState
    double: TwoFrequencyState
    following: tuple[TwoFrequencyInput, ...]
    params: TwoFrequencyParams

    def highest(self) -> list[int]:
        """Satellites with both bands in all epochs, from the highest down."""
        first = self.following[0].elevation_rad
        whole = np.ones(N_SATS, dtype=bool)
        for seen in self.following:
            whole &= np.isfinite(seen.code_m[:, [L1, L5]] + seen.carrier_m[:, [L1, L5]]).all(axis=(0, 1))
            whole &= ~seen.restarted.any(axis=(0, 1)) & seen.used.all(axis=0)
        return sorted(np.flatnonzero(whole).tolist(), key=lambda place: -float(first[place]))


def settled_base(world: World, n_following: int, *, covariance: StatisticCovariance | None = None) -> Base:
    """Run a world until the monitors have settled, and keep what follows."""
    observer = Observer(world.ephemerides, np.array(ANTENNAS_M), GROUND.max_gap_s)
    single_params, params = CcdParams(), double_params(covariance)
    single, double = initial_ccd(len(ANTENNAS_M)), initial_two_frequency(len(ANTENNAS_M))
    following = []
    nobody = np.zeros(N_SATS, dtype=bool)
    for number in range(SETTLE_EPOCHS + n_following):
        each = world.epoch(number)
        dt_s = T_S if number else float("nan")
        seen = observer.see(RecordedEpoch(key=each.key, ground=each.ground, user=None), dt_s, nobody)
        if number >= SETTLE_EPOCHS:
            following.append(seen)
            continue
        single, _ = ccd_step(single, seen, dt_s, single_params)
        double, _ = two_frequency_step(double, seen, dt_s, params)
    return Base(single=single, double=double, following=tuple(following), params=params)


@dataclass(frozen=True, kw_only=True)
class Detection:
    """What became of one injected fault.

    Attributes
    ----------
    mode : str
    d_mps : float
    satellite : str
    times_s : dict of str to float
        From the onset to the first alarm of each monitor (``"gast-d L1"``, ``"gast-d L5"``, ``"gast-f-paper"``,
        ``"gast-f-sound"``); NaN: none within the epochs there are [s].
    expected_s : dict of str to float
        When the statistic without noise passes the threshold; NaN: never.
    others : int
        Alarms of the sound form on other satellites.
    ranked : tuple of str
        Modes with 95 % of the posterior at the sound form's alarm, the most likely first.
    """

    mode: str
    d_mps: float
    satellite: str
    times_s: dict[str, float]
    expected_s: dict[str, float]
    others: int
    ranked: tuple[str, ...]


def inject(base: Base, mode: str, d_mps: float, satellite: int) -> Detection:
    """Add one fault from the first following epoch on; step the monitors until all have spoken or the epochs end."""
    fault = CodeCarrierDivergence(satellite=SAT_IDS[satellite], mode=mode, ramp_mps=d_mps, start_s=0.0)
    single, double, single_params = base.single, base.double, CcdParams()
    times = dict.fromkeys(("gast-d L1", "gast-d L5", "gast-f-paper", "gast-f-sound"), float("nan"))
    others = 0
    ranked: tuple[str, ...] = ()
    failed = np.zeros(N_SATS, dtype=bool)
    for number, nominal in enumerate(base.following):
        since_s = number * T_S
        seen = _with_fault(nominal, fault, since_s, failed)
        single, one = ccd_step(single, seen, T_S, single_params)
        double, two = two_frequency_step(double, seen, T_S, base.params)
        said = {
            "gast-d L1": one.satellites.failed[L1, satellite], "gast-d L5": one.satellites.failed[L5, satellite],
            "gast-f-paper": two.published.failed[satellite], "gast-f-sound": two.full_rank.failed[satellite],
        }  # fmt: skip
        for name, alarm in said.items():
            if alarm and np.isnan(times[name]):
                times[name] = since_s
                if name == "gast-f-sound":
                    found = classify(two.mean_mps[[0, 1, 3]], two.covariance, L1, L5)
                    ranked = found.plausible(satellite)
        failed = two.full_rank.failed
        others += int(failed.sum() - failed[satellite])
        if not np.isnan(list(times.values())).any():
            break
    elevation, receivers = base.following[0].elevation_rad[satellite], float(len(ANTENNAS_M))
    expected = expected_times_s(mode, d_mps, base.params, float(elevation), receivers)
    return Detection(
        mode=mode, d_mps=d_mps, satellite=SAT_IDS[satellite], times_s=times, expected_s=expected, others=others,
        ranked=ranked,
    )  # fmt: skip


def _with_fault(
    nominal: TwoFrequencyInput, fault: CodeCarrierDivergence, since_s: float, failed: np.ndarray
) -> TwoFrequencyInput:
    receivers = nominal.code_m.shape[0]
    effect = SignalEffect.none(receivers)
    fault.add_to(effect, Moment(since_s=np.full(receivers, since_s), interval_s=T_S, listeners=()))
    return nominal._replace(
        code_m=nominal.code_m + effect.code_m,
        carrier_m=nominal.carrier_m + effect.carrier_m,
        clock_used=nominal.clock_used & ~failed,
    )


def expected_times_s(
    mode: str, d_mps: float, params: TwoFrequencyParams, elevation_rad: float, receivers: float
) -> dict[str, float]:
    """When statistics without noise pass their thresholds, from the closed form of the filters' response [s]."""
    direction = d_mps * fault_direction(mode)
    means = combination_matrix(params.band, params.other) @ direction
    count = np.array([receivers])
    covariance = params.covariance.at(np.array([elevation_rad]), count, np.array([np.inf]))
    steady = {
        "gast-d L1": abs(direction[0] - direction[2]) / CcdParams().threshold_mps,
        "gast-d L5": abs(direction[1] - direction[3]) / CcdParams().threshold_mps,
        "gast-f-paper": _root(
            published_form(means[:, np.newaxis], count), threshold("published", params.p_false_alarm)
        ),
        "gast-f-sound": _root(
            full_rank_form(means[[0, 1, 3], np.newaxis], covariance), threshold("full_rank", params.p_false_alarm)
        ),
    }
    response = ramp_response(np.arange(4000), T_S / TAU_S)
    times = {}
    for name, size in steady.items():
        above = np.flatnonzero(size * response > 1.0)
        times[name] = float(above[0] * T_S) if len(above) else float("nan")
    return times


def _root(metric: FloatArray, limit: float) -> float:
    return float(np.sqrt(max(float(metric[0]), 0.0) / limit))


def campaign(
    base: Base, modes: Sequence[str], rates_mps: Sequence[float], satellites: Sequence[int]
) -> list[Detection]:
    """Every mode at every rate on every satellite."""
    return [inject(base, mode, rate, satellite) for mode in modes for rate in rates_mps for satellite in satellites]


def front_over_station(gradient: float = 300e-6, speed_mps: float = 100.0, *, start_s: float = 400.0) -> WedgeFront:
    """A front that reaches the station at `start_s`; from then on delays grow by g v a second."""
    return WedgeFront(
        gradient=gradient, width_m=50_000.0, edge="leading", direction_rad=0.0, speed_mps=speed_mps,
        start_m=0.0, start_s=start_s,
    )  # fmt: skip
