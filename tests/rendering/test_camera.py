"""Which cameras there are, and that all of them render."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.rendering.camera import CameraError, PinholeCamera
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict

from . import scenes


@pytest.mark.parametrize(
    ("position", "target", "fov"),
    [
        ((0, 0, 0), (0, 0, 0), 1.0),
        ((1, 2, 3), (1, 2, 3 + 1e-10), 1.0),
        ((0, 0, float("nan")), (1, 0, 0), 1.0),
        ((0, 0, 0), (float("inf"), 0, 0), 1.0),
        ((0, 0, 0), (1, 0, 0), 0.0),
        ((0, 0, 0), (1, 0, 0), np.pi),
        ((0, 0, 0), (1, 0, 0), float("nan")),
    ],
)
def test_what_sees_nothing_is_refused(position, target, fov):
    with pytest.raises(CameraError):
        PinholeCamera(position, target, fov)


def test_a_target_ten_centimetres_away_is_apart_however_far_out_the_camera_is():
    camera = PinholeCamera((1e4, 1e4, 0), (1e4 + 0.1, 1e4, 0), 1.0)
    np.testing.assert_allclose(camera.frame[2], [1, 0, 0], atol=1e-9)


def test_numbers_of_numpy_make_a_camera_that_renders():
    scene = load_dict(scenes.closed_box(0.5, 1.0))
    options = {"resolution": (4, 4), "channels": ["color", "motion"], "spp": 4}
    plain = PinholeCamera((0.0, 0.1, 0.2), (1.0, 0.0, 0.0), 1.0)
    numbers = np.array(plain.position), np.array(plain.target), np.float64(plain.fov)
    camera = PinholeCamera(tuple(numbers[0]), tuple(numbers[1]), numbers[2])
    first = render_frame(scene, plain, previous_camera=plain, **options).arrays
    second = render_frame(scene, camera, previous_camera=camera, **options).arrays
    for name, values in first.items():
        np.testing.assert_array_equal(values, second[name])


@pytest.mark.parametrize("target", [(0, 0, -1), (0, 0, 1), (1e-5, 2e-5, -1), (1, 0, -1e3), (1, 2, 0.5)])
def test_up_gives_a_look_at_transform_with_the_same_axes(target):
    import mitsuba as mi

    camera = PinholeCamera((0, 0, 0), target, 1.0)
    place = mi.ScalarTransform4f().look_at(
        origin=[0, 0, 0], target=list(map(float, target)), up=list(camera.up)
    )
    right, down, forward = camera.frame
    # Mitsuba's x points left.
    np.testing.assert_allclose(np.array(place.matrix)[:3, :3].T, [-right, -down, forward], atol=1e-5)
