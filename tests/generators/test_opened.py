"""Rooms with their ceiling or a wall taken away: what is gone, what is left, and that light gets in."""

import numpy as np
import pytest

from gibench.generators.opened import OPENED, UnknownOpening, opened_room, without_faces
from gibench.generators.parts import Mesh
from gibench.generators.rooms import sample_room
from gibench.generators.shell import footprint_corners, measured_walls
from gibench.generators.visibility import RayCaster
from tests.generators import rooms_at_hand

ROOMS = range(10)


def escaping(room, towards):
    """Share of rays that leave the room, from points a hand's breadth inside of its footprint, at eye level."""
    shell = room.parameters["shell"]
    half = np.array([shell["width"], shell["depth"]]) / 2 - 0.1
    points = np.random.default_rng(0).uniform((*-half, 1.2), (*half, 1.9), (800, 3))
    if shell["notch"] is not None:
        notch = footprint_corners(shell["width"], shell["depth"], shell["notch"])[int(shell["notch"][0]) + 1]
        points = points[(np.sign(points[:, :2] - notch) != np.sign(notch)).any(axis=1)]
    meshes = [mesh for thing in room.objects for mesh, _ in thing.shapes]
    distance, _ = RayCaster(meshes, [0] * len(meshes)).cast(points, np.tile(towards, (len(points), 1)))
    return np.isinf(distance).mean()


@pytest.mark.parametrize("index", ROOMS)
def test_without_a_ceiling_the_sky_is_seen_from_nearly_everywhere(index):
    room = rooms_at_hand.room(index)
    assert escaping(room, (0, 0, 1.0)) == 0
    opened = opened_room(room, "ceiling")
    # Shelves and cupboards are what is left overhead.
    assert escaping(opened, (0, 0, 1.0)) > 0.8
    assert opened.parameters["opened"] == "ceiling"
    assert len(opened.openings) == 0


@pytest.mark.parametrize("index", ROOMS)
def test_a_stage_is_open_to_one_side(index):
    room = rooms_at_hand.room(index)
    stage = opened_room(room, "stage")
    shell = room.parameters["shell"]
    walls = measured_walls(
        footprint_corners(shell["width"], shell["depth"], shell["notch"]), shell["wall_thickness"]
    )
    wall = walls[stage.parameters["open_wall"]]
    out = np.array([*-wall.inward, 0.0])
    assert escaping(stage, out) > max(escaping(room, out), 0.3)
    names = {thing.name for thing in stage.objects}
    assert f"wall.{wall.index}" not in names
    assert sum(name.startswith("wall.") for name in names) == len(walls) - 1
    for thing in stage.objects:
        if thing.family in ("picture", "mirror", "curtain", "wall_lamp", "wall_cupboard", "window", "door"):
            vertices = np.concatenate([mesh.vertices for mesh, _ in thing.shapes])
            # It still has a wall behind it.
            away = [((vertices[:, :2] - w.start) @ w.inward).min() for w in walls if w is not wall]
            assert min(abs(a) for a in away) < 0.4, thing.name


@pytest.mark.parametrize("opened", ["ceiling", "stage"])
@pytest.mark.parametrize("index", ROOMS)
def test_nothing_hangs_in_the_air_and_nothing_refers_to_what_is_gone(index, opened):
    room = rooms_at_hand.room(index)
    left = opened_room(room, opened)
    assert not {t.family for t in left.objects} & {"ceiling", "pendant", "ceiling_panel", "downlight"}
    names = {thing.name for thing in left.objects}
    assert {light.name.rsplit(".", 1)[0] for light in left.lights} <= names
    assert {material for thing in left.objects for _, material in thing.shapes} <= set(left.materials)
    assert left.cameras == room.cameras
    # The room itself is what it was.
    assert {t.name for t in room.objects} >= names
    assert any(t.family == "ceiling" for t in room.objects)


def test_a_still_life_is_open_as_it_is():
    room = sample_room(0, 0, kind="still-life", views=1)
    assert opened_room(room, "stage") is room


def test_what_cannot_be_taken_away():
    room = rooms_at_hand.room(0)
    assert opened_room(room, "none") is room
    with pytest.raises(
        UnknownOpening, match="'floor' is not allowed; allowed is one of none, ceiling, stage"
    ):
        opened_room(room, "floor")
    assert OPENED == ("none", "ceiling", "stage")


def test_a_mesh_without_faces_keeps_what_the_others_need():
    corners = np.arange(15.0).reshape(5, 3)
    mesh = Mesh(corners, np.array([[0, 1, 2], [2, 3, 4], [0, 3, 4]], np.int32), corners, np.zeros((0, 2)))
    left = without_faces(mesh, np.array([False, False, True]))
    np.testing.assert_array_equal(left.vertices[left.faces], corners[[[0, 1, 2], [2, 3, 4]]])
    assert len(without_faces(mesh, np.array([True, False, True])).vertices) == 3
