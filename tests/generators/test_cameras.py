import math
from collections import Counter

import numpy as np
import pytest
import shapely

from gibench.generators.cameras import (
    FOV,
    HEIGHTS,
    PATHS,
    NoView,
    ViewSpace,
    camera_at,
    sample_path,
    sample_stills,
)
from gibench.generators.grid_solid import box
from gibench.generators.rooms import sample_room
from gibench.generators.view_checks import check_views
from gibench.generators.visibility import RayCaster

FREE = shapely.box(-2.2, -2.2, 2.2, 2.2)


@pytest.fixture(scope="module")
def stage():
    """A hall 8 m wide with a ring of columns along its walls."""
    meshes = [
        box((-4, -4, -0.2), (4, 4, 0)),
        box((-4, -4, 3), (4, 4, 3.2)),
        box((-4.2, -4, 0), (-4, 4, 3)),
        box((4, -4, 0), (4.2, 4, 3)),
        box((-4, -4.2, 0), (4, -4, 3)),
        box((-4, 4, 0), (4, 4.2, 3)),
    ]
    things = []
    for angle in np.linspace(0, 2 * math.pi, 28, endpoint=False):
        x, y = 3.4 * math.cos(angle), 3.4 * math.sin(angle)
        things.append((x, y, 0.7))
        meshes.append(box((x - 0.15, y - 0.15, 0), (x + 0.15, y + 0.15, 1.4)))
    caster = RayCaster(meshes, list(range(len(meshes))))
    return ViewSpace(FREE, 3.0, np.array(things), caster, 6)


@pytest.mark.parametrize("seed", range(3))
def test_stills_pass_and_differ(stage, seed):
    cameras, refused = sample_stills(np.random.default_rng(seed), stage, 6)
    assert len(cameras) == 6
    assert isinstance(refused, Counter)
    for view in check_views(stage.caster, cameras, 6):
        assert view.reason == ""
    for camera in cameras:
        assert FREE.covers(shapely.Point(camera.position[:2]))
        assert HEIGHTS[0] <= camera.position[2] <= HEIGHTS[1]
        assert FOV[0] <= camera.fov <= FOV[1]
        assert camera.path == ""
    for i, a in enumerate(cameras):
        for b in cameras[:i]:
            turn = math.acos(
                np.clip(
                    np.dot(np.subtract(a.target, a.position), np.subtract(b.target, b.position)) / 4, -1, 1
                )
            )
            assert math.dist(a.position, b.position) > 0.7 or turn > 0.35


@pytest.mark.parametrize("kind", PATHS)
def test_paths_are_smooth_and_every_frame_passes(stage, kind):
    frames = 24
    cameras, _ = sample_path(np.random.default_rng(4), stage, kind, frames)
    assert [c.step for c in cameras] == list(range(frames))
    assert {c.path for c in cameras} == {kind}
    assert all(not view.reason for view in check_views(stage.caster, cameras, 6))
    places = np.array([c.position for c in cameras])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert (np.ptp(places[:, 2])) < 1e-12
    assert steps.min() > 0.6 * steps.max()
    heading = np.diff(places[:, :2], axis=0)
    bends = np.abs(np.angle(np.exp(1j * np.diff(np.arctan2(heading[:, 1], heading[:, 0])))))
    assert bends.max() < 0.9
    looks = np.array([np.subtract(c.target, c.position) / 2 for c in cameras])
    turns = np.arccos(np.clip((looks[1:] * looks[:-1]).sum(1), -1, 1))
    assert turns.max() < 0.5
    assert all(FREE.covers(shapely.Point(p[:2])) for p in places)


def test_a_figure_eight_crosses_itself_and_an_orbit_keeps_its_distance(stage):
    eight, _ = sample_path(np.random.default_rng(1), stage, "eight", 40)
    line = shapely.LineString([c.position[:2] for c in eight] + [eight[0].position[:2]])
    assert not line.is_simple
    orbit, _ = sample_path(np.random.default_rng(1), stage, "orbit", 12)
    places = np.array([c.position[:2] for c in orbit])
    # Three points of a circle give its middle, from which the others are as far.
    a, b, c = places[0], places[6], places[11]
    matrix = 2 * np.array([b - a, c - a])
    middle = np.linalg.solve(matrix, [b @ b - a @ a, c @ c - a @ a])
    np.testing.assert_allclose(np.linalg.norm(places - middle, axis=1), np.linalg.norm(a - middle), rtol=0.01)


def test_an_empty_hall_has_no_view():
    meshes = [box((-4, -4, -0.2), (4, 4, 0)), box((-4, -4, 3), (4, 4, 3.2))]
    stage = ViewSpace(FREE, 3.0, np.array([[0.0, 0, 1], [1, 1, 1]]), RayCaster(meshes, [0, 1]), 2)
    with pytest.raises(NoView, match="no stills passed") as caught:
        sample_stills(np.random.default_rng(0), stage, 2)
    assert sum(caught.value.reasons.values()) > 100
    with pytest.raises(NoView, match="no walk passed"):
        sample_path(np.random.default_rng(0), stage, "walk", 4)


def test_camera_at_looks_along_yaw_and_pitch():
    camera = camera_at((1.0, 2.0, 1.5), math.pi / 2, -0.3, 1.0)
    look = np.subtract(camera.target, camera.position)
    np.testing.assert_allclose(look / np.linalg.norm(look), [0, math.cos(0.3), -math.sin(0.3)], atol=1e-12)


def test_hundreds_of_stills_are_taken_as_they_pass():
    room = sample_room(4, 0, kinds=("living",), views=200)
    assert len(room.cameras) == 200
    assert len({camera.position for camera in room.cameras}) == 200
