"""Parameters of the protection against ionospheric fronts, as they stand in the station's file.

Defaults are cautious: no error beyond the protection level is tolerable, two satellites are affected at once, an
aircraft may use any of the constellations and lack two of the satellites corrected.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal

from gbas_core.parameters import Parameter, ParameterError, parameters
from gbas_core.positioning.kernels.approach import FOOT_M, VAL_LOW_FT
from gbas_ground.ionosphere.threat import THREATS, FrontThreat

NO_THREAT: Final = "none"
CUSTOM: Final = "custom"


@parameters
class IonosphereSection:
    """Geometry screening against ionospheric fronts for approach service type C."""

    threat_model: Annotated[str, Parameter("fronts protected against; none: there is no protection")] = NO_THREAT
    elevation_rad: Annotated[
        tuple[float, ...], Parameter("custom threat: nodes of the largest gradient, rising", "deg", 0.0, 90.0)
    ] = ()
    gradient: Annotated[
        tuple[float, ...], Parameter("custom threat: largest slant gradient at the nodes", "m/m", 1e-6, 5e-3)
    ] = ()
    min_width_m: Annotated[float, Parameter("custom threat: least width of a front", "m", 1e3, 1e6)] = 25_000.0
    max_speed_mps: Annotated[float, Parameter("custom threat: largest speed of a front", "m/s", 1.0, 5e3)] = 750.0
    max_delay_m: Annotated[float, Parameter("custom threat: largest slant delay", "m", 1.0, 500.0)] = 50.0
    affected: Annotated[int, Parameter("satellites a front affects at once", "-", 1, 2)] = 2
    tolerable_vertical_m: Annotated[
        float,
        Parameter("vertical error tolerated beyond the protection level at the decision height; 0: none", "m", 0, 100),
    ] = 0.0
    tolerable_lateral_m: Annotated[float, Parameter("lateral error tolerated likewise", "m", 0.0, 200.0)] = 0.0
    tolerable_growth: Annotated[
        float, Parameter("growth of both per metre of height above the decision height", "-", 0.0, 1.0)
    ] = 0.0
    decision_height_m: Annotated[float, Parameter("above the threshold", "m", 20.0, 300.0)] = VAL_LOW_FT * FOOT_M
    max_missing: Annotated[int, Parameter("satellites corrected that an aircraft may lack", "-", 0, 3)] = 2
    aircraft_systems: Annotated[
        tuple[Literal["G", "E", "GE", "EG"], ...],
        Parameter("constellations used together, such as [G, GE]; empty: any"),
    ] = ()
    aircraft_aad: Annotated[Literal["A", "B", "AB"], Parameter("airborne accuracy designators")] = "AB"
    aircraft_speed_mps: Annotated[
        tuple[float, float], Parameter("slowest and fastest aircraft", "m/s", 10.0, 150.0)
    ] = (50.0, 85.0)  # fmt: skip
    k_noise: Annotated[float, Parameter("sigmas of nominal error on top of the front's", "-", 0.0, 6.0)] = 3.0
    k_missed_detection: Annotated[
        float, Parameter("sigmas above the divergence monitor's threshold that it sees", "-", 0.0, 6.0)
    ] = 3.719
    renewal_s: Annotated[float, Parameter("time after which the screening is made anew", "s", 10.0, 300.0)] = 60.0

    def __post_init__(self) -> None:
        known = (NO_THREAT, *THREATS, CUSTOM)
        if self.threat_model not in known:
            raise ParameterError(f"threat_model = {self.threat_model!r} is not one of {', '.join(map(repr, known))}")
        if self.aircraft_speed_mps[0] > self.aircraft_speed_mps[1]:
            raise ParameterError(f"aircraft_speed_mps = {self.aircraft_speed_mps} is not the lower one first")
        if self.threat_model == CUSTOM:
            self.threat()
        elif self.gradient or self.elevation_rad:
            raise ParameterError("gradient is given, but threat_model is not custom")

    @property
    def protects(self) -> bool:
        """Whether there is a threat model."""
        return self.threat_model != NO_THREAT

    def threat(self) -> FrontThreat:
        """The threat model.

        Raises
        ------
        ValueError
            Without one, or when a custom one is none.
        """
        if self.threat_model in THREATS:
            return THREATS[self.threat_model]
        return FrontThreat(
            name=self.threat_model,
            elevation_rad=self.elevation_rad,
            gradient=self.gradient,
            min_width_m=self.min_width_m,
            max_speed_mps=self.max_speed_mps,
            max_delay_m=self.max_delay_m,
        )
