"""Parameters of the guidance."""

from __future__ import annotations

import math
from typing import Annotated

from gbas_core.parameters import Parameter, parameters


@parameters
class SteeringParams:
    """Limits of the aircraft and what a change of flight has to bear. Ours."""

    max_bank_rad: Annotated[float, Parameter("largest bank commanded", "deg", 5.0, 80.0)] = math.radians(65.0)
    max_roll_rate_radps: Annotated[float, Parameter("largest roll rate commanded", "deg/s", 1.0, 180.0)] = math.radians(
        30.0
    )
    min_speed_mps: Annotated[float, Parameter("lowest airspeed in level flight at 1 g", "m/s", 5.0, 300.0)] = 70.0
    max_speed_mps: Annotated[float, Parameter("highest airspeed", "m/s", 10.0, 900.0)] = 320.0
    max_load_factor: Annotated[float, Parameter("largest in a level turn", "g", 1.1, 12.0)] = 4.0
    min_height_m: Annotated[
        float, Parameter("height above terrain below which nothing is commanded", "m", 0.0, 10_000.0)
    ] = 300.0
    horizon_s: Annotated[float, Parameter("over which a change must keep the satellites", "s", 2.0, 60.0)] = 8.0
    error_rad: Annotated[
        float, Parameter("error of bank, either way, with which it must keep them", "deg", 0.0, 15.0)
    ] = math.radians(3.0)
    share: Annotated[float, Parameter("step of bank between candidates, of the planned", "-", 0.02, 0.5)] = 0.1
    speed_share: Annotated[float, Parameter("change of speed of a candidate", "-", 0.0, 0.3)] = 0.1

    def __post_init__(self) -> None:
        if self.min_speed_mps >= self.max_speed_mps:
            raise ValueError(f"steering: min_speed_mps = {self.min_speed_mps!r} is not below max_speed_mps")
