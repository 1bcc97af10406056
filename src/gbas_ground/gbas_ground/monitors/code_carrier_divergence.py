"""Code-carrier divergence of single bands: the CCD monitor of GAST D.

Each receiver's code minus carrier on each band goes through the filters of :mod:`gbas_core.ranging.divergence`; the
filtered rates of the receivers used on a satellite are averaged, and the size of the mean is compared with the
threshold. The ionosphere diverges code and carrier, too (twice its rate): what trips may be a front, not a fault.

Source: Jiang, Milner, Macabiau, ENC 2015, eq (1) to (4) and 2.1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from gbas_core.parameters import Derived, Parameter, parameters
from gbas_core.ranging.combinations import code_minus_carrier
from gbas_core.ranging.divergence import (
    GROUND,
    GROUND_SIGMA_MPS,
    GROUND_THRESHOLD_MPS,
    DivergenceParams,
    DivergenceState,
    divergence_step,
    initial_divergence,
    settled,
)
from gbas_core.record import BoolArray, FloatArray
from gbas_core.signals import N_BANDS
from gbas_ground.monitors.false_alarm import exposure_probability, least_correlation
from gbas_ground.monitors.result import MonitorResult, upper_limit


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

    def p_false_exclusion(self) -> float:
        """Of one source in 15 s: 9.1e-8 for the published threshold and sigma, as of 17 independent samples."""
        return exposure_probability(self.threshold_mps / self.sigma_mps, least_correlation(self.tau_s))


@dataclass(frozen=True, kw_only=True, eq=False)
class CcdEpoch:
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
    channels : MonitorResult
        ``(R, N_BANDS, N)``: size of each settled channel's rate, in use or not, against the same threshold.
    satellites : MonitorResult
        ``(N_BANDS, N)``: size of the mean against the threshold. Where `receivers` is 0 it says nothing, and the
        satellite is not monitored on that band.
    """

    receiver_mps: FloatArray
    settled: BoolArray
    mean_mps: FloatArray
    receivers: FloatArray
    channels: MonitorResult
    satellites: MonitorResult


def initial_ccd(params: CcdParams, n_receivers: int) -> DivergenceState:
    """State of a monitor that has seen nothing."""
    return initial_divergence(params.filters, n_receivers, N_BANDS)


def ccd_step(
    state: DivergenceState,
    code_m: FloatArray,
    carrier_m: FloatArray,
    restarted: BoolArray,
    used: BoolArray,
    dt_s: float,
    params: CcdParams,
) -> tuple[DivergenceState, CcdEpoch]:
    """Monitor one epoch.

    Parameters
    ----------
    state : DivergenceState
        From :func:`initial_ccd` or the previous step.
    code_m, carrier_m : (R, N_BANDS, N) arrays
        Raw code and carrier ranges [m].
    restarted : (R, N_BANDS, N) bool array
        Cycle slips, code jumps and restarts of the smoothing filter.
    used : (R, N) bool array
        Receivers averaged for each satellite.
    dt_s : float
        Time since the epoch before, NaN at the first [s].
    params : CcdParams
    """
    state, _, filtered = divergence_step(state, code_minus_carrier(code_m, carrier_m), restarted, dt_s, params.filters)
    counts = settled(state, params.filters)
    averaged = counts & used[:, np.newaxis]
    mean, receivers = receiver_mean(filtered, averaged)
    epoch = CcdEpoch(
        receiver_mps=filtered,
        settled=counts,
        mean_mps=mean,
        receivers=receivers,
        channels=upper_limit(np.abs(filtered), params.threshold_mps, counts),
        satellites=upper_limit(np.abs(mean), params.threshold_mps, receivers > 0),
    )
    return state, epoch


def receiver_mean(values: FloatArray, averaged: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Mean over the first axis of what is `averaged`, and how many that are; NaN where there are none."""
    count = averaged.sum(axis=0)
    total = np.where(averaged, values, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan), count
