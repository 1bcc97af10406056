"""Second formulations of the divergence filters and of the two-frequency monitor: plain loops, channel by channel."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

GAMMA_L5 = (154.0 / 115.0) ** 2


def filtered_rates(rates: np.ndarray, alpha: float) -> np.ndarray:
    """Both filters as one second-order filter of scipy: a^2 / (1 - q z^-1)^2."""
    q = 1.0 - alpha
    return lfilter([alpha**2], [1.0, -2.0 * q, q * q], rates)


def filter_with_gaps(times: np.ndarray, values: np.ndarray, tau: float) -> tuple[list[float], float]:
    """F2 after each measurement (NaN missing), each step as long as its own interval; and the age at the end."""
    f1 = f2 = 0.0
    last = None
    out, age = [], 0.0
    for time, value in zip(times, values, strict=True):
        if np.isnan(value):
            out.append(np.nan)
            continue
        if last is None:
            out.append(np.nan)
        else:
            step = time - last[0]
            a = min(step / tau, 1.0)
            f1 = (1 - a) * f1 + a * (value - last[1]) / step
            f2 = (1 - a) * f2 + a * f1
            age += step
            out.append(f2)
        last = (time, value)
    return out, age


def four_statistics(rho1, rho5, phi1, phi5, gamma=GAMMA_L5):
    """Equations (8) to (11) of the paper, written out."""
    return (
        rho1 - phi1 + 2.0 / (1.0 - gamma) * (phi1 - phi5),
        rho5 - phi5 - 2.0 * gamma / (gamma - 1.0) * (phi1 - phi5),
        gamma / (gamma - 1.0) * (rho1 - phi1) - 1.0 / (gamma - 1.0) * (rho5 - phi5),
        gamma / (gamma - 1.0) * phi1 - 1.0 / (gamma - 1.0) * phi5,
    )


def clock_free(rates: np.ndarray, groups: list[list[int]]) -> np.ndarray:
    """Each rate less the mean of the others of its group, (N,)."""
    result = np.full(len(rates), np.nan)
    for group in groups:
        for i in group:
            others = [rates[j] for j in group if j != i and not np.isnan(rates[j])]
            if others and not np.isnan(rates[i]):
                result[i] = rates[i] - sum(others) / len(others)
    return result


def hatch(code: list[float], carrier: list[float], alpha: float, variant: bool) -> float:
    """Last smoothed range of a filter that starts with the first code: eq (19), sample by sample."""
    smoothed = code[0]
    for m in range(1, len(code)):
        weight = max(1.0 / m, alpha) if variant else alpha
        smoothed = weight * code[m] + (1.0 - weight) * (smoothed + carrier[m] - carrier[m - 1])
    return smoothed


def differential_error(
    code_rate: float, carrier_rate: float, t_a: float, *, variant: bool, updates: int = 99, t_g: float = -360.0,
    interval: float = 0.5, tau: float = 30.0,
) -> float:  # fmt: skip
    """|air - ground| after so many updates of the air filter; the ramp acts from t = 0 on."""
    alpha = interval / tau
    end = round(t_a / interval) + updates

    def smoothed(start_s: float) -> float:
        samples = range(round(start_s / interval), end + 1)
        ramp = [max(n, 0) * interval for n in samples]
        return hatch([code_rate * r for r in ramp], [carrier_rate * r for r in ramp], alpha, variant)

    return abs(smoothed(t_a) - smoothed(t_g))


def ccd_statistic(rate: float, t_a: float, *, updates: int = 99, interval: float = 0.5, tau: float = 30.0) -> float:
    """F2 of a ramp of code minus carrier at the same sample, by the recursion."""
    alpha, f1, f2 = interval / tau, 0.0, 0.0
    for _ in range(max(round(t_a / interval) + updates, 0)):
        f1 += alpha * (rate - f1)
        f2 += alpha * (f1 - f2)
    return f2
