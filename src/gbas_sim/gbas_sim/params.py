"""The section ``sim`` of a configuration file: a simulated world, beside what the station says of its site."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag

from gbas_core.parameters import Parameter, ParameterError, parameters
from gbas_sim.atmosphere.fronts import PlasmaBubble, WedgeFront
from gbas_sim.atmosphere.ionosphere import IonosphereParams
from gbas_sim.atmosphere.scintillation import ScintillationParams
from gbas_sim.atmosphere.troposphere import REFERENCE_HEIGHT, REFRACTIVITY, SCALE_HEIGHT, WeatherBox
from gbas_sim.faults.kinds import ReceiverKinds, SatelliteKinds
from gbas_sim.flight.params import FlightParams
from gbas_sim.flight.straight_in import StraightInParams
from gbas_sim.receivers.presets import AirbornePresetParams, GroundPresetParams, IdealPresetParams
from gbas_sim.receivers.receiver import AIRBORNE_RECEIVER, GROUND_RECEIVER, AirborneReceiverParams, ReceiverParams
from gbas_sim.receivers.site_scene import Building, SceneParams

LONGEST_S = 7.0 * 86_400.0


@parameters
class ConstellationParams:
    """Where orbits are from; without files they are nominal."""

    almanac: Annotated[str, Parameter("YUMA or SEM file")] = ""
    navigation: Annotated[
        tuple[str, ...],
        Parameter("RINEX navigation files"),
        BeforeValidator(lambda files: (files,) if isinstance(files, str) else files),
    ] = ()

    def __post_init__(self) -> None:
        if self.almanac and self.navigation:
            raise ParameterError("almanac and navigation are both given; orbits have one source")


@parameters
class TroposphereSection:
    """Exponential refractivity; what is left out is as the station says. Without a refractivity there is none."""

    refractivity: Annotated[float | None, REFRACTIVITY] = None
    scale_height_m: Annotated[float | None, SCALE_HEIGHT] = None
    reference_height_m: Annotated[float | None, REFERENCE_HEIGHT] = None


_PRESETS = {
    **dict.fromkeys(("gad_a", "gad_b", "gad_c"), "GroundPresetParams"),
    **dict.fromkeys(("aad_a", "aad_b"), "AirbornePresetParams"),
    "ideal": "IdealPresetParams",
}


def _receiver_kind(section: Any, plain: str) -> str:
    """Class of a receiver's section; an unknown preset is refused by any class that has one."""
    if not isinstance(section, Mapping):
        return type(section).__name__
    preset = section.get("preset", ...)
    return plain if preset is ... else _PRESETS.get(str(preset), "GroundPresetParams")


_Presets = (
    Annotated[GroundPresetParams, Tag("GroundPresetParams")]
    | Annotated[AirbornePresetParams, Tag("AirbornePresetParams")]
    | Annotated[IdealPresetParams, Tag("IdealPresetParams")]
)
GroundReceiver = Annotated[
    Annotated[ReceiverParams, Tag("ReceiverParams")] | _Presets,
    Discriminator(lambda section: _receiver_kind(section, "ReceiverParams")),
]
AirborneReceiver = Annotated[
    Annotated[AirborneReceiverParams, Tag("AirborneReceiverParams")] | _Presets,
    Discriminator(lambda section: _receiver_kind(section, "AirborneReceiverParams")),
]
Threat = Annotated[
    WedgeFront | PlasmaBubble | WeatherBox | Building | SatelliteKinds | ReceiverKinds, Field(discriminator="kind")
]


@parameters
class SimParams:
    """A simulated world, beside what the station says of its site."""

    systems: Annotated[Literal["G", "E", "GE", "EG"], Parameter("satellite systems")] = "GE"
    start_week: Annotated[int, Parameter("GPS week of the first epoch", "-", 1024, 8191)] = 2400
    start_tow_s: Annotated[
        float, Parameter("time of week of the first epoch; whole milliseconds", "s", 0.0, 604_799.999)
    ] = 216_000.0
    interval_s: Annotated[float, Parameter("between epochs; whole milliseconds", "s", 0.01, 60.0)] = 0.5
    seed: Annotated[int, Parameter("of everything random", "-", 0, 2**63 - 1)] = 1
    duration_s: Annotated[float | None, Parameter("when not that of the flight", "s", 0.0, LONGEST_S)] = None
    aircraft: Annotated[bool, Parameter("false: a station alone")] = True
    approach: Annotated[str | None, Parameter("approach that is flown, when the station has several")] = None
    constellation: ConstellationParams = ConstellationParams()
    flight: FlightParams = StraightInParams()
    troposphere: TroposphereSection = TroposphereSection()
    ionosphere: IonosphereParams | None = None
    scintillation: ScintillationParams | None = None
    scene: SceneParams | None = None
    ground_receiver: GroundReceiver = GROUND_RECEIVER
    airborne_receiver: AirborneReceiver = AIRBORNE_RECEIVER
    threats: dict[str, Threat] = Field(default_factory=dict)
