"""Code-carrier divergence of single bands: the CCD monitor of GAST D.

Each receiver's code minus carrier on each band goes through the filters of :mod:`gbas_core.ranging.divergence`; the
filtered rates of the receivers used on a satellite are averaged, and the size of the mean is compared with the
threshold. The ionosphere diverges code and carrier, too (twice its rate): what trips may be a front, not a fault.

Source: Jiang, Milner, Macabiau, ENC 2015, eq (1) to (4) and 2.1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple, Protocol

import numpy as np

from gbas_core.parameters import Derived, Parameter, parameters
from gbas_core.ranging.divergence import (
    GROUND,
    GROUND_SIGMA_MPS,
    GROUND_THRESHOLD_MPS,
    DivergenceParams,
)
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS, missing
from gbas_core.signals import L1, L5, N_BANDS
from gbas_ground.monitors.false_alarm import exposure_probability, least_correlation
from gbas_ground.monitors.interface import MonitoredEpoch, MonitorOutput, SecondBandOutput, SignalMonitor, verdicts
from gbas_ground.monitors.kernels import ccd as kernels
from gbas_ground.monitors.kernels.divergence_filter import initial_memory
from gbas_ground.monitors.monitor_table import summarise
from gbas_ground.monitors.result import MonitorResult, upper_limit
from gbas_msgs_py.codes import Signal
from gbas_msgs_py.monitors import CCD
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS

if TYPE_CHECKING:
    from gbas_ground.prepared import PreparedStation


@parameters
class CcdParams:
    """Single-band code-carrier divergence (GAST-D).

    Notes
    -----
    The paper calls 0.0233 m/s the threshold for a false alarm probability of 1e-9 at sigma 0.00399 m/s. It is 5.840
    sigma, which is 2.6e-9 one-sided; 1e-9 takes 0.02393 m/s one-sided and 0.02438 m/s two-sided. The lower threshold
    is kept: it detects earlier.

    The filters settle with those of the smoothing: after 207 s both have forgotten their start to 1 %
    (:mod:`gbas_core.ranging.divergence`), less than the 230 s of docs/decisions/0002.
    """

    exclude: Annotated[bool, Parameter("satellites that fail are excluded")] = True
    tau_s: Annotated[float, Parameter("time constant of both filters", "s", 1.0, 1000.0)] = 30.0
    settle_s: Annotated[
        float, Parameter("time a filter has to run, where that is more than smoothing.settle_time_s", "s", 0.0, 3600.0)
    ] = 0.0
    threshold_mps: Annotated[float, Parameter("of the mean over receivers", "m/s", 1e-4, 10.0)] = GROUND_THRESHOLD_MPS
    sigma_mps: Annotated[
        float,
        Parameter(
            "bound on the standard deviation of that mean, ionosphere included: with the threshold, the false "
            "exclusions", "m/s", 1e-5, 1.0,
        ),
    ] = GROUND_SIGMA_MPS  # fmt: skip
    filters: Annotated[DivergenceParams, Derived("of tau_s, settle_s and the longest gap of the smoothing")] = GROUND

    @cached_property
    def limit_mps(self) -> FloatArray:
        """The threshold for every satellite, ``(N_BANDS, N)`` [m/s]."""
        return np.full((N_BANDS, N_SATS), self.threshold_mps)

    def p_false_exclusion(self) -> float:
        """Of one source in 15 s: 9.1e-8 for the published threshold and sigma, as of 17 independent samples."""
        return exposure_probability(self.threshold_mps / self.sigma_mps, least_correlation(self.tau_s))


class CcdEpoch(NamedTuple):
    """Result of one epoch, by band.

    Attributes
    ----------
    receiver_mps : (R, N_BANDS, N) array
        Filtered rate of each channel that was measured now, settled or not [m/s].
    settled : (R, N_BANDS, N) bool array
        Where it counts.
    mean_mps : (N_BANDS, N) array
        Mean over the settled channels in use; NaN where there is none [m/s].
    receivers : (N_BANDS, N) array
        How many there are.
    satellites : MonitorResult
        ``(N_BANDS, N)``: size of the mean against the threshold. Where `receivers` is 0 it says nothing, and the
        satellite is not monitored on that band.
    """

    receiver_mps: FloatArray
    settled: BoolArray
    mean_mps: FloatArray
    receivers: FloatArray
    satellites: MonitorResult

    @property
    def channels(self) -> MonitorResult:
        """Size of each settled channel's rate, in use or not, against the same threshold, ``(R, N_BANDS, N)``."""
        return upper_limit(np.abs(self.receiver_mps), self.satellites.threshold, self.settled)


@dataclass(frozen=True, kw_only=True, eq=False)
class CcdState:
    """Memory of the filters, ``(5, R, N_BANDS, N)`` (:mod:`~.kernels.divergence_filter`)."""

    filters: FloatArray


def initial_ccd(n_receivers: int) -> CcdState:
    """State of a monitor that has seen nothing."""
    return CcdState(filters=initial_memory(n_receivers, N_BANDS))


class Channels(Protocol):
    """What the monitor looks at; missing is NaN.

    Attributes
    ----------
    code_m, carrier_m : (R, N_BANDS, N) arrays
        Raw code and carrier ranges [m].
    restarted : (R, N_BANDS, N) bool array
        Cycle slips, code jumps and restarts of the smoothing filter.
    used : (R, N) bool array
        Receivers averaged for each satellite.
    """

    @property
    def code_m(self) -> FloatArray: ...
    @property
    def carrier_m(self) -> FloatArray: ...
    @property
    def restarted(self) -> BoolArray: ...
    @property
    def used(self) -> BoolArray: ...


class CcdInput(NamedTuple):
    """:class:`Channels` of one epoch."""

    code_m: FloatArray
    carrier_m: FloatArray
    restarted: BoolArray
    used: BoolArray


def ccd_step(state: CcdState, seen: Channels, dt_s: float, params: CcdParams) -> tuple[CcdState, CcdEpoch]:
    """Monitor one epoch.

    Parameters
    ----------
    state : CcdState
        From :func:`initial_ccd` or the previous step.
    seen : Channels
    dt_s : float
        Time since the epoch before, NaN at the first [s].
    params : CcdParams
    """
    filters, shape = params.filters, seen.code_m.shape
    memory, filtered, settled = np.empty(state.filters.shape), np.empty(shape), np.empty(shape, dtype=bool)
    means, failed = np.empty((3, *shape[1:])), np.empty(shape[1:], dtype=bool)
    kernels.step(
        state.filters,
        seen.code_m,
        seen.carrier_m,
        seen.restarted,
        seen.used,
        float(dt_s),
        float(filters.tau_s),
        float(filters.max_gap_s),
        float(filters.settle_s),
        float(params.threshold_mps),
        memory,
        filtered,
        settled,
        means,
        failed,
    )
    judged = MonitorResult(statistic=means[1], threshold=params.limit_mps, failed=failed)
    return CcdState(filters=memory), CcdEpoch(filtered, settled, means[0], means[2], judged)


# --- in the station


def _initial(station: PreparedStation) -> CcdState:
    return initial_ccd(station.params.n_receivers)


def _step(state: CcdState, epoch: MonitoredEpoch) -> tuple[CcdState, MonitorOutput]:
    """The rates of L1 count for the satellite; those of L5, where it is corrected too, for its corrections there alone.

    What L1 may be used for rests on the rates of L1.
    """
    inputs = epoch.inputs
    params = inputs.station.ccd
    seen = CcdInput(inputs.code_m, inputs.carrier_m, inputs.slipped, inputs.ready)
    state, found = ccd_step(state, seen, inputs.dt_s, params)
    of_bands = found.satellites
    result = MonitorResult(
        statistic=of_bands.statistic[L1], threshold=of_bands.threshold[L1], failed=of_bands.failed[L1]
    )
    by_receiver = missing(MAX_REFERENCE_RECEIVERS)
    by_receiver[: len(found.receiver_mps)] = found.receiver_mps[:, L1]
    test = CCD.test("rate")
    return state, MonitorOutput(
        summaries={CCD.key(test.name): summarise(result, inputs.due)},
        details={"ccd_receiver_mps": by_receiver},
        satellites=verdicts(params.exclude, test.cause, result, inputs.due, power=1),
        ready=found.receivers[L1] > 0 if params.exclude else None,
        second=_second(found, epoch) if inputs.station.second is not None else None,
    )


def _second(found: CcdEpoch, epoch: MonitoredEpoch) -> SecondBandOutput:
    """What L5 says, with the same threshold: the ionosphere diverges it 1.8 times as much as L1."""
    inputs, test = epoch.inputs, CCD.test("rate")
    params, of_bands = inputs.station.ccd, found.satellites
    result = MonitorResult(
        statistic=of_bands.statistic[L5], threshold=of_bands.threshold[L5], failed=of_bands.failed[L5]
    )
    measured = found.receivers[L5] > 0
    return SecondBandOutput(
        summaries={CCD.key(test.name): summarise(result, inputs.due & measured, Signal.L5)},
        satellites=verdicts(params.exclude, test.cause, result, inputs.due, power=1),
        ready=measured if params.exclude else None,
    )


MONITOR: Final = SignalMonitor(entry=CCD, parameters=CcdParams, initial=_initial, step=_step)
