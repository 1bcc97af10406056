"""Multiple reference consistency check (MRCC): do the reference receivers agree?"""

from __future__ import annotations

from typing import Annotated, Final

import numpy as np

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import BoolArray, FloatArray
from gbas_ground.corrections.formation import clock_removed_sigma_m
from gbas_ground.monitors.result import MonitorResult, upper_limit

MAX_B_VALUE_M: Final = 6.35
"""Largest B value the type 1 message can carry. Source: ICAO Annex 10 vol. I, table B-63."""


@parameters
class BValueParams:
    """B values against their sigma."""

    k_b: Annotated[float, Parameter("multiplier of the B value threshold", "-", 1.0, 20.0)] = 5.5


def channel_sigma_m(sigma_pr_gnd_m: FloatArray, count: FloatArray, weights: FloatArray) -> FloatArray:
    """Sigma of one receiver's correction after removal of its clock.

    Parameters
    ----------
    sigma_pr_gnd_m : (..., N) array
        Sigma of the mean over the receivers used [m].
    count : (N,) array
        Receivers used on each satellite, M_i.
    weights : (k, N) array
        Weights of the common satellites in the clock.

    Returns
    -------
    (..., N) array
        [m].
    """
    return clock_removed_sigma_m(sigma_pr_gnd_m * np.sqrt(count), weights)


def check_b_values(b_m: FloatArray, sigma_m: FloatArray, used: BoolArray, k_b: float) -> MonitorResult:
    """Compare every B value with K_B times its sigma.

    Parameters
    ----------
    b_m : (..., R, N) array
        B values [m].
    sigma_m : (..., N) array
        From :func:`channel_sigma_m` [m].
    used : (R, N) bool array
        Receivers used on each satellite.
    k_b : float

    Returns
    -------
    MonitorResult
        Statistic: size of the B value [m]. Applies to satellites with two receivers or more; a B value that the message
        cannot carry fails whatever its sigma.

    Notes
    -----
    With independent receivers of sigma s the variance of B is s^2 / (M (M - 1)), that is sigma_pr_gnd^2 / (M - 1). The
    noise that the removal of the clock brings in is part of s here (it is not part of sigma_pr_gnd, because it vanishes
    in the user's clock); without it high satellites would fail too often.

    Source: threshold K_B sigma_pr_gnd / sqrt(M - 1) with K_B = 5.5 (known for an early LAAS prototype, uncertain for
    fielded stations, FAA specification: 5.6).
    """
    count = used.sum(axis=0)
    limit = k_b * sigma_m / np.sqrt(np.maximum(count * (count - 1), 1))
    applies = used & (count >= 2)
    return upper_limit(
        np.abs(b_m), np.minimum(limit, MAX_B_VALUE_M)[..., np.newaxis, :], np.broadcast_to(applies, b_m.shape)
    )


def check_unused(residual_m: FloatArray, sigma_m: FloatArray, count: FloatArray, k_b: float) -> MonitorResult:
    """The same question for channels that are not used: would they agree with the corrections they have no part in?

    Parameters
    ----------
    residual_m : (..., R, N) array
        Correction of the channel less the PRC of the others [m].
    sigma_m : (..., N) array
        From :func:`channel_sigma_m` [m].
    count : (N,) array
        Receivers in that PRC.
    k_b : float

    Returns
    -------
    MonitorResult
        Statistic: size of the residual [m]; threshold K_B s sqrt(1 + 1/M). A missing residual does not
        fail: the caller decides what an unknown means.
    """
    limit = k_b * sigma_m * np.sqrt(1.0 + 1.0 / np.maximum(count, 1))
    statistic = np.abs(residual_m)
    return upper_limit(statistic, limit[..., np.newaxis, :], np.isfinite(statistic))
