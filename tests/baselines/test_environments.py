"""Environments that are turned, against Mitsuba's own and against faces that change places."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.environments import environment_of, turned
from gibench.baselines.method import MethodError
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.cubemap import to_cubemap
from gibench.rendering.latlong import coordinates
from gibench.rendering.light_rig import LightRig
from gibench.rendering.lighting import EnvironmentMap, Lighting
from gibench.rendering.panoramas import HEIGHT, Panorama
from gibench.rendering.scene import load_dict
from tests.baselines.sites import view
from tests.rendering import scenes


def panorama(height=16, seed=0):
    return np.random.default_rng(seed).uniform(0, 2, (height, 2 * height, 3)).astype(np.float32)


def test_whole_turns_change_no_bit():
    pixels = panorama()
    for turns in (0, 1, -1, 5):
        np.testing.assert_array_equal(turned(pixels, turns * 2 * np.pi), pixels)


@pytest.mark.parametrize("angle", [0.1, np.pi / 3, -2.0])
def test_light_is_kept_and_turning_back_blurs_no_constant(angle):
    pixels = panorama()
    np.testing.assert_allclose(turned(pixels, angle).sum(axis=1), pixels.sum(axis=1), rtol=1e-5)
    np.testing.assert_array_equal(turned(np.full_like(pixels, 0.7), angle), np.float32(0.7))


def test_a_quarter_turn_moves_the_sides_on():
    pixels = panorama(32)
    before, after = to_cubemap(pixels, 8), to_cubemap(turned(pixels, np.pi / 2), 8)
    sides = {"+x": 0, "-x": 1, "+y": 2, "-y": 3}
    for old, new in (("+x", "+y"), ("+y", "-x"), ("-x", "-y"), ("-y", "+x")):
        np.testing.assert_allclose(after[sides[new]], before[sides[old]], rtol=1e-5, atol=1e-6)


def test_it_turns_as_the_renderer_does():
    """What rays that meet nothing see under a rig, beside the turned panorama."""
    smooth = np.zeros((HEIGHT, 2 * HEIGHT, 3), np.float32)
    columns = np.arange(2 * HEIGHT) * (np.pi / HEIGHT)
    smooth[:] = np.stack([1.5 + np.sin(columns), 1.5 + np.cos(columns), 1.2 + np.sin(2 * columns)], axis=-1)
    rig = LightRig(load_dict({"type": "scene", "floor": scenes.rectangle([0, 0, -9], [0, 0, 1], (1, 1))}))
    towards = np.array([[1.0, 0.2, 0.1], [-0.3, 1.0, 0.4], [0.2, -1.0, 0.3], [-1.0, -0.4, 0.2]])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    for angle in (0.0, 0.4, 2.5):
        rig.set(Lighting(environment=EnvironmentMap(Panorama.of("smooth", smooth), angle)))
        ray = mi.Ray3f(mi.Point3f(0, 0, 0), mi.Vector3f(towards.T))
        si = rig.scene.mi_scene.ray_intersect(ray)
        seen = np.array(si.emitter(rig.scene.mi_scene).eval(si)).T
        x, y = coordinates(towards, HEIGHT)
        ours = turned(smooth, angle)[y.astype(int), x.astype(int)]
        np.testing.assert_allclose(seen, ours, atol=0.05)


def test_a_frame_without_environment_is_named():
    with pytest.raises(MethodError, match=r"nfvr is for frames under an environment alone, .* own light"):
        environment_of(view(PinholeCamera((0, 0, 1), (0, 1, 1), 1.0)), "nfvr")
