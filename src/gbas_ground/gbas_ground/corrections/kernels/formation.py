"""From smoothed ranges to corrections and B values: one function an equation, of one smoothing constant.

Channels are ``(R, N)``: reference receivers, then the satellite axis; `constellation` ``(N,)`` says whose clock a
satellite goes with. What is not there is NaN and takes no part in a sum.
"""

from __future__ import annotations

import math

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.record import BoolArray, FloatArray, IntArray


@compiled
def common_satellites(
    candidate: BoolArray, constellation: IntArray, n_constellations: int, min_common: int, min_receivers: int
) -> tuple[BoolArray, BoolArray]:
    """Receivers in use and the satellites they all track, for each constellation.

    Parameters
    ----------
    candidate : (R, N) bool array
        Channels that may be used.
    constellation : (N,) int array
    n_constellations : int
    min_common : int
        Fewest common satellites a receiver clock is estimated from.
    min_receivers : int
        Fewest receivers.

    Returns
    -------
    in_use : (k, R) bool array
        Receivers in use, by constellation.
    common : (k, N) bool array
        S_c: the satellites of the constellation tracked by all receivers in use; all False where `min_common` cannot
        be reached with `min_receivers`.

    Notes
    -----
    The set "tracked by all receivers in use" lets one receiver that has lost most of its satellites take the whole
    station with it. While the common set is too small, the receiver with the fewest channels (the last of equals) is
    therefore not used.

    Source: RTCA DO-245A 3.2 (S_c); the dropping of receivers is ours.
    """
    n_receivers, n_sats = candidate.shape
    in_use = np.zeros((n_constellations, n_receivers), dtype=np.bool_)
    common = np.zeros((n_constellations, n_sats), dtype=np.bool_)
    counts = np.zeros((n_constellations, n_receivers), dtype=np.int64)
    for m in range(n_receivers):
        for i in range(n_sats):
            if candidate[m, i]:
                counts[constellation[i], m] += 1
    for k in range(n_constellations):
        number = 0
        for m in range(n_receivers):
            in_use[k, m] = counts[k, m] >= min_common
            number += in_use[k, m]
        while number >= max(1, min_receivers):
            shared = 0
            for i in range(n_sats):
                common[k, i] = constellation[i] == k
                for m in range(n_receivers):
                    if in_use[k, m] and not candidate[m, i]:
                        common[k, i] = False
                shared += common[k, i]
            if shared >= min_common:
                break
            fewest = -1
            for m in range(n_receivers):
                if in_use[k, m] and (fewest < 0 or counts[k, m] <= counts[k, fewest]):
                    fewest = m
            in_use[k, fewest] = False
            number -= 1
        else:
            in_use[k] = False
            common[k] = False
    return in_use, common


@compiled
def clock_weights(common: BoolArray, elevation_rad: FloatArray, plain: bool) -> FloatArray:
    """Weights of the common satellites in the mean that removes the receiver clock, ``(k, N)``; each row sums to 1.

    Parameters
    ----------
    common : (k, N) bool array
    elevation_rad : (N,) array
        Elevations: weights go with sin^2, unless the mean is `plain`.
    plain : bool

    Source: plain mean, RTCA DO-245A 3.2; elevation-weighted mean, EUROCAE ED-114 (weights not published: ours).
    """
    weights = np.zeros(common.shape)
    for k in range(len(common)):
        total = 0.0
        for i in range(common.shape[1]):
            if common[k, i]:
                weights[k, i] = 1.0 if plain else math.sin(elevation_rad[i]) ** 2
                total += weights[k, i]
        if total > 0.0:
            weights[k] /= total
    return weights


@compiled
def receiver_clock_m(correction_m: FloatArray, weights: FloatArray) -> float:
    """Clock in the corrections ``(N,)`` of one receiver: their mean with the ``(N,)`` weights of a constellation [m].

    NaN without a common set. A missing common satellite gives NaN too: a mean over another set would not compare with
    other receivers'.

    Source: RTCA DO-245A 3.2: PR_sca = PR_sc - (1/N_c) sum over S_c of PR_sc.
    """
    clock, there = 0.0, False
    for i in range(len(weights)):
        if weights[i] > 0.0:
            clock += correction_m[i] * weights[i]
            there = True
    return clock if there else math.nan


@compiled
def remove_clocks(correction_m: FloatArray, weights: FloatArray, constellation: IntArray) -> FloatArray:
    """PR_sca: corrections ``(R, N)`` less their receivers' clocks [m]."""
    adjusted = np.empty(correction_m.shape)
    for m in range(len(correction_m)):
        for k in range(len(weights)):
            clock = receiver_clock_m(correction_m[m], weights[k])
            for i in range(len(constellation)):
                if constellation[i] == k:
                    adjusted[m, i] = correction_m[m, i] - clock
    return adjusted


@compiled
def average_m(correction_m: FloatArray, used: BoolArray) -> FloatArray:
    """PRC: mean over the receivers used on each satellite, ``(N,)``; NaN where none is.

    Source: RTCA DO-245A 3.2: PRC(i) = (1/M_i) sum over m of PR_sca(i, m).
    """
    mean = np.empty(used.shape[1])
    for i in range(used.shape[1]):
        count, total = 0, 0.0
        for m in range(len(used)):
            if used[m, i]:
                count += 1
                total += correction_m[m, i]
        mean[i] = total / count if count > 0 else math.nan
    return mean


@compiled
def b_values_m(correction_m: FloatArray, used: BoolArray) -> FloatArray:
    """B values: the correction less what it would be without one receiver.

    Parameters
    ----------
    correction_m : (R, N) array
        PR_sca [m].
    used : (R, N) bool array
        Receivers used on each satellite.

    Returns
    -------
    (R, N) array
        B [m]; NaN where the receiver is not used, and everywhere on a satellite with fewer than two receivers.

    Source: RTCA DO-245A 3.2: B(i, m) = PRC(i) - (1/(M_i - 1)) sum over k other than m of PR_sca(i, k).
    """
    b_m = np.full(used.shape, np.nan)
    for i in range(used.shape[1]):
        count, total = 0, 0.0
        for m in range(len(used)):
            if used[m, i]:
                count += 1
                total += correction_m[m, i]
        if count >= 2:
            for m in range(len(used)):
                if used[m, i]:
                    b_m[m, i] = total / count - (total - correction_m[m, i]) / (count - 1)
    return b_m


@compiled
def rate_mps(
    correction_m: FloatArray,
    previous_m: FloatArray,
    dt_s: float,
    weights: FloatArray,
    used: BoolArray,
    constellation: IntArray,
) -> FloatArray:
    """RRC: rate of the corrections, ``(N,)``.

    Parameters
    ----------
    correction_m, previous_m : (R, N) arrays
        PR_sc now and at the epoch before, both with the ephemeris in use now [m].
    dt_s : float
        Time between the epochs [s].
    weights, used
        Today's clock weights ``(k, N)`` and channels ``(R, N)``.

    Notes
    -----
    (PRC_k - PRC_{k-1})/dt with both formed over today's satellites, receivers and ephemerides: equal to the textbook
    difference while none of them changes, and without its jumps when one does.

    Source: RTCA DO-245A 3.2: RRC = (PRC_k - PRC_{k-1}) / 0.5 s.
    """
    return average_m(remove_clocks(correction_m - previous_m, weights, constellation), used) / dt_s


@compiled
def clock_removed_sigma_m(sigma_m: FloatArray, weights: FloatArray, constellation: IntArray) -> FloatArray:
    """Sigma of a correction after removal of the clock, from the sigmas before it.

    Parameters
    ----------
    sigma_m : (N,) array
        Sigma of each satellite's correction [m]; NaN where there is none.
    weights : (k, N) array
        Clock weights.

    Returns
    -------
    (N,) array
        sqrt(sigma_i^2 (1 - 2 w_i) + sum w_j^2 sigma_j^2) [m].

    Notes
    -----
    What the mean adds is common to all satellites of the constellation; it vanishes in the user's clock but not in a
    B value.
    """
    mean_m2 = np.zeros(len(weights))
    for k in range(len(weights)):
        for i in range(len(sigma_m)):
            if weights[k, i] > 0.0:
                mean_m2[k] += (weights[k, i] * sigma_m[i]) ** 2
    result = np.empty(len(sigma_m))
    for i in range(len(sigma_m)):
        k = constellation[i]
        result[i] = math.sqrt(sigma_m[i] ** 2 * (1.0 - 2.0 * weights[k, i]) + mean_m2[k])
    return result
