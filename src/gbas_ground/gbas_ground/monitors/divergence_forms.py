"""The two forms of the two-frequency divergence test: chi-square statistics and their thresholds.

The published form has four statistics, one of which is a combination of two others; the form of full rank has the three
that are independent.

Source: Jiang, Milner, Macabiau, ENC 2015, eq (14) to (19).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final, Literal

import numpy as np
from scipy.special import chdtri

from gbas_core.ranging.combinations import iono_free_weights
from gbas_core.record import FloatArray
from gbas_ground.monitors.divergence_covariance import PRINTED_COVARIANCE
from gbas_ground.monitors.kernels.ccd_f import chi_squares, published

Form = Literal["published", "full_rank"]
DEGREES_OF_FREEDOM: Final[dict[Form, int]] = {"published": 4, "full_rank": 3}
PRINTED_INVERSE: Final = np.linalg.pinv(PRINTED_COVARIANCE)


@lru_cache(maxsize=16)
def threshold(form: Form, p_false_alarm: float) -> float:
    """Quantile of chi-square: 47.8795 for the paper's four statistics at 1e-9, 44.84 for the three [-]."""
    return float(chdtri(float(DEGREES_OF_FREEDOM[form]), p_false_alarm))


def with_iono_free_code(rates_mps: FloatArray, band: int, other: int) -> FloatArray:
    """The paper's four statistics (4, ..., N) from the three independent ones (3, ..., N).

    Notes
    -----
    ``CMC_IF = gamma/(gamma-1) CMC_DF1 - 1/(gamma-1) CMC_DF5``, and filters and means are linear.
    """
    near, far = iono_free_weights(band, other)
    code, other_code, carrier = rates_mps
    return np.stack([code, other_code, near * code + far * other_code, carrier])


def published_form(means_mps: FloatArray, receivers: FloatArray) -> FloatArray:
    """The paper's test metric with its printed covariance over M: ``M x^T pinv(Q) x`` [-].

    Parameters
    ----------
    means_mps : (4, N) array
    receivers : (N,) array
        M.

    Source: ENC 2015, eq (15) and (18).
    """
    numbers = np.asarray(receivers, dtype=np.float64).tolist()
    each = zip(np.array(means_mps.T, order="C"), numbers, strict=True)
    return np.array([published(x, number, PRINTED_INVERSE) for x, number in each])


def full_rank_form(rates_mps: FloatArray, covariance: FloatArray) -> FloatArray:
    """``x^T Q^-1 x`` of the three independent statistics [-].

    Parameters
    ----------
    rates_mps : (3, N) array
    covariance : (N, 3, 3) array
    """
    found: FloatArray = chi_squares(np.ascontiguousarray(rates_mps), np.ascontiguousarray(covariance))
    return found
