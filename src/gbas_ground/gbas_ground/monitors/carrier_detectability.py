"""Which faults of a satellite's carrier the carrier monitor finds, and how soon."""

from __future__ import annotations

from typing import Literal

import numpy as np

from gbas_core.record import FloatArray
from gbas_ground.monitors.carrier_acceleration import CarrierAccelerationParams
from gbas_ground.monitors.false_alarm import EPOCH_S
from gbas_ground.monitors.kernels.carrier_acceleration import fitted, limit

Fault = Literal["step", "ramp", "acceleration"]


def fault_response(
    fault: Fault, since_s: float, params: CarrierAccelerationParams, interval_s: float = EPOCH_S
) -> FloatArray:
    """What a unit fault makes of the three statistics some time after its onset.

    Parameters
    ----------
    fault : {"step", "ramp", "acceleration"}
        1 m, 1 m/s or 1 m/s^2 from the onset on.
    since_s : float
        Age of the fault at the newest epoch [s].
    params : CarrierAccelerationParams
        The window is full.
    interval_s : float
        Between epochs [s].

    Returns
    -------
    (3,) array
        In the order of :data:`~gbas_ground.monitors.carrier_acceleration.STATISTICS`.
    """
    age = _window_s(params, interval_s)
    grown = np.maximum(since_s - age, 0.0)
    signal = {"step": (since_s >= age).astype(np.float64), "ramp": grown, "acceleration": 0.5 * grown**2}[fault]
    change = signal - signal[0]
    return _fitted(age, change, params)[:3]


def detectable_fault(
    fault: Fault,
    since_s: float,
    sigma_m: float,
    params: CarrierAccelerationParams,
    *,
    n_receivers: int = 1,
    k_md: float = 0.0,
) -> float:
    """Smallest fault of a satellite that is found by its age `since_s` at the latest, in the fault's unit.

    Parameters
    ----------
    fault, since_s, params
        As of :func:`fault_response`.
    sigma_m : float
        Sigma of one receiver's carrier less its clock [m].
    n_receivers : int
        Receivers averaged.
    k_md : float
        Standard deviations for missed detection; 0 is one half.
    """
    interval_s = params.interval_s
    ages = np.arange(round(since_s / interval_s) + 1) * interval_s
    age = _window_s(params, interval_s)
    variance = _fitted(age, np.zeros(age.size), params)[3:] * sigma_m**2 / n_receivers
    k = params.multiplier(n_receivers) + k_md
    needed = np.array(
        [
            limit(float(each), common, natural, k)
            for each, common, natural in zip(variance, *params.common_and_natural.tolist(), strict=True)
        ]
    )
    with np.errstate(divide="ignore"):
        sizes = [needed / np.abs(fault_response(fault, each, params, interval_s)) for each in ages]
    return float(np.min(sizes))


def _window_s(params: CarrierAccelerationParams, interval_s: float) -> FloatArray:
    """Ages of the epochs in a full window [s]."""
    return np.asarray(np.arange(min(params.points, int(params.window_s / interval_s) + 1)) * interval_s)


def _fitted(age_s: FloatArray, change_m: FloatArray, params: CarrierAccelerationParams) -> FloatArray:
    """Three statistics and their variances for a variance of one; NaN with too few epochs."""
    if age_s.size < params.least_points:
        return np.full(6, np.nan)
    powers = (-age_s) ** np.arange(5)[:, np.newaxis]
    return np.array(fitted(tuple(powers.sum(axis=1).tolist()), tuple((powers[:3] @ change_m).tolist())))
