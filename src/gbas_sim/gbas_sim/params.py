"""The section ``sim`` of a configuration file: a simulated world, beside what the station says of its site."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, Any, Final

from pydantic import BeforeValidator, Discriminator, Field, Tag

from gbas_core.parameters import Parameter, parameters
from gbas_sim.atmosphere.fronts import PlasmaBubble, WedgeFront
from gbas_sim.atmosphere.ionosphere import IonosphereParams
from gbas_sim.atmosphere.scintillation import ScintillationParams
from gbas_sim.atmosphere.troposphere import REFERENCE_HEIGHT, REFRACTIVITY, SCALE_HEIGHT, WeatherBox
from gbas_sim.faults.kinds import ReceiverKinds, SatelliteKinds
from gbas_sim.flight.params import FlightParams
from gbas_sim.flight.straight_in import StraightInParams
from gbas_sim.receivers.presets import AnyPreset
from gbas_sim.receivers.receiver import AIRBORNE_RECEIVER, GROUND_RECEIVER, AirborneReceiverParams, ReceiverParams
from gbas_sim.receivers.site_scene import Building, SceneParams
from gbas_sim.world_params import ConstellationParams, RunParams


@parameters
class TroposphereSection:
    """Exponential refractivity; what is left out is as the station says. Without a refractivity there is none."""

    refractivity: Annotated[float | None, REFRACTIVITY] = None
    scale_height_m: Annotated[float | None, SCALE_HEIGHT] = None
    reference_height_m: Annotated[float | None, REFERENCE_HEIGHT] = None


_PRESET: Final = "preset"
_OWN: Final = "own"


def _receiver_kind(section: Any) -> str:
    """Whether a receiver is a preset or has all parameters of its own."""
    own = isinstance(section, ReceiverParams) or (isinstance(section, Mapping) and _PRESET not in section)
    return _OWN if own else _PRESET


GroundReceiver = Annotated[
    Annotated[ReceiverParams, Tag(_OWN)] | Annotated[AnyPreset, Tag(_PRESET)], Discriminator(_receiver_kind)
]
AirborneReceiver = Annotated[
    Annotated[AirborneReceiverParams, Tag(_OWN)] | Annotated[AnyPreset, Tag(_PRESET)], Discriminator(_receiver_kind)
]
Threat = Annotated[
    WedgeFront | PlasmaBubble | WeatherBox | Building | SatelliteKinds | ReceiverKinds, Field(discriminator="kind")
]


# A section without keys is as if it were left out.
_LEFT_OUT: Final = BeforeValidator(lambda section: None if section == {} else section)


@parameters
class SimParams(RunParams):
    """A simulated world, beside what the station says of its site."""

    aircraft: Annotated[bool, Parameter("false: a station alone")] = True
    approach: Annotated[str | None, Parameter("approach that is flown, when the station has several")] = None
    constellation: ConstellationParams = ConstellationParams()
    flight: FlightParams = StraightInParams()
    troposphere: TroposphereSection = TroposphereSection()
    ionosphere: Annotated[IonosphereParams | None, _LEFT_OUT] = None
    scintillation: Annotated[ScintillationParams | None, _LEFT_OUT] = None
    scene: Annotated[SceneParams | None, _LEFT_OUT] = None
    ground_receiver: GroundReceiver = GROUND_RECEIVER
    airborne_receiver: AirborneReceiver = AIRBORNE_RECEIVER
    threats: dict[str, Threat] = field(default_factory=dict)
