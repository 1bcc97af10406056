"""Aircraft with their antennas: a swing-wing fighter, an airliner, a small unmanned aircraft.

Overall dimensions are known, shapes between them are ours: simple bodies that put wings, fin, tail and engines where
they are seen from the antennas. All without landing gear and stores.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from gbas_airborne.abia.airframe.bodies import Body, Panel, Section, fuselage, joined
from gbas_airborne.abia.airframe.mask_table import BODY_UP
from gbas_airborne.abia.airframe.mesh import Airframe, AirframeError

BODY_DOWN: Final = (0.0, 0.0, 1.0)


class Antenna(NamedTuple):
    """An antenna on an airframe.

    Attributes
    ----------
    name : str
    place_m : (float, float, float)
        Phase centre, forward, right, down [m].
    axis : (float, float, float)
        Unit vector it looks along.
    """

    name: str
    place_m: tuple[float, float, float]
    axis: tuple[float, float, float] = BODY_UP


class Aircraft(NamedTuple):
    """An airframe and where its antennas are."""

    airframe: Airframe
    antennas: tuple[Antenna, ...]

    def antenna(self, name: str) -> Antenna:
        """The antenna of that name; :class:`AirframeError` for any other."""
        for each in self.antennas:
            if each.name == name:
                return each
        known = ", ".join(each.name for each in self.antennas)
        raise AirframeError(f"{self.airframe.name}: antenna {name!r} is not one of {known}")


# --- fighter

# Known: Sabatini et al., Table I, TORNADO: length 16.72 m, height 5.95 m, span 13.91 m at 25 degrees of sweep and
# 8.60 m at 67, wing area 26.6 m^2. Eq (2), (3): antennas 2.87 m apart, each 5 cm off the skin.
FIGHTER_SWEEPS_DEG: Final = (25.0, 67.0)
_LENGTH_M, _HEIGHT_M, _AREA_M2 = 16.72, 5.95, 26.6
_SPANS_M: Final = (13.91, 8.60)
_TOP_M, _BOTTOM_M = -0.74 + 0.05, 2.13 - 0.05
# Uncertain, ours: where the nose is, how far below the fuselage the ground, how the chord tapers.
_NOSE_M, _GEAR_M, _TAPER = 7.5, 0.92, 0.35


def fighter(sweep_deg: float = 25.0) -> Aircraft:
    """The paper's fighter with its wings swept by 25 to 67 degrees, and its upper and lower antenna.

    Notes
    -----
    Both spans give the length of the wings' leading edges and how far out their pivots are: 5.15 m and 2.29 m.

    Raises
    ------
    AirframeError
        For another sweep.
    """
    forward_deg, back_deg = FIGHTER_SWEEPS_DEG
    if not forward_deg <= sweep_deg <= back_deg:
        raise AirframeError(f"fighter: sweep_deg = {sweep_deg} is not within {forward_deg:g} to {back_deg:g}")
    wing = _swept_wing(math.radians(sweep_deg))
    glove = Panel(root_m=(2.3, 1.0, -0.3), tip_m=(-0.1, 2.45, -0.3), root_chord_m=5.2, tip_chord_m=2.6, thickness=0.07)
    parts = {**_fighter_fuselage(), "wing": [wing, _mirrored(wing), *_both(glove)]}
    antennas = (Antenna("upper", (-0.88, 0.0, -0.74)), Antenna("lower", (-0.88, 0.0, 2.13), BODY_DOWN))
    return Aircraft(_airframe(f"fighter, wings at {sweep_deg:g} degrees", parts | _fighter_tail()), antennas)


def _swept_wing(sweep_rad: float) -> Body:
    """The right wing, turned about its pivot from the forward sweep."""
    least, most = (math.radians(each) for each in FIGHTER_SWEEPS_DEG)
    half_spans = 0.5 * _SPANS_M[0], 0.5 * _SPANS_M[1]
    edge_m = (half_spans[0] - half_spans[1]) / (math.cos(least) - math.cos(most))
    pivot_m = half_spans[0] - edge_m * math.cos(least)
    mean_m = _AREA_M2 / _SPANS_M[0]
    centre_m = 2.0 * mean_m / (1.0 + _TAPER)
    pivot_chord_m = centre_m * (1.0 - (1.0 - _TAPER) * pivot_m / half_spans[0])
    pivot = (-0.2, pivot_m, -0.3)
    tip = (pivot[0] - edge_m * math.sin(least), half_spans[0], pivot[2])
    panel = Panel(root_m=pivot, tip_m=tip, root_chord_m=pivot_chord_m, tip_chord_m=_TAPER * centre_m, thickness=0.1)
    body = panel.body()
    turn = sweep_rad - least
    rotation = np.array(
        [[math.cos(turn), -math.sin(turn), 0.0], [math.sin(turn), math.cos(turn), 0.0], [0.0, 0.0, 1.0]]
    )
    return Body((body.vertices_m - pivot) @ rotation.T + pivot, body.faces)


def _fighter_fuselage() -> dict[str, list[Body]]:
    tail_m = _NOSE_M - _LENGTH_M
    hull = fuselage(
        [
            Section(_NOSE_M, 0.02, 0.55, 0.60),
            Section(6.5, 0.35, 0.20, 0.95),
            Section(5.5, 0.55, -0.10, 1.20),
            Section(4.0, 0.75, -0.40, 1.50),
            Section(2.0, 0.95, -0.60, 1.80),
            Section(0.6, 1.20, _TOP_M, 2.05),
            Section(-0.88, 1.40, _TOP_M, _BOTTOM_M),
            Section(-4.0, 1.40, _TOP_M, _BOTTOM_M),
            Section(-7.0, 1.30, -0.60, 1.70),
            Section(tail_m, 1.00, -0.35, 1.10),
        ],
        fullness=2.6,
    )
    # The antennas are 1.5 m behind the canopy: Sabatini et al., section IV.B.
    canopy = fuselage(
        [
            Section(4.4, 0.10, -0.40, -0.10),
            Section(3.4, 0.42, -0.95, -0.10),
            Section(2.2, 0.45, -1.10, -0.10),
            Section(0.62, 0.30, -0.72, -0.10),
        ]
    )
    return {"fuselage": [hull], "canopy": [canopy]}


def _fighter_tail() -> dict[str, list[Body]]:
    fin_top_m = _BOTTOM_M + _GEAR_M - _HEIGHT_M
    fin = Panel(
        root_m=(-4.2, 0.0, -0.5), tip_m=(-7.4, 0.0, fin_top_m), root_chord_m=4.4, tip_chord_m=1.6, thickness=0.06
    )
    tailplane = Panel(
        root_m=(-6.5, 0.9, 0.3), tip_m=(-8.28, 3.4, 0.3), root_chord_m=2.4, tip_chord_m=0.9, thickness=0.06
    )
    return {"fin": [fin.body()], "tailplane": _both(tailplane)}


# --- airliner


def airliner() -> Aircraft:
    """A twin-engined airliner, antennas on top of and below the fuselage, ahead of the wing.

    Known: Airbus, A320 aircraft characteristics: length 37.57 m, span 34.10 m, height 11.76 m, fuselage 3.95 m wide
    and 4.14 m high.
    """
    hull = fuselage(
        [
            Section(17.0, 0.05, 0.50, 0.60),
            Section(16.4, 0.85, -0.30, 1.30),
            Section(15.2, 1.45, -1.20, 1.75),
            Section(13.6, 1.85, -1.90, 2.00),
            Section(11.5, 1.975, -2.07, 2.07),
            Section(-9.0, 1.975, -2.07, 2.07),
            Section(-14.5, 1.40, -2.05, 0.90),
            Section(-18.5, 0.70, -1.85, -0.35),
            Section(17.0 - 37.57, 0.20, -1.50, -1.05),
        ]
    )
    nacelle = [
        fuselage(
            [
                Section(6.2, 0.95, 1.35, 3.25),
                Section(5.0, 1.15, 1.15, 3.45),
                Section(3.4, 1.05, 1.25, 3.35),
                Section(1.8, 0.60, 1.70, 2.90),
            ],
            right_m=side * 5.75,
        )
        for side in (1.0, -1.0)
    ]
    wing = Panel(root_m=(5.0, 1.6, 1.10), tip_m=(-2.8, 17.05, -0.25), root_chord_m=7.0, tip_chord_m=1.6, thickness=0.12)
    ground_m = 2.07 + 1.75  # uncertain, ours: the fuselage's height above the ground
    fin = Panel(
        root_m=(-12.5, 0.0, -1.8),
        tip_m=(-17.9, 0.0, ground_m - 11.76),
        root_chord_m=6.2,
        tip_chord_m=2.2,
        thickness=0.1,
    )
    tailplane = Panel(
        root_m=(-14.6, 0.7, -0.9), tip_m=(-18.1, 6.22, -1.45), root_chord_m=4.0, tip_chord_m=1.5, thickness=0.1
    )
    parts = {
        "fuselage": [hull],
        "engine": nacelle,
        "wing": _both(wing),
        "tailplane": _both(tailplane),
        "fin": [fin.body()],
    }
    antennas = (Antenna("upper", (9.0, 0.0, -2.10)), Antenna("lower", (9.0, 0.0, 2.10), BODY_DOWN))
    return Aircraft(_airframe("airliner", parts), antennas)


# --- small unmanned aircraft


def small_uav() -> Aircraft:
    """A pusher with twin booms and a tail of two fins, its antenna on top of the pod, ahead of the wing.

    Known: span 2.9 m and length 1.7 m, as the Aerosonde's.
    """
    pod = fuselage(
        [
            Section(0.65, 0.01, 0.00, 0.02),
            Section(0.55, 0.07, -0.06, 0.08),
            Section(0.35, 0.10, -0.10, 0.11),
            Section(-0.20, 0.10, -0.10, 0.11),
            Section(-0.35, 0.06, -0.06, 0.06),
        ],
        fullness=2.5,
    )
    wing = Panel(
        root_m=(0.10, 0.0, -0.11), tip_m=(0.05, 1.45, -0.14), root_chord_m=0.24, tip_chord_m=0.15, thickness=0.12
    )
    booms = [
        fuselage([Section(0.0, 0.012, -0.11, -0.08), Section(0.65 - 1.70, 0.010, -0.11, -0.09)], right_m=side * 0.28)
        for side in (1.0, -1.0)
    ]
    # An inverted V between the booms.
    fin = Panel(
        root_m=(-0.86, 0.28, -0.10), tip_m=(-0.87, 0.0, -0.34), root_chord_m=0.19, tip_chord_m=0.17, thickness=0.09
    )
    parts = {"fuselage": [pod], "boom": booms, "wing": _both(wing), "fin": _both(fin)}
    antennas = (Antenna("upper", (0.30, 0.0, -0.12)),)
    return Aircraft(_airframe("small_uav", parts), antennas)


def _mirrored(body: Body) -> Body:
    return Body(body.vertices_m * [1.0, -1.0, 1.0], body.faces[:, ::-1])


def _both(panel: Panel) -> list[Body]:
    """A panel and the one on the other side."""
    return [panel.body(), panel.mirrored().body()]


def _airframe(name: str, parts: dict[str, list[Body]]) -> Airframe:
    whole = joined([body for bodies in parts.values() for body in bodies])
    counts = tuple((part, sum(len(body.faces) for body in bodies)) for part, bodies in parts.items())
    return Airframe(name=name, vertices_m=whole.vertices_m, faces=whole.faces, parts=counts)


_BUILT_IN: Final[dict[str, Callable[[], Aircraft]]] = {
    "fighter": lambda: fighter(FIGHTER_SWEEPS_DEG[0]),
    "fighter_swept": lambda: fighter(FIGHTER_SWEEPS_DEG[1]),
    "airliner": airliner,
    "small_uav": small_uav,
}
AIRCRAFT: Final = tuple(_BUILT_IN)


@lru_cache(maxsize=len(AIRCRAFT))
def aircraft_of(name: str) -> Aircraft:
    """The aircraft of that name, one of :data:`AIRCRAFT`; :class:`AirframeError` for any other."""
    if name not in _BUILT_IN:
        raise AirframeError(f"aircraft {name!r} is not one of {', '.join(AIRCRAFT)}")
    return _BUILT_IN[name]()
