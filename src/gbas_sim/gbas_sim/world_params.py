"""What a simulated world depends on: its run, satellites, receivers, flight, atmosphere and faults."""

from __future__ import annotations

import math
from typing import Annotated, Any, Final, Protocol, runtime_checkable

from numpy.typing import ArrayLike
from pydantic import BeforeValidator, InstanceOf

from gbas_core.parameters import Parameter, ParameterError, parameters
from gbas_core.record import FloatArray
from gbas_sim.atmosphere.fronts import PlasmaBubble, WedgeFront
from gbas_sim.atmosphere.ionosphere import IonosphereParams
from gbas_sim.atmosphere.paths import Station
from gbas_sim.atmosphere.scintillation import ScintillationParams
from gbas_sim.atmosphere.troposphere import Troposphere, WeatherBox
from gbas_sim.faults.kinds import RECEIVERS, ReceiverFault, SatelliteFault
from gbas_sim.receivers.receiver import AIRBORNE_RECEIVER, GROUND_RECEIVER, ReceiverParams
from gbas_sim.receivers.receiver_model import ReceiverModel
from gbas_sim.receivers.site_scene import Building, SceneParams

MAX_RECEIVERS: Final = 4
LONGEST_S: Final = 7.0 * 86_400.0
_EARTH_SURFACE_M: Final = (6.3e6, 6.5e6)
_FARTHEST_M: Final = 20_000.0


@runtime_checkable
class FlightPath(Protocol):
    """Where an aircraft is: :class:`gbas_sim.flight.straight_in.StraightIn` or
    :class:`gbas_sim.flight.dynamics.Flight`.
    """

    @property
    def duration_s(self) -> float:
        """From the start to the end [s]."""
        ...

    def state(self, since_start_s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Position and velocity ``(..., 3)``, ECEF [m], [m/s], at times since the start ``(...)`` [s]."""
        ...

    def antenna_axis(self, since_start_s: ArrayLike) -> FloatArray | None:
        """Where the antenna points, unit vectors ``(..., 3)``, ECEF, at times; None is straight up at all of them."""
        ...

    def attitude(self, since_start_s: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Roll, pitch and true heading at times [rad]."""
        ...


def _files(value: Any) -> Any:
    """One file as a list of one; empty names left out."""
    files = [value] if isinstance(value, str) else value
    return [each for each in files if each != ""] if isinstance(files, list | tuple) else files


@parameters
class RunParams:
    """When a run is, of which satellites, and with which random numbers."""

    systems: Annotated[str, Parameter("constellations", choices=("G", "E", "GE", "EG"))] = "GE"
    start_week: Annotated[int, Parameter("GPS week of the first epoch", "weeks", 1024, 8191)] = 2400
    start_tow_s: Annotated[
        float, Parameter("time of week of the first epoch, whole milliseconds", "s", 0.0, 604_799.999)
    ] = 216_000.0
    interval_s: Annotated[float, Parameter("between epochs, whole milliseconds", "s", 0.01, 60.0)] = 0.5
    seed: Annotated[int, Parameter("of everything random", "-", 0, 2**63 - 1)] = 1
    duration_s: Annotated[
        float | None, Parameter("of the run; that of the flight unless given", "s", 0.0, LONGEST_S)
    ] = None

    def __post_init__(self) -> None:
        for key in ("start_tow_s", "interval_s"):
            value = getattr(self, key)
            if abs(value * 1000.0 - round(value * 1000.0)) > 1e-6:
                raise ValueError(f"{key} = {value!r} is not a whole number of milliseconds")


@parameters
class ConstellationParams:
    """Where orbits are from; without any file they are nominal."""

    almanac: Annotated[str, Parameter("YUMA or SEM file whose orbits are taken; empty is none")] = ""
    navigation: Annotated[
        tuple[str, ...], BeforeValidator(_files), Parameter("RINEX navigation files whose orbits are taken")
    ] = ()

    def __post_init__(self) -> None:
        if self.almanac and self.navigation:
            raise ValueError("almanac and navigation are both given; orbits have one source")


@parameters
class WorldParams(RunParams, ConstellationParams):
    """All a simulated world depends on.

    Attributes
    ----------
    receiver_ecef_m : tuple of (float, float, float)
        Antennas of 1 to 4 reference receivers, ECEF [m].
    flight : FlightPath or None
        None is a station alone.
    station_ecef_m : (float, float, float), optional
        What distances of the atmosphere are measured from [m]; the first receiver unless given.
    troposphere : Troposphere
    weather : tuple of WeatherBox
    ionosphere : IonosphereParams, optional
        None is none.
    fronts : tuple of WedgeFront or PlasmaBubble
    scintillation : ScintillationParams, optional
        None is none.
    faults : tuple of SatelliteFault or ReceiverFault
    scene : SceneParams, optional
        Ground that reflects at the reference receivers; None is none.
    buildings : tuple of Building
        Around them; on ground that reflects nothing, unless there is a scene.
    ground, airborne : ReceiverParams or ReceiverModel
    """

    receiver_ecef_m: tuple[tuple[float, float, float], ...]
    flight: InstanceOf[FlightPath] | None
    station_ecef_m: tuple[float, float, float] | None = None
    troposphere: Troposphere = Troposphere()
    weather: tuple[WeatherBox, ...] = ()
    ionosphere: IonosphereParams | None = None
    fronts: tuple[WedgeFront | PlasmaBubble, ...] = ()
    scintillation: ScintillationParams | None = None
    faults: tuple[InstanceOf[SatelliteFault] | InstanceOf[ReceiverFault], ...] = ()
    scene: SceneParams | None = None
    buildings: tuple[Building, ...] = ()
    ground: InstanceOf[ReceiverParams] | InstanceOf[ReceiverModel] = GROUND_RECEIVER
    airborne: InstanceOf[ReceiverParams] | InstanceOf[ReceiverModel] = AIRBORNE_RECEIVER

    def __post_init__(self) -> None:
        RunParams.__post_init__(self)
        ConstellationParams.__post_init__(self)
        self._check_duration()
        self._check_sites()

    def _check_duration(self) -> None:
        if self.flight is None and self.duration_s is None:
            raise ParameterError("world: duration_s is missing, and there is no flight to take it from", missing=True)
        if self.duration_s is not None and self.flight is not None and self.duration_s > self.flight.duration_s:
            longest = self.flight.duration_s
            raise ValueError(f"world: duration_s = {self.duration_s:g} is longer than the flight, {longest:g}")

    def _check_sites(self) -> None:
        if not 1 <= len(self.receiver_ecef_m) <= MAX_RECEIVERS:
            raise ValueError(
                f"world: receiver_ecef_m has {len(self.receiver_ecef_m)} positions, not 1 to {MAX_RECEIVERS}"
            )
        for number, position in enumerate(self.receiver_ecef_m, 1):
            if len(position) != 3 or not _EARTH_SURFACE_M[0] <= math.hypot(*position) <= _EARTH_SURFACE_M[1]:
                raise ValueError(f"world: receiver_ecef_m of receiver {number} = {position!r} is not on the Earth")
            away_m = math.dist(position, self.station.ecef_m)
            if not away_m <= _FARTHEST_M:
                raise ValueError(
                    f"world: receiver_ecef_m of receiver {number} is {away_m:.0f} m from the station, more than "
                    f"{_FARTHEST_M:.0f}"
                )

    @property
    def receiver_names(self) -> tuple[str, ...]:
        """Names of the receivers, as in :data:`gbas_sim.faults.kinds.RECEIVERS`; the aircraft's last."""
        ground = RECEIVERS[: len(self.receiver_ecef_m)]
        return ground if self.flight is None else (*ground, RECEIVERS[-1])

    @property
    def station(self) -> Station:
        """What distances are measured from."""
        return Station(ecef_m=self.station_ecef_m or self.receiver_ecef_m[0])

    @property
    def length_s(self) -> float:
        """Of the run [s]."""
        if self.duration_s is not None:
            return self.duration_s
        return self.flight.duration_s if self.flight is not None else 0.0

    @property
    def n_epochs(self) -> int:
        """Epochs of the run; a flight's last is at or before its end."""
        return int(self.length_s / self.interval_s) + 1
