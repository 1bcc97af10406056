"""Multiple reference consistency check (MRCC): do the reference receivers agree?

B values are compared where corrections are formed (:mod:`gbas_ground.consistency`), because what fails is left out and
the rest formed again.
"""

from __future__ import annotations

from typing import Annotated

from gbas_core.parameters import Parameter, parameters


@parameters
class BValueParams:
    """B values against their sigma."""

    k_b: Annotated[float, Parameter("multiplier of the B value threshold", "-", 1.0, 20.0)] = 5.5
