"""Parameters of the protection against ionospheric fronts, as they stand in the station's file.

Defaults are cautious: no error beyond the protection level is tolerable, two satellites are affected at once, an
aircraft may use any of the constellations and lack two of the satellites corrected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from gbas_core.parameters import ParameterError
from gbas_core.positioning.approach import FOOT_M, VAL_LOW_FT
from gbas_ground.declared import Declared, parameter
from gbas_ground.ionosphere.threat import THREATS, FrontThreat

_DEGREE: Final = math.pi / 180.0
NO_THREAT: Final = "none"
CUSTOM: Final = "custom"


@dataclass(frozen=True, kw_only=True)
class IonosphereSection(Declared):
    """Geometry screening against ionospheric fronts for approach service type C."""

    threat_model: str = parameter(
        "ionosphere", "threat_model", NO_THREAT, "-", "fronts protected against; none: there is no protection",
        choices=(NO_THREAT, *THREATS, CUSTOM),
    )  # fmt: skip
    elevation_rad: tuple[float, ...] = parameter(
        "ionosphere", "elevation_deg", (), "deg", "custom threat: nodes of the largest gradient, rising",
        low=0.0, high=90.0, per_unit=_DEGREE,
    )  # fmt: skip
    gradient: tuple[float, ...] = parameter(
        "ionosphere", "gradient", (), "m/m", "custom threat: largest slant gradient at the nodes", low=1e-6, high=5e-3
    )
    min_width_m: float = parameter(
        "ionosphere", "min_width_m", 25_000.0, "m", "custom threat: least width of a front", low=1_000.0, high=1.0e6
    )
    max_speed_mps: float = parameter(
        "ionosphere", "max_speed_mps", 750.0, "m/s", "custom threat: largest speed of a front", low=1.0, high=5_000.0
    )
    max_delay_m: float = parameter(
        "ionosphere", "max_delay_m", 50.0, "m", "custom threat: largest slant delay", low=1.0, high=500.0
    )
    affected: int = parameter("ionosphere", "affected", 2, "-", "satellites a front affects at once", low=1, high=2)
    tolerable_vertical_m: float = parameter(
        "ionosphere", "tolerable_vertical_m", 0.0, "m",
        "vertical error tolerated beyond the protection level at the decision height; 0: none", low=0.0, high=100.0,
    )  # fmt: skip
    tolerable_lateral_m: float = parameter(
        "ionosphere", "tolerable_lateral_m", 0.0, "m", "lateral error tolerated likewise", low=0.0, high=200.0
    )
    tolerable_growth: float = parameter(
        "ionosphere", "tolerable_growth", 0.0, "-", "growth of both per metre of height above the decision height",
        low=0.0, high=1.0,
    )  # fmt: skip
    decision_height_m: float = parameter(
        "ionosphere", "decision_height_m", VAL_LOW_FT * FOOT_M, "m", "above the threshold", low=20.0, high=300.0
    )
    max_missing: int = parameter(
        "ionosphere", "max_missing", 2, "-", "satellites corrected that an aircraft may lack", low=0, high=3
    )
    aircraft_systems: tuple[str, ...] = parameter(
        "ionosphere", "aircraft_systems", (), "-", "constellations used together, such as [G, GE]; empty: any"
    )
    aircraft_aad: str = parameter(
        "ionosphere", "aircraft_aad", "AB", "-", "airborne accuracy designators", choices=("A", "B", "AB")
    )
    aircraft_speed_mps: tuple[float, ...] = parameter(
        "ionosphere", "aircraft_speed_mps", (50.0, 85.0), "m/s", "slowest and fastest aircraft", low=10.0, high=150.0
    )
    k_noise: float = parameter(
        "ionosphere", "k_noise", 3.0, "-", "sigmas of nominal error on top of the front's", low=0.0, high=6.0
    )
    k_missed_detection: float = parameter(
        "ionosphere", "k_missed_detection", 3.719, "-", "sigmas above the divergence monitor's threshold that it sees",
        low=0.0, high=6.0,
    )  # fmt: skip
    renewal_s: float = parameter(
        "ionosphere", "renewal_s", 60.0, "s", "time after which the screening is made anew", low=10.0, high=300.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        systems = self.aircraft_systems
        if not isinstance(systems, tuple) or any(
            not isinstance(each, str) or not each or set(each) - set("GE") or len(set(each)) < len(each)
            for each in systems
        ):
            raise ParameterError(f"ionosphere.aircraft_systems = {systems!r} is not a list of G, E and GE")
        speeds = self.aircraft_speed_mps
        if len(speeds) != 2 or speeds[0] > speeds[1]:
            raise ParameterError(f"ionosphere.aircraft_speed_mps = {speeds!r} is not two numbers, the lower first")
        if self.threat_model == CUSTOM:
            self.threat()
        elif self.gradient or self.elevation_rad:
            raise ParameterError("ionosphere.gradient is given, but ionosphere.threat_model is not custom")

    @property
    def protects(self) -> bool:
        """Whether there is a threat model."""
        return self.threat_model != NO_THREAT

    def threat(self) -> FrontThreat:
        """The threat model.

        Raises
        ------
        ParameterError
            Without one, or when a custom one is none.
        """
        if self.threat_model in THREATS:
            return THREATS[self.threat_model]
        try:
            return FrontThreat(
                name=self.threat_model,
                elevation_rad=self.elevation_rad,
                gradient=self.gradient,
                min_width_m=self.min_width_m,
                max_speed_mps=self.max_speed_mps,
                max_delay_m=self.max_delay_m,
            )
        except ValueError as error:
            raise ParameterError(f"ionosphere: {error}") from None
