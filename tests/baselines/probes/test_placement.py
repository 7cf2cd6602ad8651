"""Where probes stand, judged by the rooms' own meshes."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import trimesh

from gibench.baselines.probes.errors import ProbeError
from gibench.baselines.probes.placement import place
from gibench.generators.scene_files import write_room
from gibench.rendering.scene import load_dict, load_scene
from tests.generators.rooms_at_hand import inside, joined, room
from tests.rendering import scenes

ROOMS = (1, 2)
COUNT = 64


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    @cache
    def written(index):
        folder = tmp_path_factory.mktemp(f"room{index}")
        write_room(room(index), folder, max_depth=9, resolution=(32, 24), spp=1)
        return folder

    return written


@pytest.fixture(scope="module")
def placed(folders):
    @cache
    def positions(index):
        return place(load_scene(folders(index) / "scene.xml"), COUNT)

    return positions


def shell(index):
    parameters = room(index).parameters["shell"]
    return np.array([parameters["width"], parameters["depth"], parameters["height"]])


@pytest.mark.parametrize("index", ROOMS)
def test_about_as_many_as_asked_for(placed, index):
    assert abs(len(placed(index)) - COUNT) <= 0.15 * COUNT


@pytest.mark.parametrize("index", ROOMS)
def test_no_probe_is_inside_of_anything(placed, index):
    """By signed crossings of a ray with the meshes of each thing, which shares nothing with the placement."""
    points = placed(index).astype(float)
    for thing in room(index).objects:
        assert not inside(points, *joined(thing)).any(), thing.name


@pytest.mark.parametrize("index", ROOMS)
def test_probes_keep_clear_of_walls_and_furniture(placed, index):
    """Distances to the triangles. The rays that look around a probe may miss a thing that is thin, not one that is
    large."""
    points = placed(index).astype(float)
    things = room(index).objects
    for thing in things:
        vertices, faces = joined(thing)
        if np.ptp(vertices, axis=0).min() < 0.05:
            continue
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        near = trimesh.proximity.closest_point_naive(mesh, points)[1] if len(faces) < 3000 else np.ones(1)
        assert near.min() > 0.03, thing.name


@pytest.mark.parametrize("index", ROOMS)
def test_probes_fill_the_room_and_nothing_but_the_room(placed, index):
    """The footprint is centred on the origin; the ground outside reaches a kilometre."""
    size, points = shell(index), placed(index)
    low, high = np.array([*(-size[:2] / 2), 0]), np.array([*(size[:2] / 2), size[2]])
    assert (points > low).all()
    assert (points < high).all()
    assert (np.ptp(points, axis=0) > 0.5 * size).all()


@pytest.mark.parametrize("index", ROOMS)
def test_probes_lie_on_a_regular_grid(placed, index):
    for axis in range(3):
        values = np.unique(np.round(placed(index)[:, axis], 4))
        steps = np.diff(values)
        # A whole plane may have been dropped, so gaps are multiples of the smallest.
        np.testing.assert_allclose(steps / steps.min(), np.round(steps / steps.min()), atol=0.01)


def test_equal_scenes_give_equal_probes(folders, placed):
    again = place(load_scene(folders(ROOMS[0]) / "scene.xml"), COUNT)
    np.testing.assert_array_equal(again, placed(ROOMS[0]))


def test_the_grid_of_a_cube_is_a_cube():
    """A box of 2 m around the origin: 27 probes are 3 × 3 × 3 of them, a third of it apart."""
    points = place(load_dict(scenes.closed_box(0.5, 1.0)), 27)
    assert len(points) == 27
    for axis in range(3):
        values = np.unique(np.round(points[:, axis], 3))
        np.testing.assert_allclose(values, [-2 / 3, 0, 2 / 3], atol=0.05)


def test_a_single_probe_stands_in_the_middle():
    (point,) = place(load_dict(scenes.closed_box(0.5, 1.0)), 1)
    np.testing.assert_allclose(point, 0, atol=0.1)


def test_a_cavity_is_no_room():
    """A hollow block with walls on the inside too stands in the box: what is in it is enclosed, but out of sight."""

    def cube(half, inwards):
        mesh = trimesh.creation.box(extents=[2 * half] * 3)
        return mesh.invert() or mesh if inwards else mesh

    description = scenes.closed_box(0.5, 1.0)
    import mitsuba as mi

    def as_shape(mesh, name):
        shape = mi.Mesh(name, len(mesh.vertices), len(mesh.faces))
        values = mi.traverse(shape)
        values["vertex_positions"] = mi.Float(np.asarray(mesh.vertices, dtype=np.float32).ravel())
        values["faces"] = mi.UInt32(np.asarray(mesh.faces, dtype=np.uint32).ravel())
        values.update()
        return shape

    description["outside"] = as_shape(cube(0.5, False), "outside")
    description["inside"] = as_shape(cube(0.45, True), "inside")
    points = place(load_dict(description), 125)
    assert len(points) > 60
    assert (np.abs(points).max(axis=1) > 0.5).all()


def test_outdoors_there_is_no_place():
    ground = scenes.rectangle([0, 0, 0], [0, 0, 1], (50, 50))
    with pytest.raises(ProbeError, match="nothing in the scene is enclosed"):
        place(
            load_dict({"type": "scene", "ground": ground, "ball": {"type": "sphere", "center": [0, 0, 2]}}), 8
        )


def test_fewer_than_one_is_refused():
    with pytest.raises(ProbeError, match="at least 1"):
        place(load_dict(scenes.closed_box(0.5, 1.0)), 0)
