"""Meshes of airframes: files of every kind, what is refused, places inside and rays against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from gbas_airborne.abia.airframe.mask_table import MaskTable, body_direction, share_unlike_rays
from gbas_airborne.abia.airframe.mesh import Airframe, AirframeError, axes_of, read_airframe


def box(*size_m: float, name: str = "box") -> Airframe:
    mesh = trimesh.creation.box(size_m)
    return Airframe.outward(name, np.asarray(mesh.vertices), np.asarray(mesh.faces))


@pytest.mark.parametrize("suffix", [".stl", ".obj", ".ply", ".glb"])
def test_files_of_every_kind(tmp_path, suffix):
    path = tmp_path / f"block{suffix}"
    mesh = trimesh.creation.box((10.0, 4.0, 2.0))
    mesh.apply_translation((3.0, 1.0, 0.5))
    mesh.export(path)
    read = read_airframe(path)  # forward, left, up
    np.testing.assert_allclose(read.vertices_m.min(axis=0), [-2.0, -3.0, -1.5], atol=1e-5)
    np.testing.assert_allclose(read.vertices_m.max(axis=0), [8.0, 1.0, 0.5], atol=1e-5)
    assert read.volume_m3 == pytest.approx(80.0, rel=1e-5)
    assert (len(read.vertices_m), len(read.faces)) == (8, 12)


def test_axes_and_units(tmp_path):
    mesh = trimesh.creation.box((2000.0, 1000.0, 10_000.0))  # glTF: left, up, forward; millimetres
    mesh.export(tmp_path / "block.stl")
    read = read_airframe(tmp_path / "block.stl", axes="luf", scale_m=1e-3)
    np.testing.assert_allclose(np.ptp(read.vertices_m, axis=0), [10.0, 2.0, 1.0], rtol=1e-6)
    np.testing.assert_array_equal(axes_of("frd"), np.eye(3))
    np.testing.assert_array_equal(axes_of("flu") @ [1.0, 2.0, 3.0], [1.0, -2.0, -3.0])
    for wrong in ("ffu", "fl", "flx", "fbu", "FLU"):
        with pytest.raises(AirframeError, match="axes = "):
            axes_of(wrong)
    with pytest.raises(AirframeError, match=r"the mesh is 1e\+04 m across: must be 0.2 to 120 m \(units\?\)"):
        read_airframe(tmp_path / "block.stl")


def test_holes_are_refused(tmp_path):
    mesh = trimesh.creation.box((10.0, 4.0, 2.0))
    mesh.faces = mesh.faces[1:]
    mesh.export(tmp_path / "open.stl")
    with pytest.raises(AirframeError, match="open.stl: the mesh has holes: 3 of 18 edges bound them"):
        read_airframe(tmp_path / "open.stl")


def test_triangles_that_face_both_ways_are_refused():
    mesh = trimesh.creation.box((10.0, 4.0, 2.0))
    faces = np.array(mesh.faces)
    faces[0] = faces[0, ::-1]
    with pytest.raises(AirframeError, match="triangles face both ways: at 3 of 18 edges"):
        Airframe(name="box", vertices_m=np.asarray(mesh.vertices), faces=faces)
    inside_out = Airframe.outward("box", np.asarray(mesh.vertices), np.asarray(mesh.faces)[:, ::-1])
    assert inside_out.volume_m3 == pytest.approx(80.0)


def test_what_is_no_mesh_is_refused(tmp_path):
    (tmp_path / "text.stl").write_text("not a mesh")
    (tmp_path / "mesh.step").write_text("")
    for name, message in (("text.stl", "text.stl: "), ("mesh.step", "not one of .stl"), ("none.obj", "no such file")):
        with pytest.raises(AirframeError, match=message):
            read_airframe(tmp_path / name)
    with pytest.raises(AirframeError, match="not a finite position"):
        Airframe(name="x", vertices_m=np.full((3, 3), math.nan), faces=np.array([[0, 1, 2]]))


def test_places_of_antennas():
    body = box(10.0, 4.0, 2.0)
    body.refuse_place((0.0, 0.0, -1.05))
    with pytest.raises(AirframeError, match=r"antenna at \(0.000, 0.000, -0.950\) m, .* is inside the body"):
        body.refuse_place((0.0, 0.0, -0.95))
    with pytest.raises(AirframeError, match="is 3.0 m off the body"):
        body.refuse_place((0.0, 0.0, -4.0))
    with pytest.raises(AirframeError, match="not a finite position"):
        body.refuse_place((math.nan, 0.0, 0.0))
    with pytest.raises(AirframeError, match="inside the body"):
        MaskTable.of_mesh(body, (0.0, 0.0, 0.0))


def test_inside_of_bodies_that_go_through_each_other():
    """By sign of distance to two spheres."""
    first, second = trimesh.creation.icosphere(3), trimesh.creation.icosphere(3)
    second.apply_translation((1.2, 0.0, 0.0))
    both = trimesh.util.concatenate([first, second])
    body = Airframe.outward("spheres", np.asarray(both.vertices), np.asarray(both.faces))
    places = np.random.default_rng(3).uniform(-2.5, 2.5, (300, 3))
    near = np.minimum(np.linalg.norm(places, axis=1), np.linalg.norm(places - [1.2, 0.0, 0.0], axis=1))
    clear = np.abs(near - 1.0) > 0.02  # facets are up to 0.01 inside of their spheres
    assert [body.inside(place) for place in places[clear]] == (near[clear] < 1.0).tolist()
    outside = clear & (near > 1.0)
    distances = [body.distance_m(place) for place in places[outside]]
    np.testing.assert_allclose(distances, near[outside] - 1.0, atol=0.01)


def test_sphere_hides_its_cone():
    """Of a sphere of radius R the directions within asin(R / d) of its centre, seen from a distance d."""
    mesh = trimesh.creation.icosphere(5)
    body = Airframe.outward("sphere", np.asarray(mesh.vertices), np.asarray(mesh.faces))
    table = MaskTable.of_mesh(body, (0.0, 0.0, -1.5), horizon_rad=-0.5 * math.pi)
    azimuth, elevation = np.meshgrid(np.linspace(0.0, 6.28, 100), np.linspace(-1.5, 1.5, 401))
    from_nadir = elevation + 0.5 * math.pi
    clear = np.abs(from_nadir - math.asin(1.0 / 1.5)) > math.radians(0.3)  # cells of an eighth of a degree, and facets
    np.testing.assert_array_equal(table.masked(azimuth, elevation)[clear], (from_nadir < math.asin(1.0 / 1.5))[clear])


def test_wall_to_the_right_hides_what_is_behind_it():
    """A box seen from above its left edge; ray against box by slabs."""
    wall = box(2.0, 1.0, 4.0)
    place = np.array([0.3, -1.0, -0.7])
    random = np.random.default_rng(5)
    azimuth, elevation = random.uniform(0.0, 2.0 * math.pi, 20_000), np.arcsin(random.uniform(-1.0, 1.0, 20_000))
    along = body_direction(azimuth, elevation)
    ends = np.stack([(side * np.array([1.0, 0.5, 2.0]) - place) / along for side in (-1.0, 1.0)])
    enter, leave = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
    np.testing.assert_array_equal(wall.stops(place, along), (leave > enter) & (leave > 0.0))
    table = MaskTable.of_mesh(wall, place, horizon_rad=-0.5 * math.pi)
    assert table.masked(math.radians(90.0), 0.0)
    assert not table.masked(math.radians(270.0), 0.0)
    assert share_unlike_rays(table, wall, place) < 0.003


def test_recorded_mesh_with_holes(data_dir):
    """An aeroplane off the web, open at 224 edges: refused, or taken as it is on demand."""
    path = data_dir / "terrain_mesh" / "airplane_pyvista.ply"
    with pytest.raises(AirframeError, match="the mesh has holes: 224 of"):
        read_airframe(path, scale_m=0.01)
    body = read_airframe(path, scale_m=0.01, closed=False)
    assert len(body.faces) == 2452
    above, within = (7.0, -6.76, -1.5), (7.0, -6.76, -0.2)
    with pytest.raises(AirframeError, match="inside the body"):
        MaskTable.of_mesh(body, within)
    assert share_unlike_rays(MaskTable.of_mesh(body, above), body, above) < 0.003
