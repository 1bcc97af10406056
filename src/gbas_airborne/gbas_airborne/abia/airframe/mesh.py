"""The airframe as a closed mesh of triangles, checked, and the rays it stops.

Rays run in Embree, in single precision, from the antenna as the origin: a millimetre on an airframe of 100 m.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbas_core.record import BoolArray, FloatArray, IntArray

FORMATS: Final = (".stl", ".obj", ".ply", ".glb")
_SMALLEST_M, _LARGEST_M = 0.2, 120.0
_FARTHEST_M: Final = 2.0
"""Of an antenna from the skin."""
_AXES: Final = {
    "f": (1.0, 0.0, 0.0), "b": (-1.0, 0.0, 0.0), "r": (0.0, 1.0, 0.0), "l": (0.0, -1.0, 0.0),
    "d": (0.0, 0.0, 1.0), "u": (0.0, 0.0, -1.0),
}  # fmt: skip
_SENSES: Final = ({"f", "b"}, {"r", "l"}, {"u", "d"})


class AirframeError(ValueError):
    """A mesh, or an antenna on it, that cannot be used; one line."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Airframe:
    """A closed surface, or several that touch or go through each other.

    Attributes
    ----------
    name : str
        For messages.
    vertices_m : (V, 3) array
        Forward, right, down [m].
    faces : (F, 3) array
        Corners of the triangles, counter-clockwise seen from outside.
    closed : bool
        False admits a mesh with holes, or with triangles that face both ways. Then rays may pass through the holes, and
        an antenna counts as inside if hardly any ray leaves it.
    parts : tuple of (str, int)
        Names of parts, each with how many of the faces are its, in their order; empty for a mesh in one piece.

    Raises
    ------
    AirframeError
        For a mesh with holes, with triangles that face both ways, of no volume, or of no size of an aircraft.
    """

    name: str
    vertices_m: FloatArray
    faces: IntArray
    closed: bool = True
    parts: tuple[tuple[str, int], ...] = ()

    def __post_init__(self) -> None:
        vertices, faces = self.vertices_m, self.faces
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3 or not faces.size:
            raise AirframeError(f"{self.name}: not a mesh of triangles")
        if not np.isfinite(vertices).all():
            raise AirframeError(f"{self.name}: a corner of the mesh is not a finite position")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise AirframeError(f"{self.name}: a triangle names a corner that is not there")
        if self.parts and sum(count for _, count in self.parts) != len(faces):
            raise AirframeError(f"{self.name}: its parts do not have {len(faces)} triangles together")
        size_m = float(np.ptp(vertices[np.unique(faces)], axis=0).max())
        if not _SMALLEST_M <= size_m <= _LARGEST_M:
            raise AirframeError(
                f"{self.name}: the mesh is {size_m:.4g} m across: must be {_SMALLEST_M:g} to {_LARGEST_M:g} m (units?)"
            )
        if self.closed:
            self._refuse_open()

    def _refuse_open(self) -> None:
        """Each edge must be in as many triangles one way as the other."""
        ends = self.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        one_way = ends[:, 0] < ends[:, 1]
        keys = np.sort(ends, axis=1) @ np.array([len(self.vertices_m), 1])
        _, edge, uses = np.unique(keys, return_inverse=True, return_counts=True)
        if (odd := int((uses % 2 == 1).sum())) > 0:
            raise AirframeError(f"{self.name}: the mesh has holes: {odd} of {len(uses)} edges bound them")
        forward = np.bincount(edge, weights=one_way)
        if (turned := int((2.0 * forward != uses).sum())) > 0:
            raise AirframeError(f"{self.name}: triangles face both ways: at {turned} of {len(uses)} edges")
        if not self.volume_m3 > 0.0:
            raise AirframeError(f"{self.name}: the mesh has no inside: its volume is {self.volume_m3:.3g} m^3")

    @cached_property
    def corners_m(self) -> FloatArray:
        """Corners of each triangle, (F, 3 corners, 3)."""
        return self.vertices_m[self.faces]

    def part_of(self, face: IntArray) -> list[str]:
        """Names of the parts that triangles belong to."""
        ends = np.cumsum([count for _, count in self.parts])
        return [self.parts[int(at)][0] if self.parts else "airframe" for at in np.searchsorted(ends, face, "right")]

    @cached_property
    def volume_m3(self) -> float:
        """Enclosed volume [m^3]; what several bodies share counts for each."""
        first, second, third = np.moveaxis(self.vertices_m[self.faces], 1, 0)
        return float(np.einsum("ij,ij->", first, np.cross(second, third)) / 6.0)

    @cached_property
    def digest(self) -> str:
        """Of the geometry: equal meshes have the same."""
        return sha256(np.ascontiguousarray(self.corners_m).tobytes()).hexdigest()

    @classmethod
    def outward(cls, name: str, vertices_m: FloatArray, faces: IntArray, *, closed: bool = True) -> Airframe:
        """The same, turned inside out if the triangles face inwards."""
        first, second, third = np.moveaxis(vertices_m[faces], 1, 0)
        inward = bool(np.einsum("ij,ij->", first, np.cross(second, third)) < 0.0)
        return cls(name=name, vertices_m=vertices_m, faces=faces[:, ::-1] if inward else faces, closed=closed)

    def inside(self, place_m: ArrayLike) -> bool:
        """Whether a place is inside any of the bodies: the solid angle that all triangles fill, seen from it.

        Of a mesh that is not closed: whether less than a tenth of all rays leaves it.

        Source: van Oosterom and Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng. 30 (1983).
        """
        if not self.closed:
            return bool(self.stops(place_m, _EVERY_WAY).mean() > 0.9)
        towards = self.corners_m - np.asarray(place_m, dtype=np.float64)
        length = np.linalg.norm(towards, axis=-1)
        one, two, three = np.moveaxis(towards, 1, 0)
        triple = np.einsum("ij,ij->i", one, np.cross(two, three))
        products = length.prod(axis=1)
        for first, second, third in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            dot = np.einsum("ij,ij->i", towards[:, first], towards[:, second])
            products = products + dot * length[:, third]
        turns = float(np.arctan2(triple, products).sum()) / (2.0 * np.pi)
        return turns > 0.5

    def distance_m(self, place_m: ArrayLike) -> float:
        """From a place to the nearest point of the surface [m]."""
        return float(_distance_to_triangles(np.asarray(place_m, dtype=np.float64), self.corners_m).min())

    def refuse_place(self, place_m: ArrayLike) -> None:
        """Complain of an antenna inside the body, or far away from it."""
        place = np.asarray(place_m, dtype=np.float64)
        text = "({:.3f}, {:.3f}, {:.3f}) m".format(*place)
        if not np.isfinite(place).all():
            raise AirframeError(f"{self.name}: antenna at {text}: not a finite position")
        if self.inside(place):
            raise AirframeError(f"{self.name}: antenna at {text}, forward, right, down, is inside the body")
        if (away := self.distance_m(place)) > _FARTHEST_M:
            raise AirframeError(
                f"{self.name}: antenna at {text}, forward, right, down, is {away:.1f} m off the body: "
                f"must be at most {_FARTHEST_M:g} m"
            )

    def stops(self, place_m: ArrayLike, directions: FloatArray) -> BoolArray:
        """Whether rays from a place in directions ``(N, 3)`` meet the airframe."""
        return np.asarray(self.first_met(place_m, directions) >= 0)

    def first_met(self, place_m: ArrayLike, directions: FloatArray) -> IntArray:
        """Triangle that each ray meets first, ``(N,)``; -1 for none."""
        scene = self._scene(tuple(float(each) for each in np.asarray(place_m)))
        along = np.ascontiguousarray(directions, dtype=np.float32)
        return np.asarray(scene.run(np.zeros_like(along), along, query="INTERSECT"), dtype=np.int64)

    def _scene(self, place_m: tuple[float, ...]) -> Any:
        """Embree's search tree of the mesh about a place; the last few are kept."""
        from embreex.mesh_construction import TriangleMesh  # type: ignore[import-untyped]
        from embreex.rtcore_scene import EmbreeScene  # type: ignore[import-untyped]

        if place_m not in self._scenes:
            if len(self._scenes) >= _SCENES:
                self._scenes.pop(next(iter(self._scenes)))
            scene = EmbreeScene()
            TriangleMesh(scene=scene, vertices=(self.corners_m - np.array(place_m)).astype(np.float32))
            self._scenes[place_m] = scene
        return self._scenes[place_m]

    @cached_property
    def _scenes(self) -> dict[tuple[float, ...], Any]:
        return {}


def _spread(count: int) -> FloatArray:
    """Directions evenly over the sphere, (count, 3): a spiral by the golden angle."""
    down = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.arange(count) * (np.pi * (3.0 - np.sqrt(5.0)))
    level = np.sqrt(1.0 - down**2)
    return np.stack([level * np.cos(turn), level * np.sin(turn), down], axis=1)


_SCENES: Final = 4
_EVERY_WAY: Final = _spread(4000)


def _distance_to_triangles(place: FloatArray, corners: FloatArray) -> FloatArray:
    """From a place to each triangle (F, 3, 3) [m]: to its plane if the foot is inside, else to the nearest edge."""
    one, two, three = np.moveaxis(corners, 1, 0)
    normal = np.cross(two - one, three - one)
    square = np.maximum(np.einsum("ij,ij->i", normal, normal), 1e-30)
    away = place - one
    first = np.einsum("ij,ij->i", np.cross(away, three - one), normal) / square
    second = np.einsum("ij,ij->i", np.cross(two - one, away), normal) / square
    above = np.abs(np.einsum("ij,ij->i", away, normal)) / np.sqrt(square)
    foot_inside = (first >= 0.0) & (second >= 0.0) & (first + second <= 1.0)
    edges = np.min([_to_edge(place, start, end) for start, end in ((one, two), (two, three), (three, one))], axis=0)
    return np.asarray(np.where(foot_inside, above, edges))


def _to_edge(place: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    along = end - start
    share = np.einsum("ij,ij->i", place - start, along) / np.maximum(np.einsum("ij,ij->i", along, along), 1e-30)
    return np.asarray(np.linalg.norm(start + np.clip(share, 0.0, 1.0)[:, np.newaxis] * along - place, axis=1))


# --- files


def axes_of(axes: str) -> FloatArray:
    """Rotation from a mesh's axes to forward, right, down, (3, 3).

    Parameters
    ----------
    axes : str
        What x, y and z point to, a letter each of forward, back, left, right, up, down: ``flu`` (REP 103, with z up),
        ``frd`` (the body frame), ``luf`` (glTF).

    Raises
    ------
    AirframeError
        For other letters, or two along the same line.
    """
    good = len(axes) == 3 and all(any(each in sense for each in axes) for sense in _SENSES)
    if not good or not set(axes) <= set(_AXES):
        raise AirframeError(f"axes = {axes!r} is not three letters, one of f b, one of l r, one of u d")
    rotation: FloatArray = np.transpose(np.array([_AXES[each] for each in axes], dtype=np.float64))
    return rotation


def read_airframe(path: Path | str, *, axes: str = "flu", scale_m: float = 1.0, closed: bool = True) -> Airframe:
    """A mesh from a file: STL, OBJ, PLY or GLB.

    Parameters
    ----------
    path : path
    axes : str
        See :func:`axes_of`.
    scale_m : float
        Metres a unit of the file.
    closed : bool
        See :class:`Airframe`.

    Raises
    ------
    AirframeError
        For a file that cannot be read, or a mesh that cannot be used.
    """
    import trimesh

    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise AirframeError(f"{path}: not one of {', '.join(FORMATS)}")
    if not path.is_file():
        raise AirframeError(f"{path}: no such file")
    if not scale_m > 0.0:
        raise AirframeError(f"{path}: scale_m = {scale_m} is not above 0")
    try:
        mesh = trimesh.load_mesh(path, process=True, merge_norm=True, merge_tex=True)
        vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
    except Exception as error:  # trimesh and its readers raise whatever they meet
        raise AirframeError(f"{path}: cannot be read as a mesh: {' '.join(str(error).split())}") from None
    vertices, faces = _without_slivers(scale_m * vertices @ axes_of(axes).T, faces)
    return Airframe.outward(path.name, vertices, faces, closed=closed)


def _without_slivers(vertices_m: FloatArray, faces: NDArray[np.int64]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Corners closer than a micrometre made one, and triangles dropped that are left with two."""
    _, first, merged = np.unique(np.round(vertices_m * 1e6), axis=0, return_index=True, return_inverse=True)
    faces = merged.reshape(-1)[faces]
    kept = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return vertices_m[first], faces[kept]
