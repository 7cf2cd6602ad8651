"""Camera rays a pixel: what the grid of rays alone leaves wrong, and what it takes, over rooms of the presets.

The light of a lightmap is a function of the ray, so that an image of many rays is the truth of the same method: no
noise and no other error is in the difference.
"""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from gibench import metrics
from gibench.baselines.lightmap import METHOD
from gibench.baselines.stages import Stages
from gibench.rendering.backend import select_variant
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.scene import load_scene
from tests.baselines.sites import site, view

pytestmark = pytest.mark.performance

ROOMS = tuple(map(int, os.environ.get("GIBENCH_RAYS_ROOMS", "0,1,2,3").split(",")))
VIEWS = 4
RESOLUTION = (160, 90)
RAYS = (1, 4, 16, 64)
TRUTH = 256
REPEATS = 5
DISAGREE = (0.02, 0.05, 0.1)
"""Display values by which the four rays of a pixel differ at least, for it to get sixteen."""

SETTINGS = {"texels": 8, "lightmap_spp": 16}


def images(method, camera, rays, seconds=None):
    """The mean of REPEATS' least CPU seconds is added to `seconds`; the image is (H, W, 3)."""
    method.grid = round(rays**0.5)
    taken = []
    for _ in range(1 if seconds is None else REPEATS):
        began = time.process_time()
        image = np.asarray(method.render(view(camera, resolution=RESOLUTION), Stages()).color)
        taken.append(time.process_time() - began)
    if seconds is not None:
        seconds[rays].append(min(taken))
    return image


def test_what_the_number_of_camera_rays_leaves_wrong(tmp_path):
    from gibench.generators.rooms import sample_room
    from gibench.generators.scene_files import write_room

    select_variant("auto")
    errors = {rays: [] for rays in RAYS}
    seconds = {rays: [] for rays in RAYS}
    mixed = {limit: [] for limit in DISAGREE}
    for index in ROOMS:
        room = sample_room(4, index, views=VIEWS)
        write_room(room, tmp_path / str(index))
        scene = load_scene(tmp_path / str(index) / "scene.xml")
        method = METHOD.load()(METHOD.settings(SETTINGS))
        method.prepare(site(scene, tmp_path, name=str(index)))
        for given in room.cameras[:VIEWS]:
            camera = PinholeCamera(given.position, given.target, given.fov)
            truth = images(method, camera, TRUTH)
            exposure = float(metrics.reference_exposure(truth))
            shown = {rays: metrics.tone_map(images(method, camera, rays, seconds), exposure) for rays in RAYS}
            right = metrics.tone_map(truth, exposure)
            for rays in RAYS:
                errors[rays].append(float(metrics.rmse_display(shown[rays], right)))
            # A pixel of four rays is a block of 2 × 2 pixels of an image of twice the size.
            method.grid = 1
            fine = np.asarray(
                method.render(view(camera, resolution=(2 * RESOLUTION[0], 2 * RESOLUTION[1])), Stages()).color
            )
            blocks = metrics.tone_map(fine, exposure).reshape(RESOLUTION[1], 2, RESOLUTION[0], 2, 3)
            spread = (blocks.max(axis=(1, 3)) - blocks.min(axis=(1, 3))).max(axis=-1)
            for limit in DISAGREE:
                more = spread > limit
                image = np.where(more[..., None], shown[16], shown[4])
                mixed[limit].append((float(metrics.rmse_display(image, right)), float(more.mean())))
    print(f"\n{len(ROOMS)} rooms, {VIEWS} views each, {RESOLUTION[0]}×{RESOLUTION[1]}, against {TRUTH} rays:")
    base = np.sum(seconds[4])
    for rays in RAYS:
        print(
            f"  {rays:3} rays: display RMSE {np.mean(errors[rays]):.4f} (largest {np.max(errors[rays]):.4f}), "
            f"CPU time {np.sum(seconds[rays]) / base:.2f} of 4 rays"
        )
    for limit, found in mixed.items():
        error, share = np.mean(found, axis=0)
        print(
            f"  4 rays, and 16 where these differ by more than {limit}: {error:.4f}; "
            f"{100 * share:.0f} % of the pixels, {4 + 12 * share:.1f} rays a pixel"
        )
    assert np.mean(errors[16]) < np.mean(errors[4]) < np.mean(errors[1])
