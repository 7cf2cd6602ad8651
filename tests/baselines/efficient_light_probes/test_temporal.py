"""Frames brought to another's place, on a wall whose pattern is known everywhere."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from gibench.baselines.efficient_light_probes.temporal import accumulated, reprojected
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.replay import camera_arrays
from tests.baselines.efficient_light_probes.test_search import SIZE, floor, rays, vectors

NOW = PinholeCamera((0.3, -2.0, 2.5), (0.0, 0.2, 0.0), 1.0)
BEFORE = PinholeCamera((0.2, -2.1, 2.5), (-0.05, 0.2, 0.0), 1.0)
SIDES = [mi.Int32(side) for side in SIZE]


def pattern(points):
    """Smooth radiance on the floor."""
    x, y = points[:, 0], points[:, 1]
    return np.stack([1 + 0.5 * np.sin(0.5 * x), 1 + 0.5 * np.cos(0.5 * y), 2 + 0.2 * x], axis=-1)


def frame(camera, hit=floor, color=pattern):
    position, normal, material = hit(*rays(camera, SIZE))
    return {
        "position": vectors(mi.Point3f, position),
        "normal": vectors(mi.Vector3f, normal),
        "material": mi.UInt32(material.astype(np.uint32)),
        "color": vectors(mi.Color3f, color(position)),
        "camera": camera_arrays(camera, SIZE),
    }


def values(color):
    return np.array(mi.Color3f(color)).T


def test_a_pattern_on_a_surface_is_brought_to_where_it_is_now():
    now = frame(NOW)
    found, share = reprojected(now, frame(BEFORE), *SIDES)
    known = np.array(share) > 0.999
    assert known.mean() > 0.8
    np.testing.assert_allclose(values(found)[known], values(now["color"])[known], atol=2e-3)


def test_the_same_camera_brings_every_pixel_to_itself():
    now = frame(NOW)
    found, share = reprojected(now, now, *SIDES)
    np.testing.assert_allclose(np.array(share), 1, atol=1e-3)
    np.testing.assert_allclose(values(found), values(now["color"]), atol=1e-3)


def test_what_was_hidden_or_of_another_material_is_not_taken():
    def raised(origins, directions):
        """The floor, but where x < 0 a block stood 0.3 higher in the earlier frame."""
        points, normals, material = floor(origins, directions)
        top = origins + directions * ((0.3 - origins[:, 2:]) / directions[:, 2:])
        block = top[:, :1] < 0
        return np.where(block, top, points), normals, material

    def painted(origins, directions):
        points, normals, material = floor(origins, directions)
        return points, normals, np.where(points[:, 0] < 0, 7, material)

    now = frame(NOW)
    for earlier in (raised, painted):
        found, share = reprojected(now, frame(BEFORE, earlier), *SIDES)
        hidden = np.array(now["position"].x) < -0.3
        assert not np.array(share)[hidden].any()
        assert np.array(share)[np.array(now["position"].x) > 0.1].mean() > 0.8
        assert np.isfinite(values(found)).all()


def test_a_camera_that_looked_elsewhere_knows_nothing():
    away = PinholeCamera((0.3, -2.0, 2.5), (0.3, -4.0, 0.0), 1.0)
    found, share = reprojected(frame(NOW), frame(away), *SIDES)
    assert not np.array(share).any()
    assert not values(found).any()


def test_frames_weigh_1_and_3_and_1_tenth():
    def constant(value):
        return lambda points: np.full((len(points), 3), value)

    now, *past = (frame(NOW, color=constant(value)) for value in (1.0, 10.0, 100.0))
    found = [reprojected(now, one, *SIDES) for one in past]
    for count, expected in ((0, 1), (1, (1 + 0.3 * 10) / 1.3), (2, (1 + 0.3 * 10 + 0.1 * 100) / 1.4)):
        np.testing.assert_allclose(values(accumulated(now["color"], found[:count])), expected, rtol=1e-2)


def test_scale_does_not_matter():
    """A scene 100 times as large, seen from 100 times as far, keeps the same pixels."""

    def large(camera):
        return PinholeCamera(
            *(tuple(100 * c for c in p) for p in (camera.position, camera.target)), camera.fov
        )

    def shares(grow):
        return np.array(reprojected(frame(grow(NOW)), frame(grow(BEFORE)), *SIDES)[1])

    np.testing.assert_allclose(shares(large), shares(lambda camera: camera), atol=1e-2)
