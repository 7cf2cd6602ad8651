"""Light in few wavelets: environments of every kind, and the integrals that weights stand for."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.baselines.wavelets.haar import haar, inverse_haar, supports
from gibench.baselines.wavelets.light import (
    chosen_light,
    coefficients_of,
    light_at,
    scales,
    weights_of,
)
from gibench.rendering.lighting import EnvironmentMap
from gibench.rendering.panoramas import Panorama


def environment(pixels, rotation=0.0):
    return EnvironmentMap(Panorama.of("made", pixels), rotation)


def noise(height=32, seed=0):
    return np.random.default_rng(seed).uniform(0, 2, (height, 2 * height, 3))


@pytest.mark.parametrize("size", [2, 16])
def test_a_weight_is_the_integral_of_what_its_wavelet_gives_times_the_side_of_its_support(size):
    one = np.eye(size * size).reshape(size * size, size, size, 1)
    pictures = inverse_haar(one)
    integrals = np.abs(pictures).sum(axis=(1, 2, 3)) * 4 * np.pi / (6 * size**2)
    sides = np.sqrt((pictures != 0).sum(axis=(1, 2, 3)))
    np.testing.assert_allclose(scales(size).ravel(), integrals * sides / size)
    # Of a constant, the sums alone weigh anything: together 4π times its radiance.
    weights = weights_of(haar(np.full((6, size, size, 3), 0.5)), np.arange(6 * size**2))
    np.testing.assert_allclose(weights.sum(axis=0), 0.5 * 4 * np.pi)


def test_a_constant_has_only_its_sums():
    light = chosen_light(coefficients_of(environment(np.full((32, 64, 3), 0.3)), 16), 64, "area")
    assert sorted(light.places.tolist()) == [face * 256 for face in range(6)]
    np.testing.assert_allclose(light.weights, 0.3 * 4 * np.pi / 6, rtol=1e-6)


def test_black_light_has_no_wavelets():
    light = chosen_light(np.zeros((6, 16, 16, 3)), 64, "none")
    assert light.places.shape == (0,)
    assert light.weights.shape == (0, 3)


@pytest.mark.parametrize("weighting", ["none", "root-area", "area"])
def test_twice_the_light_has_twice_the_weights_of_the_same_wavelets(weighting):
    coefficients = coefficients_of(environment(noise()), 16)
    one, two = (chosen_light(factor * coefficients, 40, weighting) for factor in (1, 2))
    np.testing.assert_array_equal(one.places, two.places)
    np.testing.assert_array_equal(2 * one.weights, two.weights)
    other = coefficients_of(environment(noise(seed=1)), 16)
    both = light_at(coefficients + other, one.places)
    np.testing.assert_allclose(
        both.weights, one.weights + light_at(other, one.places).weights, rtol=1e-5, atol=1e-7
    )


def bright_texel():
    pixels = noise()
    pixels[3, 5] = 1e5
    return pixels


def sun():
    pixels = np.full((128, 256, 3), 0.5)
    pixels[30:32, 100:102] = 4e4
    return pixels


@pytest.mark.parametrize(
    "pixels", [bright_texel(), sun(), noise(64), noise(4)], ids=["texel", "sun", "64", "4"]
)
@pytest.mark.parametrize("weighting", ["none", "area"])
def test_hard_maps_give_finite_weights(pixels, weighting):
    coefficients = coefficients_of(environment(pixels), 64)
    light = chosen_light(coefficients, 64, weighting)
    assert len(light.places) == len(np.unique(light.places)) <= 64
    assert len(light.places) >= 40  # a sun in an even sky has not many
    assert np.isfinite(light.weights).all()
    if pixels.max() > 1e4:  # then they hold the lamp
        kept = np.zeros((6 * 64 * 64, 3))
        kept[light.places] = coefficients.reshape(-1, 3)[light.places]
        picture = inverse_haar(kept.reshape(6, 64, 64, 3))
        assert picture.max() > 0.3 * inverse_haar(coefficients).max()


def test_a_map_of_8192_columns():
    pixels = np.repeat(np.repeat(noise(64), 64, axis=0), 64, axis=1).astype(np.float32)
    small, large = (coefficients_of(environment(p), 16) for p in (noise(64), pixels))
    np.testing.assert_allclose(large, small, atol=2e-3 * np.abs(small).max())


def test_whole_turns_change_nothing():
    one, other = (coefficients_of(environment(noise(), turn), 16) for turn in (0.0, 2 * np.pi))
    np.testing.assert_array_equal(one, other)


def test_more_wavelets_than_there_are():
    light = chosen_light(coefficients_of(environment(noise()), 2), 64, "area")
    assert len(light.places) == 24


def test_smooth_transport_answers_to_all_levels_with_numbers_of_one_size():
    """Else what was never learned, and is of the size of the coarsest answers, would be noise in the fine ones."""
    size = 32
    across = (np.arange(size) + 0.5) / size
    smooth = np.sin(3 * across[:, None] + 2 * across[None, :])[None, ..., None]
    answers = np.abs(haar(np.repeat(smooth, 6, axis=0))[0, ..., 0]) / (scales(size) * size**3)
    level = np.floor(np.log2(np.maximum(np.arange(size)[:, None], np.arange(size)[None, :]).clip(1)))
    typical = np.array([np.median(answers[level == own]) for own in range(5)])
    assert typical.max() < 2 * typical.min()
    # By the integral of their magnitude alone they fall sixteen times.
    plain = np.array([np.median((answers * np.sqrt(supports(size)))[level == own]) for own in range(5)])
    assert plain[0] > 8 * plain[-1]
