"""The papers' scenes, as they are found on the web, against what another renderer made of them."""

from __future__ import annotations

import gc
import os
from functools import cache
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from gibench.datasets import exr
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.room import import_room
from gibench.generators.imported.scene import ImportSettings, import_scene
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.free_space import enclosed, surroundings
from gibench.rendering.render import render_frame

SCENES = {"staircase": 0.06, "living-room": 0.03, "kitchen": 0.03}
"""Name → largest relative difference of the mean of a colour channel."""

pytestmark = pytest.mark.skipif(
    "GIBENCH_EXTERNAL" not in os.environ, reason="GIBENCH_EXTERNAL names no folder with scenes/"
)


@pytest.fixture(scope="module", autouse=True)
def forgotten():
    """No scene outlives this module: every material alive is traced into the kernels of all tests after it."""
    yield
    for kept in (imported, rooms, compared):
        kept.cache_clear()
    gc.collect()


def folder(name: str) -> Path:
    return Path(os.environ["GIBENCH_EXTERNAL"]) / "scenes" / name


@cache
def imported(name: str):
    return import_scene(folder(name) / "scene.xml", ImportSettings(allow_missing=True))


@cache
def rooms(name: str):
    return import_room(imported(name), resolution=(64, 36), seed=4, views=2, path="walk", path_views=6)


@cache
def compared(name: str) -> tuple[np.ndarray, np.ndarray, dict]:
    """The scene's own camera here and there, at an eighth of the size."""
    with OpenEXR.File(str(folder(name) / "TungstenRender.exr")) as file:
        reference = file.channels()["RGB"].pixels.astype(np.float64)
    height, width = (side // 8 for side in reference.shape[:2])
    reference = reference.reshape(height, 8, width, 8, 3).mean((1, 3))
    camera = imported(name).cameras[0].at((width, height))
    frame = render_frame(
        imported(name).loaded,
        PinholeCamera(camera.position, camera.target, camera.fov),
        resolution=(width, height),
        channels=("radiance", "surface"),
        spp=64,
        max_depth=16,
        denoise=True,
    )
    return frame.arrays["color"].astype(np.float64), reference, frame.arrays


@pytest.mark.parametrize("name", SCENES)
def test_means_are_those_of_another_renderer(name):
    mine, reference, _ = compared(name)
    np.testing.assert_allclose(mine.mean((0, 1)) / reference.mean((0, 1)), 1, atol=SCENES[name])


@pytest.mark.parametrize("name", SCENES)
def test_what_is_bright_there_is_bright_here(name):
    mine, reference, _ = compared(name)
    logs = [np.log(image @ [0.2126, 0.7152, 0.0722] + 1e-3).ravel() for image in (mine, reference)]
    assert np.corrcoef(*logs)[0, 1] >= 0.97


@pytest.mark.parametrize("name", SCENES)
def test_color_is_the_sum_of_its_parts_to_the_last_bit(name):
    arrays = compared(name)[2]
    stored = exr.decode(exr.encode(arrays))
    assert (exr.total_of_parts(stored).astype(stored["color"].dtype) == stored["color"]).all()
    for part, values in arrays.items():
        assert np.isfinite(values).all(), part
    for ratio in ("albedo", "specular_albedo", "roughness"):
        assert arrays[ratio].min() >= 0
        assert arrays[ratio].max() <= 1 + 1e-5


@pytest.mark.parametrize("name", SCENES)
def test_the_axis_and_the_camera_are_those_of_the_file(name):
    scene = imported(name)
    assert scene.up == "y"
    assert len(scene.cameras) == 1
    assert not [change for change in scene.changes if change.rule == "cameras"]


def test_missing_meshes_are_listed():
    with pytest.raises(SceneFileError, match="6 files are missing: models/Mesh"):
        import_scene(folder("kitchen") / "scene.xml")
    assert len(imported("kitchen").missing) == 6


@pytest.mark.parametrize("name", SCENES)
def test_views_and_walks_stand_in_the_room(name):
    """Enclosed, outside of everything, in front of nothing, and on the floor that most of the room has."""
    room = rooms(name)
    assert len(room.cameras) == 1 + 2 + 6
    points = np.array([camera.position for camera in room.cameras[1:]])
    scene = room.scene.loaded
    assert enclosed(scene, points).all()
    free, near = surroundings(scene, points)
    assert free.all()
    assert near.min() > 0.25
    assert (points[:, 2] > 1.1).all()
    assert (points[:, 2] < 1.9).all()
    steps = np.linalg.norm(np.diff(points[2:], axis=0), axis=1)
    assert steps.max() < 2 * np.median(steps)


@pytest.mark.parametrize("name", SCENES)
def test_daylight_has_openings_where_there_is_a_sky(name):
    assert bool(len(rooms(name).openings)) == (name == "living-room")
