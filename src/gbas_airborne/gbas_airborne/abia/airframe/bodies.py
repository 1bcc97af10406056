"""Closed bodies that airframes are made of: fuselages from cross-sections, wings and fins from aerofoils."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from gbas_core.record import FloatArray, IntArray

_AROUND: Final = 48
_ALONG_CHORD: Final = 12


class Body(NamedTuple):
    """A closed mesh: corners (V, 3), forward, right, down [m], and triangles (F, 3)."""

    vertices_m: FloatArray
    faces: IntArray


class Section(NamedTuple):
    """A cross-section of a fuselage: where it is, its half width, top and bottom [m]."""

    forward_m: float
    half_width_m: float
    top_m: float
    bottom_m: float


def fuselage(sections: Sequence[Section], *, right_m: float = 0.0, fullness: float = 2.0) -> Body:
    """A body through cross-sections from nose to tail: ellipses, or fuller with an exponent above 2."""
    angle = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    across = np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** (2.0 / fullness)
    upright = np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** (2.0 / fullness)
    rings = [
        np.stack(
            [
                np.full(_AROUND, each.forward_m),
                right_m + each.half_width_m * across,
                0.5 * (each.top_m + each.bottom_m) + 0.5 * abs(each.bottom_m - each.top_m) * upright,
            ],
            axis=1,
        )
        for each in sections
    ]
    return loft(rings)


@dataclass(frozen=True, kw_only=True)
class Panel:
    """A wing, tailplane or fin between two chords.

    Attributes
    ----------
    root_m, tip_m : (float, float, float)
        Leading edges, forward, right, down [m].
    root_chord_m, tip_chord_m : float
        Along the direction of flight.
    thickness : float
        Over the chord.
    """

    root_m: tuple[float, float, float]
    tip_m: tuple[float, float, float]
    root_chord_m: float
    tip_chord_m: float
    thickness: float = 0.1

    def body(self) -> Body:
        """The panel with a symmetric aerofoil.

        Source: NACA four-digit sections, Abbott and von Doenhoff, Theory of wing sections (1959), 6.4, with a closed
        trailing edge.
        """
        root, tip = np.array(self.root_m), np.array(self.tip_m)
        span = tip - root
        # Across chord and span.
        up = np.cross([1.0, 0.0, 0.0], span)
        up /= np.linalg.norm(up)
        outline = _aerofoil(self.thickness)
        rings = [
            place + chord * (outline[:, :1] * [-1.0, 0.0, 0.0] + outline[:, 1:] * up)
            for place, chord in ((root, self.root_chord_m), (tip, self.tip_chord_m))
        ]
        return loft(rings)

    def mirrored(self) -> Panel:
        """The one on the other side."""
        (forward, right, down), (tip_forward, tip_right, tip_down) = self.root_m, self.tip_m
        return Panel(
            root_m=(forward, -right, down),
            tip_m=(tip_forward, -tip_right, tip_down),
            root_chord_m=self.root_chord_m,
            tip_chord_m=self.tip_chord_m,
            thickness=self.thickness,
        )


def _aerofoil(thickness: float) -> FloatArray:
    """Outline of a unit chord, (2 n, 2): along it from the nose, and across; once around from the trailing edge."""
    along = 0.5 * (1.0 - np.cos(np.pi * np.arange(_ALONG_CHORD + 1) / _ALONG_CHORD))
    powers = 0.2969 * np.sqrt(along) - 0.1260 * along - 0.3516 * along**2 + 0.2843 * along**3 - 0.1036 * along**4
    half = 5.0 * thickness * powers
    upper = np.stack([along[::-1], half[::-1]], axis=1)
    lower = np.stack([along[1:-1], -half[1:-1]], axis=1)
    return np.concatenate([upper, lower])


def loft(rings: Sequence[FloatArray]) -> Body:
    """Rings (n, 3) of equally many points joined by triangles, with flat caps at both ends; facing outwards."""
    count = len(rings[0])
    here = np.arange(count)
    beyond = (here + 1) % count
    faces = []
    for number in range(len(rings) - 1):
        near, far = number * count, (number + 1) * count
        faces.append(np.stack([near + here, near + beyond, far + beyond], axis=1))
        faces.append(np.stack([near + here, far + beyond, far + here], axis=1))
    first_cap, last_cap = len(rings) * count, len(rings) * count + 1
    last = (len(rings) - 1) * count
    faces.append(np.stack([beyond, here, np.full(count, first_cap)], axis=1))
    faces.append(np.stack([last + here, last + beyond, np.full(count, last_cap)], axis=1))
    vertices = np.concatenate([*rings, [rings[0].mean(axis=0)], [rings[-1].mean(axis=0)]])
    return _outward(Body(vertices, np.concatenate(faces)))


def _outward(body: Body) -> Body:
    first, second, third = np.moveaxis(body.vertices_m[body.faces], 1, 0)
    inward = np.einsum("ij,ij->", first, np.cross(second, third)) < 0.0
    return Body(body.vertices_m, body.faces[:, ::-1]) if inward else body


def joined(bodies: Sequence[Body]) -> Body:
    """Several bodies as one mesh; they may go through each other."""
    offsets = np.cumsum([0, *(len(each.vertices_m) for each in bodies[:-1])])
    faces = [each.faces + offset for each, offset in zip(bodies, offsets, strict=True)]
    return Body(np.concatenate([each.vertices_m for each in bodies]), np.concatenate(faces))
