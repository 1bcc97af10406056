"""Reflections and shadows at the reference receivers: the ground below their antennas and buildings around them.

The scene stands still, so that what it does comes back with the satellites. Every antenna stands on level ground at its
own height, buildings stand on the same ground. The aircraft is not in it: what its own frame reflects is part of the
airborne presets. Carriers move by millimetres over minutes; the Doppler of that is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gbas_core.bounds import all_within, one_of
from gbas_core.record import FloatArray
from gbas_core.signal.antenna import ANTENNAS
from gbas_core.signal.rays import MATERIALS, Facet, RayErrors, Scene, box, ray_errors
from gbas_sim.atmosphere.paths import SignalPaths, Station
from gbas_sim.faults.fault_base import SignalEffect


@dataclass(frozen=True, kw_only=True)
class Building:
    """A box on the ground.

    Attributes
    ----------
    east_m, north_m : float
        Its middle, from the station [m].
    length_m, width_m, height_m : float
        Along its heading, across it, and up [m].
    heading_rad : float
        Clockwise from north [rad].
    material : str
        Name in :data:`gbas_core.signal.rays.MATERIALS`.
    """

    east_m: float
    north_m: float
    length_m: float
    width_m: float
    height_m: float
    heading_rad: float = 0.0
    material: str = "concrete"

    def __post_init__(self) -> None:
        bounds = dict.fromkeys(("length_m", "width_m", "height_m"), (0.1, 10_000.0))
        all_within("building", self, bounds | dict.fromkeys(("east_m", "north_m"), (-20_000.0, 20_000.0)))
        all_within("building", self, {"heading_rad": (-7.0, 7.0)})
        one_of("building", "material", self.material, MATERIALS)

    @property
    def facets(self) -> tuple[Facet, ...]:
        """Walls and roof."""
        return box(
            center_m=(self.east_m, self.north_m),
            size_m=(self.length_m, self.width_m, self.height_m),
            heading_rad=self.heading_rad,
            material=self.material,
        )


@dataclass(frozen=True, kw_only=True)
class SceneParams:
    """The ground and the antennas on it.

    Attributes
    ----------
    ground : str
        Name in :data:`gbas_core.signal.rays.MATERIALS`; empty is ground that reflects nothing.
    antenna : str
        Name in :data:`gbas_core.signal.antenna.ANTENNAS`: how strong reflections are against the direct signal.
    antenna_height_m : float
        Above the ground [m].
    """

    ground: str = "ground"
    antenna: str = "mla"
    antenna_height_m: float = 3.0

    def __post_init__(self) -> None:
        if self.ground:
            one_of("scene", "ground", self.ground, MATERIALS)
        one_of("scene", "antenna", self.antenna, ANTENNAS)
        all_within("scene", self, {"antenna_height_m": (0.1, 100.0)})


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
