"""Size of the corrections: what the standard allows, and what the message can carry."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import BoolArray, FloatArray
from gbas_ground.monitors.result import MonitorResult, upper_limit


@parameters
class CorrectionLimitsParams:
    """Limits of the corrections."""

    max_prc_m: Annotated[float, Parameter("limit of |PRC|", "m", 1.0, 327.67)] = 327.67
    max_rrc_mps: Annotated[float, Parameter("limit of |RRC|", "m/s", 0.01, 32.767)] = 3.4


def check_correction(correction: FloatArray, applies: BoolArray, limit: float) -> MonitorResult:
    """Fail satellites whose correction is larger than its limit.

    Parameters
    ----------
    correction : (..., N) array
        PRC [m] or RRC [m/s].
    applies : (N,) bool array
        Satellites that have corrections.
    limit : float
        In the correction's unit.

    Source: 327.67 m, range of the type 1 message (ICAO Annex 10 vol. I, table B-63); 3.4 m/s, an early LAAS prototype.
    """
    return upper_limit(np.abs(correction), limit, np.broadcast_to(applies, correction.shape))
