"""What reflects: materials with their Fresnel coefficients, and flat facets, alone, as boxes and as meshes."""

from __future__ import annotations

import math
from typing import Annotated, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.signals import SPEED_OF_LIGHT_MPS

ComplexArray = NDArray[np.complex128]


@parameters
class Material:
    """What reflects; what a rough surface scatters is lost."""

    name: Annotated[str, Parameter("name of the material")]
    permittivity: Annotated[float, Parameter("relative", "-", 1.0, 1000.0)]
    conductivity_spm: Annotated[float, Parameter("conductivity", "S/m", 0.0, 1e8)]
    roughness_m: Annotated[float, Parameter("standard deviation of its height", "m", 0.0, 10.0)] = 0.0


def circular_reflection(
    permittivity: ArrayLike,
    conductivity_spm: ArrayLike,
    roughness_m: ArrayLike,
    sine: FloatArray,
    frequency_hz: float,
) -> tuple[ComplexArray, ComplexArray]:
    """Reflection of a right-handed wave, by the sine of its grazing angle: right-handed and left-handed parts [-].

    Source: Recommendation ITU-R P.2040; half the sum and half the difference of the Fresnel coefficients for both
    linear polarisations, as in Hannah (2001), 3.3; loss by roughness, exp(-2 (2 pi s sin(grazing) / wavelength)^2),
    Ament, Proc. IRE 41 (1953).
    """
    conduction = np.asarray(conductivity_spm) / (2.0 * math.pi * frequency_hz * _VACUUM_FPM)
    epsilon = np.asarray(permittivity) - 1j * conduction
    root = np.sqrt(epsilon - 1.0 + sine**2)
    horizontal = (sine - root) / (sine + root)
    vertical = (epsilon * sine - root) / (epsilon * sine + root)
    phase = 2.0 * math.pi * np.asarray(roughness_m) * sine * (frequency_hz / SPEED_OF_LIGHT_MPS)
    smooth = np.exp(-2.0 * phase**2)
    return 0.5 * (horizontal + vertical) * smooth, 0.5 * (vertical - horizontal) * smooth


_VACUUM_FPM: Final = 8.8541878128e-12

# Known: Recommendation ITU-R P.2040-3, table 3, at 1.5 GHz (concrete, metal), and P.527-6 (ground, water); rounded.
MATERIALS: Final[dict[str, Material]] = {
    material.name: material
    for material in (
        Material(name="metal", permittivity=1.0, conductivity_spm=1e7),
        Material(name="concrete", permittivity=5.3, conductivity_spm=0.04),
        Material(name="glass", permittivity=6.3, conductivity_spm=0.006),
        Material(name="dry_ground", permittivity=4.0, conductivity_spm=0.001),
        Material(name="ground", permittivity=15.0, conductivity_spm=0.1),
        Material(name="wet_ground", permittivity=30.0, conductivity_spm=0.2),
        Material(name="fresh_water", permittivity=79.0, conductivity_spm=0.4),
    )
}
MATERIAL: Final = Parameter("name of the material", choices=tuple(MATERIALS))


@parameters
class Facet:
    """A flat piece that reflects on the side its normal points to, and hides from both.

    Positions are east, north, up; the normal is along first x second.
    """

    corner_m: Annotated[tuple[float, float, float], Parameter("a corner", "m")]
    first_m: Annotated[tuple[float, float, float], Parameter("first edge from it", "m")]
    second_m: Annotated[tuple[float, float, float], Parameter("second edge from it", "m")]
    triangle: Annotated[bool, Parameter("only the half next to the corner, rather than the parallelogram")] = False
    material: Annotated[str, MATERIAL] = "concrete"

    def __post_init__(self) -> None:
        if not float(np.linalg.norm(np.cross(self.first_m, self.second_m))) > 0.0:
            raise ValueError(f"facet: corner_m = {self.corner_m!r} and its edges span no area")


def box(
    *, center_m: tuple[float, float], size_m: tuple[float, float, float], heading_rad: float, material: str = "concrete"
) -> tuple[Facet, ...]:
    """A building on the ground: four walls and a roof.

    Parameters
    ----------
    center_m : (float, float)
        East, north [m].
    size_m : (float, float, float)
        Length along the heading, width, height [m].
    heading_rad : float
        Clockwise from north [rad].

    Raises
    ------
    ValueError
        For a size that is not above 0.
    """
    if not all(each > 0.0 for each in size_m):
        raise ValueError(f"box: size_m = {size_m!r} is not above 0")
    length, width, height = size_m
    ahead = np.array([math.sin(heading_rad), math.cos(heading_rad), 0.0])
    left = np.array([-ahead[1], ahead[0], 0.0])
    up = np.array([0.0, 0.0, height])
    base = np.array([*center_m, 0.0]) - 0.5 * length * ahead - 0.5 * width * left
    along, across = length * ahead, width * left
    faces = (
        (base, along, up),
        (base + along, across, up),
        (base + along + across, -along, up),
        (base + across, -across, up),
        (base + up, along, across),
    )
    return tuple(
        Facet(corner_m=_triple(corner), first_m=_triple(first), second_m=_triple(second), material=material)
        for corner, first, second in faces
    )


def mesh_facets(vertices_m: ArrayLike, faces: ArrayLike, *, material: str = "metal") -> tuple[Facet, ...]:
    """Triangles of a mesh, such as ``trimesh.load(...)`` has as its vertices (V, 3) and faces (F, 3).

    Meant for coarse shapes: every reflection is tested against every facet.
    """
    corners = np.asarray(vertices_m, dtype=np.float64)[np.asarray(faces, dtype=np.int64)]
    return tuple(
        Facet(
            corner_m=_triple(corner[0]),
            first_m=_triple(corner[1] - corner[0]),
            second_m=_triple(corner[2] - corner[0]),
            triangle=True,
            material=material,
        )
        for corner in corners
    )


def _triple(vector: FloatArray) -> tuple[float, float, float]:
    return float(vector[0]), float(vector[1]), float(vector[2])
