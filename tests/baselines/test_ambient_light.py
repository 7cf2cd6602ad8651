"""The constant of `ambient`, against closed forms."""

import dataclasses

import numpy as np
import pytest

from gibench.baselines.ambient_light.implementation import CONSTANT, _read, fitted, light_of
from gibench.baselines.method import MethodError
from gibench.rendering.lighting import AreaLight, EnvironmentMap, Lighting
from gibench.rendering.panoramas import Panorama

CONSTANTS = np.array([0.3, 0.2, 0.05])


def albedo(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.1, 0.9, (6, 5, 3)).astype(np.float32)


def test_a_scene_with_ambient_light_alone_gives_it_back():
    frames = [(CONSTANTS * albedo(seed), albedo(seed), exposure) for seed, exposure in ((0, 1.0), (1, 50.0))]
    np.testing.assert_allclose(fitted(frames), CONSTANTS, rtol=1e-6)


def test_frames_count_as_they_are_shown():
    """A frame that is lit a hundred times brighter is exposed a hundred times less, and both count the same."""
    tint = albedo(0)
    dim, bright = (CONSTANTS * tint, tint, 1.0), (100 * CONSTANTS * tint, tint, 0.01)
    # (1·1·c + 0.01²·100·c) / (1 + 0.01²) of squares that are the same.
    expected = CONSTANTS * (1 + 0.01**2 * 100) / (1 + 0.01**2)
    np.testing.assert_allclose(fitted([dim, bright]), expected, rtol=1e-6)


def test_twice_the_light_is_twice_the_ambient_light():
    area = AreaLight((0, 0, 2), (0, 0, -1), 0.5, 0.4, (4.0, 2.0, 0.0))
    np.testing.assert_allclose(light_of(Lighting(area)), [0.8, 0.4, 0])
    np.testing.assert_array_equal(light_of(Lighting()), 1)
    pixels = np.random.default_rng(1).random((8, 16, 3)).astype(np.float32)
    rows = np.sin(np.pi * (np.arange(8) + 0.5) / 8)[:, None, None]
    environment = [Lighting(environment=EnvironmentMap(Panorama.of("x", k * pixels))) for k in (1, 2)]
    expected = np.sum(rows * pixels, axis=(0, 1)) / (16 * rows.sum())
    np.testing.assert_allclose(light_of(environment[0]), expected, rtol=1e-6)
    np.testing.assert_allclose(light_of(environment[1]), 2 * expected, rtol=1e-6)
    tint = albedo(0)
    lights = [light_of(Lighting(dataclasses.replace(area, width=side))) for side in (0.5, 2.0)]
    frames = [(CONSTANTS * tint * light, tint * light, 1.0) for light in lights]
    np.testing.assert_allclose(fitted(frames)[:2], CONSTANTS[:2], rtol=1e-6)


def test_nothing_has_albedo():
    black = np.zeros((2, 2, 3), np.float32)
    np.testing.assert_array_equal(fitted([(black + 1, black, 1.0)]), 0)


@pytest.mark.parametrize("content", ["", "[1, 2]", "[1, 2, NaN]", "{}"])
def test_a_damaged_constant_is_named(tmp_path, content):
    (tmp_path / CONSTANT).write_text(content)
    with pytest.raises(MethodError, match="remove that folder"):
        _read(tmp_path)
