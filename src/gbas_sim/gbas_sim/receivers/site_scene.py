"""Reflections and shadows at the reference receivers: the ground below their antennas and buildings around them.

The scene stands still, so that what it does comes back with the satellites. Every antenna stands on level ground at its
own height, buildings stand on the same ground. The aircraft is not in it: what its own frame reflects is part of the
airborne presets. Carriers move by millimetres over minutes; the Doppler of that is left out.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal

import numpy as np

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.signal.antenna import ANTENNAS
from gbas_core.signal.rays import RayErrors, Scene, ray_errors
from gbas_core.signal.surfaces import MATERIAL, MATERIALS, Facet, box
from gbas_sim.atmosphere.paths import SignalPaths, Station
from gbas_sim.faults.fault_base import SignalEffect

_SIZE_M: Final = (0.1, 10_000.0)
_AWAY_M: Final = (-20_000.0, 20_000.0)


@parameters
class Building:
    """A box on the ground."""

    kind: Annotated[Literal["building"], Parameter("kind of the threat")] = "building"
    east_m: Annotated[float, Parameter("its middle, east of the station", "m", *_AWAY_M)]
    north_m: Annotated[float, Parameter("its middle, north of the station", "m", *_AWAY_M)]
    length_m: Annotated[float, Parameter("along its heading", "m", *_SIZE_M)]
    width_m: Annotated[float, Parameter("across its heading", "m", *_SIZE_M)]
    height_m: Annotated[float, Parameter("up", "m", *_SIZE_M)]
    heading_rad: Annotated[float, Parameter("clockwise from north", "deg", math.degrees(-7.0), math.degrees(7.0))] = 0.0
    material: Annotated[str, MATERIAL] = "concrete"

    @property
    def facets(self) -> tuple[Facet, ...]:
        """Walls and roof."""
        return box(
            center_m=(self.east_m, self.north_m),
            size_m=(self.length_m, self.width_m, self.height_m),
            heading_rad=self.heading_rad,
            material=self.material,
        )


@parameters
class SceneParams:
    """The ground and the antennas on it."""

    ground: Annotated[
        str, Parameter("material of the ground; empty is ground that reflects nothing", choices=("", *MATERIALS))
    ] = "ground"
    antenna: Annotated[
        str, Parameter("how strong reflections are against the direct signal", choices=tuple(ANTENNAS))
    ] = "mla"
    antenna_height_m: Annotated[float, Parameter("height of the antennas above the ground", "m", 0.1, 100.0)] = 3.0


class SiteScene:
    """What a site does to the signals of its reference receivers.

    Parameters
    ----------
    params : SceneParams
    buildings : tuple of Building
    station : Station
        Whose horizontal plane the scene is laid out in.
    receivers : int
        How many reference receivers there are; they come first among the receivers of a world.
    spacing_chips : (float, float, float)
        Of their correlators, see :func:`gbas_core.signal.rays.ray_errors` [chips].
    """

    def __init__(
        self,
        params: SceneParams,
        buildings: tuple[Building, ...],
        *,
        station: Station,
        receivers: int,
        spacing_chips: tuple[float, float, float],
    ) -> None:
        self._params, self._station = params, station
        self._receivers, self._spacing_chips = receivers, spacing_chips
        facets = tuple(facet for building in buildings for facet in building.facets)
        self._scene = Scene(facets=facets, ground=params.ground or None)

    def effect(self, paths: SignalPaths) -> SignalEffect:
        """Errors, changes of C/N0 and shadows, for all receivers of the paths."""
        rows = slice(0, self._receivers)
        place = _along_axes(self._station, paths.position_m[rows] - self._station.position_m)
        place[:, 2] = self._params.antenna_height_m
        directions = _along_axes(self._station, paths.los[rows])
        rays = self._scene.trace(place, directions, ANTENNAS[self._params.antenna])
        errors: RayErrors = ray_errors(rays, self._spacing_chips)
        effect = SignalEffect.none(paths.position_m.shape[0])
        effect.code_m[rows] = errors.code_m
        effect.carrier_m[rows] = errors.carrier_m
        effect.cn0_db[rows] = errors.cn0_db
        effect.tracked[rows] = rays.visible[:, np.newaxis]
        return effect


def _along_axes(station: Station, vector: FloatArray) -> FloatArray:
    """ECEF vectors ``(R, 3)`` or ``(R, 3, N)`` as east, north and up of the station."""
    axes = station.axes
    return np.stack([axis[0] * vector[:, 0] + axis[1] * vector[:, 1] + axis[2] * vector[:, 2] for axis in axes], axis=1)
