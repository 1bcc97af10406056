"""Corrections, B values and their thresholds by whole arrays: the second formulation of the compiled loops.

Arrays are ``(..., R, N)``: reference receivers, then the satellite axis; leading axes are smoothing constants.
"""

from __future__ import annotations

import numpy as np

from gbas_core.satellites import CLOCK_GROUPS

MAX_B_VALUE_M = 6.35


def common_satellites(candidate, *, min_common, min_receivers):
    """As :func:`gbas_ground.corrections.kernels.formation.common_satellites` has it, constellation by constellation."""
    n_receivers = candidate.shape[0]
    in_use = np.zeros((len(CLOCK_GROUPS), n_receivers), dtype=bool)
    common = np.zeros(CLOCK_GROUPS.shape, dtype=bool)
    for k, group in enumerate(CLOCK_GROUPS):
        own = candidate & group
        counts = own.sum(axis=1)
        receivers = counts >= min_common
        while int(receivers.sum()) >= max(1, min_receivers):
            tracked = own[receivers].all(axis=0)
            if int(tracked.sum()) >= min_common:
                in_use[k], common[k] = receivers, tracked
                break
            last = n_receivers - 1 - int(np.where(receivers, counts, np.iinfo(np.int64).max)[::-1].argmin())
            receivers = receivers & (np.arange(n_receivers) != last)
    return in_use, common


def clock_weights(common, elevation_rad=None):
    """Weights of the common satellites in the mean that removes the receiver clock, ``(k, N)``; each row sums to 1.

    Parameters
    ----------
    common : (k, N) bool array
    elevation_rad : (N,) array or None
        Elevations: weights go with sin^2; None: a plain mean.

    Source: plain mean, RTCA DO-245A 3.2; elevation-weighted mean, EUROCAE ED-114 (weights not published: ours).
    """
    raw = np.ones(common.shape[-1]) if elevation_rad is None else np.sin(elevation_rad) ** 2
    weights = np.where(common, raw, 0.0)
    total = weights.sum(axis=1, keepdims=True)
    return np.asarray(weights / np.where(total > 0.0, total, 1.0))


def receiver_clock_m(correction_m, weights):
    """Receiver clock in the corrections: the (weighted) mean over the common satellites of each constellation.

    Parameters
    ----------
    correction_m : (..., R, N) array
        PR_sc [m].
    weights : (k, N) array
        From :func:`clock_weights`.

    Returns
    -------
    (..., R, N) array
        Clock term of each channel [m]; NaN without a common set, or where a receiver lacks a common satellite.

    Source: RTCA DO-245A 3.2: PR_sca = PR_sc - (1/N_c) sum over S_c of PR_sc.
    """
    clock = np.full(correction_m.shape, np.nan)
    for row, group in zip(weights, CLOCK_GROUPS, strict=True):
        if (row > 0.0).any():
            # a missing common satellite leaves NaN: a mean over another set would not compare with other receivers'
            mean = np.where(row > 0.0, correction_m * row, 0.0).sum(axis=-1, keepdims=True)
            clock = np.where(group, mean, clock)
    return clock


def average_m(correction_m, used):
    """PRC: mean over the receivers used on each satellite, ``(..., N)``; NaN where none is.

    Source: RTCA DO-245A 3.2: PRC(i) = (1/M_i) sum over m of PR_sca(i, m).
    """
    count = used.sum(axis=0)
    total = np.where(used, correction_m, 0.0).sum(axis=-2)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def b_values_m(correction_m, used):
    """B values: the correction less what it would be without one receiver.

    Parameters
    ----------
    correction_m : (..., R, N) array
        PR_sca [m].
    used : (R, N) bool array
        Receivers used on each satellite.

    Returns
    -------
    (..., R, N) array
        B [m]; NaN where the receiver is not used, and everywhere on a satellite with fewer than two receivers.

    Source: RTCA DO-245A 3.2: B(i, m) = PRC(i) - (1/(M_i - 1)) sum over k other than m of PR_sca(i, k).
    """
    count = used.sum(axis=0)
    values = np.where(used, correction_m, 0.0)
    total = values.sum(axis=-2, keepdims=True)
    others = (total - values) / np.maximum(count - 1, 1)
    return np.where(used & (count >= 2), total / np.maximum(count, 1) - others, np.nan)


def rate_mps(correction_m, previous_m, dt_s, weights, used):
    """RRC: rate of the corrections, ``(..., N)``.

    Parameters
    ----------
    correction_m, previous_m : (..., R, N) arrays
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
    change = correction_m - previous_m
    return average_m(change - receiver_clock_m(change, weights), used) / dt_s


def clock_removed_sigma_m(sigma_m, weights):
    """Sigma of a correction after removal of the clock, from the sigmas before it.

    Parameters
    ----------
    sigma_m : (..., N) array
        Sigma of each satellite's correction [m]; NaN where there is none.
    weights : (k, N) array
        Clock weights.

    Returns
    -------
    (..., N) array
        sqrt(sigma_i^2 (1 - 2 w_i) + sum w_j^2 sigma_j^2) [m].

    Notes
    -----
    What the mean adds is common to all satellites of the constellation; it vanishes in the user's clock but not in a
    B value.
    """
    variance = sigma_m**2
    own = weights.sum(axis=0)  # each satellite belongs to one constellation
    result = np.full(variance.shape, np.nan)
    for row, group in zip(weights, CLOCK_GROUPS, strict=True):
        mean = np.where(row > 0.0, row**2 * variance, 0.0).sum(axis=-1, keepdims=True)
        result = np.where(group, variance * (1.0 - 2.0 * own) + mean, result)
    return np.asarray(np.sqrt(result))


def b_failures(b_m, sigma_m, used, k_b):
    """Size, threshold and failure of every B value."""
    count = used.sum(axis=0)
    limit = np.minimum(k_b * sigma_m / np.sqrt(np.maximum(count * (count - 1), 1)), MAX_B_VALUE_M)[..., np.newaxis, :]
    size = np.abs(b_m)
    return size, limit, used & (count >= 2) & ~(size <= limit)


def unused_residual_m(correction_m, settled, common, prc_m, min_common):
    """PR_sc less PRC, with each receiver's clock estimated against the PRC of the common satellites it has."""
    against = correction_m - prc_m[:, np.newaxis, :]
    usable = settled & np.isfinite(against).all(axis=0) & common.any(axis=0)
    residual = np.full(against.shape, np.nan)
    for group in CLOCK_GROUPS:
        own = usable & group
        number = own.sum(axis=1)
        total = np.where(own, against, 0.0).sum(axis=-1)
        clock = np.where(number >= min_common, total / np.maximum(number, 1), np.nan)
        residual = np.where(group, against - clock[..., np.newaxis], residual)
    return residual
