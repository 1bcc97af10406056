"""Ionospheric fronts and plasma bubbles, and the spaces of them that threat models span.

A front is a wedge: a slant delay that grows linearly across its width to a maximum, along a straight line that moves. A
bubble is a depletion between two walls. Both are felt at each path's own place relative to the moving line, as
:meth:`gbas_sim.atmosphere.paths.SignalPaths.along` measures it, so that ground and air feel them alike, and in full by
each satellite they are meant for: delays are slant delays, whatever the elevation.

With a distance from the station ("baseline", "ray", "pierce") a front of speed 0 stands still for the station's
receivers: speeds are relative to the station's pierce point of each satellite, and all satellites meet the front at
once. With "earth" it is one front over the Earth, which each satellite meets when its pierce point does.

Source of the wedge: Pullen, Park, Enge, "Impact and mitigation of ionospheric anomalies on ground-based augmentation of
GNSS", Radio Science 44 (2009) RS0A21.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.satellites import N_SATS, SAT_IDS, SAT_INDEX
from gbas_sim.atmosphere.paths import Delay, Reference, SignalPaths, masked

Edge = Literal["trailing", "leading"]

# How far a maximum delay may be from gradient times width: files have three digits.
_CONSISTENCY: Final = 0.01
_EDGE: Final = 1e-9  # rounding of a value that is meant to be on a bound


@dataclass(frozen=True, kw_only=True)
class ThreatSpace:
    """Fronts a threat model has.

    Attributes
    ----------
    name : str
    gradient : tuple of (float, float, float)
        For speeds up to the first number [m/s], the largest gradient at low and at high elevation [m/m]; between
        :data:`LOW_RAD` and :data:`HIGH_RAD` the bound is linear.
    speed_mps, width_m : (float, float)
        Smallest and largest.
    max_delay_m : float
        Largest.
    """

    name: str
    gradient: tuple[tuple[float, float, float], ...]
    speed_mps: tuple[float, float]
    width_m: tuple[float, float]
    max_delay_m: float

    def largest_gradient(self, speed_mps: float, elevation_rad: ArrayLike) -> FloatArray:
        """Largest gradient at a speed and at elevations ``(...)`` [m/m]; 0 for a speed beyond all."""
        elevation = np.asarray(elevation_rad, dtype=np.float64)
        share = np.clip((elevation - LOW_RAD) / (HIGH_RAD - LOW_RAD), 0.0, 1.0)
        for fastest_mps, low, high in self.gradient:
            if speed_mps <= fastest_mps:
                return np.asarray(low + (high - low) * share)
        return np.zeros_like(elevation)

    def check(self, kind: str, values: dict[str, float]) -> None:
        """Refuse what is outside at any elevation.

        Parameters
        ----------
        kind : str
            What the message calls it.
        values : dict
            ``speed_mps``, ``gradient``, ``max_delay_m`` or ``depth_m``; all other keys are widths. The first that is
            outside is refused.

        Raises
        ------
        ValueError
            Naming the key, its value and the bound.
        """
        largest = float(self.largest_gradient(values["speed_mps"], 0.5 * math.pi))
        bounds = {
            "speed_mps": self.speed_mps,
            "gradient": (0.0, largest * (1.0 + _EDGE)),
        }
        bounds["max_delay_m"] = bounds["depth_m"] = (0.0, self.max_delay_m * (1.0 + _EDGE))
        for key, value in values.items():
            low, high = bounds.get(key, self.width_m)
            if not low <= value <= high:
                raise ValueError(f"{kind}: {key} = {value:g} is not within {low:g} to {high:g} of {self.name}")


LOW_RAD: Final = math.radians(15.0)
HIGH_RAD: Final = math.radians(65.0)

# Widths and speeds where a source bounds the gradient only are those of the model for the United States. Uncertain.
_WIDTH_M: Final = (25_000.0, 200_000.0)
_SPEED_MPS: Final = (0.0, 750.0)

THREAT_SPACES: Final[dict[str, ThreatSpace]] = {
    space.name: space
    for space in (
        # Known. Pullen, Park, Enge, Radio Science 44 (2009) RS0A21; Datta-Barua, Lee, Pullen, Luo, Ene, Qiu, Zhang,
        # Enge, J. Aircraft 47 (2010), pp. 912-922.
        ThreatSpace(
            name="conus",
            gradient=((750.0, 375e-6, 425e-6),),
            speed_mps=_SPEED_MPS,
            width_m=_WIDTH_M,
            max_delay_m=50.0,
        ),
        # Uncertain in its speeds. ICAO Annex 10 Vol. I, Att. D, space for the validation of GAST D.
        ThreatSpace(
            name="gast_d",
            gradient=((750.0, 500e-6, 500e-6), (1500.0, 100e-6, 100e-6)),
            speed_mps=(0.0, 1500.0),
            width_m=_WIDTH_M,
            max_delay_m=50.0,
        ),
        # Known gradient. Mayer, Belabbas, Jakowski, Meurer, Dunkel, ION GNSS 2009, pp. 1091-1099.
        ThreatSpace(
            name="germany",
            gradient=((750.0, 140e-6, 140e-6),),
            speed_mps=_SPEED_MPS,
            width_m=_WIDTH_M,
            max_delay_m=50.0,
        ),
        # Known gradient. Saito, Sunda, Lee, Pullen, Supriadi, Yoshihara, Terkildsen, Lecat, GPS Solutions 21 (2017),
        # pp. 1937-1947: plasma bubbles in the Asia-Pacific region, Japan among it.
        ThreatSpace(
            name="apac",
            gradient=((750.0, 600e-6, 600e-6),),
            speed_mps=_SPEED_MPS,
            width_m=_WIDTH_M,
            max_delay_m=50.0,
        ),
        # Known. Yoon, Lee, Pullen et al., NAVIGATION 64 (2017), pp. 309-321: bubbles of up to 850.7 mm/km, 35 m, with
        # transition zones of 20 to 450 km, at 40 to 250 m/s; the bound of 860 mm/km has the error of the largest.
        ThreatSpace(
            name="brazil",
            gradient=((250.0, 860e-6, 860e-6),),
            speed_mps=(40.0, 250.0),
            width_m=(20_000.0, 450_000.0),
            max_delay_m=35.0,
        ),
    )
}


@parameters
class _MovingLine:
    """A line that moves across the paths, and for which of them.

    It comes from where its motion says. Its place is measured as :meth:`gbas_sim.atmosphere.paths.SignalPaths.along`
    does.
    """

    direction_rad: Annotated[
        float, Parameter("azimuth of motion at the station, clockwise from north", "deg", -360.0, 360.0)
    ] = 0.0
    speed_mps: Annotated[float, Parameter("speed of the motion", "m/s", 0.0, 10_000.0)] = 0.0
    start_m: Annotated[
        float, Parameter("where it is in that direction from the station at its time", "m", -1.0e7, 1.0e7)
    ] = 0.0
    start_s: Annotated[float, Parameter("its time, since the start", "s", -1.0e6, 1.0e6)] = 0.0
    reference: Annotated[Reference, Parameter("how distance is measured")] = "ray"
    satellites: Annotated[tuple[str, ...], Parameter("those affected, such as G07; empty is all", choices=SAT_IDS)] = ()
    threat_space: Annotated[
        str, Parameter("threat space it has to belong to; empty is none", choices=("", *THREAT_SPACES))
    ] = ""

    @cached_property
    def affected(self) -> NDArray[np.bool_] | None:
        """The satellites affected, (N_SATS,); None is all."""
        if not self.satellites:
            return None
        mask = np.zeros(N_SATS, dtype=bool)
        mask[[SAT_INDEX[name] for name in self.satellites]] = True
        return mask

    def _ahead(self, paths: SignalPaths) -> tuple[FloatArray, FloatArray]:
        """How far each path is ahead of the line [m], and the rate [m/s]."""
        distance_m, rate_mps = paths.along(self.direction_rad, self.reference)
        since_s = paths.each(paths.since_start_s) - self.start_s
        return distance_m - (self.start_m + self.speed_mps * since_s), rate_mps - self.speed_mps

    def _steepest(self) -> float:
        raise NotImplementedError

    def exceeded(self, elevation_rad: FloatArray) -> NDArray[np.bool_]:
        """Affected satellites ``(..., N_SATS)`` too low for a gradient this steep in the threat space."""
        if not self.threat_space:
            return np.zeros(elevation_rad.shape, dtype=bool)
        bound = THREAT_SPACES[self.threat_space].largest_gradient(self.speed_mps, elevation_rad)
        beyond: NDArray[np.bool_] = self._steepest() > bound * (1.0 + _EDGE)
        return beyond if self.affected is None else beyond & self.affected


@parameters
class WedgeFront(_MovingLine):
    """A front: slant delay that grows linearly across a width, with no delay on one side and all of it on the other.

    With s the distance of a path in the direction of motion, and the line at s_0 at the time t_0, the slant delay is
    ``clip(g (s - s_0 - v (t - t_0)), 0, D)`` for the trailing edge of a storm, which moves away and leaves no delay
    behind it, and ``clip(-g (s - s_0 - v (t - t_0)), 0, D)`` for a leading edge, which brings the delay. Between two
    paths the gradient is its value over the distance that `reference` measures. Width w and maximum delay D follow from
    each other, and must agree where both are given: D = g w.
    """

    kind: Annotated[Literal["front"], Parameter("kind of the threat")] = "front"
    gradient: Annotated[float, Parameter("slant gradient on L1; 300 mm/km is 300e-6", "m/m", 1e-9, 0.1)]
    width_m: Annotated[float | None, Parameter("width of the slope", "m", 1.0, 1.0e7)] = None
    max_delay_m: Annotated[float | None, Parameter("maximum slant delay", "m", 1e-3, 1000.0)] = None
    edge: Annotated[Edge, Parameter("which edge of the storm it is")] = "trailing"

    def __post_init__(self) -> None:
        if self.width_m is None and self.max_delay_m is None:
            raise ValueError("width_m and max_delay_m are both missing")
        both = self.width_m is not None and self.max_delay_m is not None
        if both and abs(self.gradient * self.wide_m / self.deep_m - 1.0) > _CONSISTENCY:
            raise ValueError(
                f"max_delay_m = {self.max_delay_m!r} is not gradient times width_m = {self.gradient * self.wide_m:g}"
            )
        if self.threat_space:
            values = {"speed_mps": self.speed_mps, "gradient": self.gradient, "width_m": self.wide_m}
            THREAT_SPACES[self.threat_space].check("front", values | {"max_delay_m": self.deep_m})

    @property
    def wide_m(self) -> float:
        """Width, given or not [m]."""
        return self.width_m if self.width_m is not None else self.deep_m / self.gradient

    @property
    def deep_m(self) -> float:
        """Maximum slant delay, given or not [m]."""
        return self.max_delay_m if self.max_delay_m is not None else self.gradient * (self.width_m or 0.0)

    def _steepest(self) -> float:
        return self.gradient

    def delay(self, paths: SignalPaths) -> Delay:
        """Slant delay on L1 and its rate; NaN for satellites below the horizon unless `reference` is "baseline"."""
        ahead_m, ahead_mps = self._ahead(paths)
        slope = self.gradient if self.edge == "trailing" else -self.gradient
        linear_m = slope * ahead_m
        inside = (linear_m > 0.0) & (linear_m < self.deep_m)
        front = Delay(delay_m=np.clip(linear_m, 0.0, self.deep_m), rate_mps=np.where(inside, slope * ahead_mps, 0.0))
        return masked(_on_satellites(front, paths), self.affected)


@parameters
class PlasmaBubble(_MovingLine):
    """A depletion: slant delay that falls by a depth across one wall, stays low, and rises again across another.

    Outside, the delay is the depth: that of the background the bubble is taken from, so that no delay is negative. It
    is the same for all receivers and does not concern differential positions. The line is the outer edge of the wall
    that comes first. Bubbles drift east at night, along the magnetic equator.

    Source: Yoon, Lee, Pullen et al., NAVIGATION 64 (2017), pp. 309-321 (depth, walls, drift); the trapezoid is ours.
    """

    kind: Annotated[Literal["bubble"], Parameter("kind of the threat")] = "bubble"
    depth_m: Annotated[float, Parameter("fall of the slant delay on L1", "m", 1e-3, 1000.0)]
    front_wall_m: Annotated[float, Parameter("width of the wall that comes first", "m", 1.0, 1.0e7)] = 50_000.0
    back_wall_m: Annotated[float, Parameter("width of the other", "m", 1.0, 1.0e7)] = 50_000.0
    floor_m: Annotated[float, Parameter("width between the walls", "m", 0.0, 1.0e7)] = 50_000.0
    direction_rad: Annotated[float, Parameter("azimuth of the drift", "deg", -360.0, 360.0)] = 0.5 * math.pi
    speed_mps: Annotated[float, Parameter("speed of the drift", "m/s", 0.0, 10_000.0)] = 100.0

    def __post_init__(self) -> None:
        if self.threat_space:
            values = {key: getattr(self, key) for key in ("speed_mps", "depth_m", "front_wall_m", "back_wall_m")}
            THREAT_SPACES[self.threat_space].check("bubble", values | {"gradient": self._steepest()})

    @property
    def width_m(self) -> float:
        """From outer edge to outer edge [m]."""
        return self.front_wall_m + self.floor_m + self.back_wall_m

    def _steepest(self) -> float:
        return self.depth_m / min(self.front_wall_m, self.back_wall_m)

    def delay(self, paths: SignalPaths) -> Delay:
        """Slant delay on L1 and its rate; NaN for satellites below the horizon unless `reference` is "baseline"."""
        ahead_m, ahead_mps = self._ahead(paths)
        falling, rising = -ahead_m / self.front_wall_m, (self.width_m + ahead_m) / self.back_wall_m
        share = np.minimum(falling, rising)
        slope = np.where(falling < rising, -1.0 / self.front_wall_m, 1.0 / self.back_wall_m)
        inside = (share > 0.0) & (share < 1.0)
        bubble = Delay(
            delay_m=self.depth_m * (1.0 - np.clip(share, 0.0, 1.0)),
            rate_mps=np.where(inside, -self.depth_m * slope * ahead_mps, 0.0),
        )
        return masked(_on_satellites(bubble, paths), self.affected)


def _on_satellites(delay: Delay, paths: SignalPaths) -> Delay:
    """The delay with a satellite axis, which the distance of a baseline has not."""
    shape = (*paths.position_m.shape[:-1], paths.satellite_m.shape[-1])
    return Delay(delay_m=np.broadcast_to(delay.delay_m, shape), rate_mps=np.broadcast_to(delay.rate_mps, shape))
