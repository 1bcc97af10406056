"""Code-carrier divergence of single bands: the CCD monitor of GAST D.

Each receiver's code minus carrier on each band goes through the filters of :mod:`gbas_core.ranging.divergence`; the
filtered rates of the receivers used on a satellite are averaged, and the size of the mean is compared with the
threshold. The ionosphere diverges code and carrier, too (twice its rate): what trips may be a front, not a fault.

Source: Jiang, Milner, Macabiau, ENC 2015, eq (1) to (4) and 2.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
from gbas_ground.monitors.result import MonitorResult, upper_limit


@dataclass(frozen=True, kw_only=True)
class CcdParams:
    """What the monitor is set to.

    Attributes
    ----------
    filters : DivergenceParams
    threshold_mps : float
        Of the mean over receivers [m/s].
    sigma_mps : float
        Bound on the statistic's standard deviation, ionosphere included: what the threshold was made from [m/s].

    Notes
    -----
    The paper calls 0.0233 m/s the threshold for a false alarm probability of 1e-9 at sigma 0.00399 m/s. It is 5.840
    sigma, which is 2.6e-9 one-sided; 1e-9 takes 0.02393 m/s one-sided and 0.02438 m/s two-sided. The lower threshold
    is kept: it detects earlier.
    """

    filters: DivergenceParams = GROUND
    threshold_mps: float = GROUND_THRESHOLD_MPS
    sigma_mps: float = GROUND_SIGMA_MPS

    def __post_init__(self) -> None:
        for name in ("threshold_mps", "sigma_mps"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} is {value}: it must be above 0 m/s")


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
