"""Missed detection against rate and error, what is required, and the mapping functions that just meet it.

Source: ENC 2015, 5, figures 7 to 10; requirement, GAST D range domain, ICAO NSP (limit case).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar
from scipy.special import chndtr, chndtrinc, ndtr, ndtri

from gbas_core.record import FloatArray
from gbas_ground.monitors.divergence_forms import DEGREES_OF_FREEDOM, Form, threshold
from gbas_studies.ccd.monitors import Monitor

# Known: limit case of the GAST D range domain requirement.
FREE_M: Final = 0.75
FULL_M: Final = 2.7
_SLOPE: Final = -2.56
_OFFSET: Final = 1.92
_LEAST: Final = 1e-5


def required_p_md(error_m: ArrayLike) -> FloatArray:
    """Largest probability of missed detection allowed for a differential error [-].

    1 below 0.75 m, ``10^(-2.56 |E| + 1.92)`` up to 2.7 m, 1e-5 from there on (the curve is continuous to 2 %).
    """
    size = np.abs(np.asarray(error_m, dtype=np.float64))
    middle = 10.0 ** np.clip(_SLOPE * size + _OFFSET, -30.0, 0.0)
    return np.asarray(np.where(size < FREE_M, 1.0, np.where(size < FULL_M, middle, _LEAST)))


def p_md(monitor: Monitor, statistic: ArrayLike) -> FloatArray:
    """Probability that a statistic of this expectation stays below the threshold [-].

    Parameters
    ----------
    monitor : Monitor
    statistic : array
        Expectation of F2 [m/s] for GAST D, square root of the non-centrality [-] for GAST F.
    """
    mean = np.asarray(statistic, dtype=np.float64)
    if monitor.freedom == 0:
        limit, sigma = monitor.threshold, monitor.sigma_mps
        return np.asarray(ndtr((limit - mean) / sigma) - ndtr((-limit - mean) / sigma))
    return np.asarray(chndtr(monitor.threshold**2, float(monitor.freedom), mean**2))


def critical_mapping_gast_d(sigma_mps: float, threshold_mps: float) -> tuple[float, float]:
    """Smallest F2/E that meets the requirement for every error [1/s], and the error that decides [m].

    One-sided, as the paper has it: ``P_md = Phi((threshold - F2) / sigma)``.
    """
    return _critical(lambda error_m: threshold_mps - sigma_mps * float(ndtri(_required(error_m))))


def critical_mapping_gast_f(form: Form, p_false_alarm: float, *, power: int = 1) -> tuple[float, float]:
    """Smallest delta/E^power that meets the requirement for every error, and the error that decides [m].

    Parameters
    ----------
    form : {"published", "full_rank"}
    p_false_alarm : float
    power : {1, 2}
        1: ``delta = m E`` [1/m], as the paper's 56.6 must be; 2: ``delta = m E^2`` [1/m^2], which the monitor obeys.
    """
    limit, freedom = threshold(form, p_false_alarm), float(DEGREES_OF_FREEDOM[form])
    return _critical(lambda error_m: float(chndtrinc(limit, freedom, _required(error_m))), power=power)


def _required(error_m: float) -> float:
    return float(required_p_md(error_m))


def _critical(needed: Callable[[float], float], power: int = 1) -> tuple[float, float]:
    """Largest of ``needed(E) / E^power`` between the two corners, and at 2.7 m; beyond it falls."""
    inner = minimize_scalar(
        lambda error_m: -needed(error_m) / error_m**power, bounds=(FREE_M + 1e-6, FULL_M - 1e-9), method="bounded",
        options={"xatol": 1e-10},
    )  # fmt: skip
    found = [(-float(inner.fun), float(inner.x)), (needed(FULL_M) / FULL_M**power, FULL_M)]
    return max(found)
