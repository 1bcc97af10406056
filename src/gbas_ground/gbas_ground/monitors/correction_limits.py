"""Size of the corrections: what the standard allows, and what the message can carry."""

from __future__ import annotations

from typing import Annotated

from gbas_core.parameters import Parameter, parameters


@parameters
class CorrectionLimitsParams:
    """Limits of the corrections.

    Source: 327.67 m, range of the type 1 message (ICAO Annex 10 vol. I, table B-63); 3.4 m/s, an early LAAS prototype.
    """

    max_prc_m: Annotated[float, Parameter("limit of |PRC|", "m", 1.0, 327.67)] = 327.67
    max_rrc_mps: Annotated[float, Parameter("limit of |RRC|", "m/s", 0.01, 32.767)] = 3.4
