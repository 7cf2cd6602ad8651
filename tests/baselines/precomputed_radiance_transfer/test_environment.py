"""Environments in spherical harmonics, beside SciPy's and beside panoramas that are turned texel by texel."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import sph_harm_y

from gibench.baselines import environments
from gibench.baselines.precomputed_radiance_transfer.environment import (
    DEGREE,
    coefficients_of,
    degrees,
    negative_share,
    orders,
    projected,
    turned,
    window,
)
from gibench.rendering.latlong import directions, solid_angles
from gibench.rendering.lighting import EnvironmentMap
from gibench.rendering.panoramas import HEIGHT, Panorama

PIXELS = np.random.default_rng(0).uniform(0, 2, (16, 32, 3))


def harmonic(band, m, towards):
    """Real harmonic with the Condon-Shortley phase, of SciPy's complex ones."""
    theta = np.arccos(np.clip(towards[..., 2], -1, 1))
    value = sph_harm_y(band, abs(m), theta, np.arctan2(towards[..., 1], towards[..., 0]))
    return value.real if m == 0 else np.sqrt(2) * (value.real if m > 0 else value.imag)


def places(height):
    return directions(np.arange(2 * height) + 0.5, (np.arange(height) + 0.5)[:, None], height)


def harmonics(height, degree=DEGREE):
    numbers = zip(degrees(degree), orders(degree), strict=True)
    return np.stack([harmonic(band, m, places(height)) for band, m in numbers], axis=-1)


def test_coefficients_are_integrals_over_texels():
    """Beside sums over 8 × 8 points in each texel."""
    fine = np.repeat(np.repeat(PIXELS, 8, axis=0), 8, axis=1)
    weighed = fine * solid_angles(128)[:, None, None]
    expected = np.tensordot(harmonics(128), weighed, ([0, 1], [0, 1]))
    np.testing.assert_allclose(projected(PIXELS), expected, atol=1e-3)


def test_light_of_few_harmonics_is_found_again_and_keeps_its_energy():
    random = np.random.default_rng(1)
    true = random.normal(size=(81, 3))
    light = harmonics(HEIGHT) @ true
    found = projected(light)
    np.testing.assert_allclose(found, true, atol=6e-3)
    energy = solid_angles(HEIGHT) @ (light**2).sum(axis=1)
    np.testing.assert_allclose((found**2).sum(axis=0), energy, rtol=3e-3)


@pytest.mark.parametrize("height", [2, 32, 128, 300])
def test_a_constant_has_the_first_coefficient_alone(height):
    found = projected(np.full((height, 2 * height, 3), [1.0, 2.0, 1e4]))
    np.testing.assert_allclose(found[0], np.array([1.0, 2.0, 1e4]) * np.sqrt(4 * np.pi), rtol=1e-6)
    assert not found[1:].any()


def test_no_light_has_no_coefficients():
    assert not projected(np.zeros((8, 16, 3))).any()
    assert negative_share(np.zeros((81, 3))) == 0


@pytest.mark.parametrize("columns", [1, 5, 8, 20])
def test_turning_is_that_of_panoramas(columns):
    angle = columns * np.pi / 16
    expected = projected(environments.turned(PIXELS, angle))
    np.testing.assert_allclose(turned(projected(PIXELS), angle), expected, atol=1e-5)


def test_a_whole_turn_gives_the_same_bits():
    panorama = Panorama.of("made", PIXELS)
    one, other = (coefficients_of(EnvironmentMap(panorama, angle)) for angle in (0.0, 2 * np.pi))
    np.testing.assert_array_equal(one, other)
    one, other = (coefficients_of(EnvironmentMap(panorama, angle)) for angle in (0.5, 0.5 + 8 * np.pi))
    np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)


def test_a_window_damps_high_degrees_and_rings_less():
    assert window(0.0, 8).tolist() == [1.0] * 81
    found = window(0.005, 8)
    assert found[0] == 1
    assert found[80] == pytest.approx(1 / (1 + 0.005 * 64 * 81))
    lamp = np.full((HEIGHT, 2 * HEIGHT, 3), 1e-3)
    lamp[40, 60] = 1e5
    shares = [
        negative_share(projected(lamp) * window(strength, 8)[:, None]) for strength in (0, 5e-4, 5e-3, 5e-2)
    ]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > 0.2
    assert shares[2] < shares[0] / 3


def test_negative_light_of_a_closed_form():
    """Of the cosine of the polar angle, half is negative; with a constant of 2 none is."""
    light = np.zeros((4, 1))
    light[2] = 1
    assert negative_share(light) == pytest.approx(0.5, abs=1e-6)
    light[0] = 4
    assert negative_share(light) == 0
