"""Which cameras there are, and that all of them render."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.rendering.camera import CameraError, PinholeCamera, RayGenerator
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
        origin=[0, 0, 0], target=list(map(float, target)), up=list(camera.look_at_up)
    )
    right, down, forward = camera.frame
    # Mitsuba's x points left.
    np.testing.assert_allclose(np.array(place.matrix)[:3, :3].T, [-right, -down, forward], atol=1e-5)


def plain_frame(position, target):
    """Axes of a camera with Z up: the closed form."""
    forward = np.subtract(target, position).astype(np.float64)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    length = np.linalg.norm(right)
    right = right / length if length > 1e-7 else np.array([1.0, 0.0, 0.0])
    return np.array([right, np.cross(forward, right), forward])


def test_cameras_with_z_up_keep_every_bit_of_their_axes_and_their_centre():
    rng = np.random.default_rng(3)
    places = [(rng.normal(size=3) * 10, rng.normal(size=3) * 10) for _ in range(200)]
    places += [((0, 0, 0), (0, 0, -1)), ((0, 0, 0), (0, 0, 1)), ((0, 0, 0), (1e-8, 0, -1))]
    for position, target in places:
        camera = PinholeCamera(position, target, 1.1)
        np.testing.assert_array_equal(camera.frame, plain_frame(position, target))
        assert camera.centre((37, 22)) == (18.5, 11.0)


def odd_cameras(count, seed=0):
    """Cameras that are rolled, off-centre and mirrored, at random."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        yield PinholeCamera(
            rng.normal(size=3),
            rng.normal(size=3) + 5,
            rng.uniform(0.3, 2.2),
            up=rng.normal(size=3) * 10.0 ** rng.integers(-200, 200),
            principal_point=rng.uniform(-1.5, 1.5, 2),
            mirrored=number % 2,
        )


@pytest.mark.parametrize("camera", list(odd_cameras(8)))
def test_rays_are_projected_where_they_came_from(camera):
    import mitsuba as mi

    resolution = (40, 30)
    generator = RayGenerator(camera, resolution)
    pixel = np.random.default_rng(1).uniform((0, 0), resolution, (100, 2))
    rays = generator.rays(mi.Point2f(pixel.T.astype(np.float32)))
    points = np.array(rays.o) + np.array(rays.d) * np.linspace(0.5, 20, 100)
    x, y, depth = camera.project(points.T.astype(np.float64), resolution)
    np.testing.assert_allclose(np.stack([x, y], 1), pixel, atol=2e-3)
    assert (depth > 0).all()
    film, deep = generator.project(mi.Point3f(points.astype(np.float32)))
    np.testing.assert_allclose(np.array(film).T, pixel, atol=2e-3)
    np.testing.assert_allclose(np.array(deep), depth, rtol=1e-5)


@pytest.mark.parametrize("camera", list(odd_cameras(4, 7)))
def test_axes_are_a_rotation_unless_they_are_mirrored(camera):
    axes = camera.frame
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(-1 if camera.mirrored else 1)
    up = np.array(camera.up) / np.abs(camera.up).max()
    assert -axes[1] @ up > 0
    assert axes[0] @ up == pytest.approx(0, abs=1e-12)


def test_a_roll_turns_the_image_and_a_mirror_exchanges_left_and_right():
    resolution, point = (40, 40), np.array([1.0, 10.0, 2.0])  # right of the axis, and higher above it
    plain = PinholeCamera((0, 0, 0), (0, 1, 0), 1.0)
    x, y, _ = np.array(plain.project(point, resolution)) - 20
    seen = {
        (1.0, 0.0, 0.0): (y, -x),  # its top is what was to the right
        (0.0, 0.0, -1.0): (-x, -y),
    }
    for up, expected in seen.items():
        found = PinholeCamera((0, 0, 0), (0, 1, 0), 1.0, up).project(point, resolution)[:2]
        np.testing.assert_allclose(np.array(found) - 20, expected, atol=1e-12)
    mirrored = PinholeCamera((0, 0, 0), (0, 1, 0), 1.0, mirrored=True).project(point, resolution)
    np.testing.assert_allclose(np.array(mirrored[:2]) - 20, (-x, y), atol=1e-12)
    shifted = PinholeCamera((0, 0, 0), (0, 1, 0), 1.0, principal_point=(0.25, -0.5)).project(
        point, resolution
    )
    np.testing.assert_allclose(np.array(shifted[:2]) - 20, (x + 10, y - 20), atol=1e-12)


@pytest.mark.parametrize(
    "options",
    [
        {"up": (0, 0, 0)},
        {"up": (0, 2, 0)},
        {"up": (0, -1, 1e-9)},
        {"up": (0, float("nan"), 1)},
        {"up": (float("inf"), 0, 1)},
        {"up": (1, 0)},
        {"principal_point": (0, float("nan"))},
        {"principal_point": (0, 0, 0)},
        {"principal_point": (1e300, 0)},
    ],
)
def test_ups_and_principal_points_that_are_none(options):
    with pytest.raises(CameraError):
        PinholeCamera((0, 0, 0), (0, 1, 0), 1.0, **options)
