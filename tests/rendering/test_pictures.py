"""Tone mapping and denoising."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.rendering import denoise, tonemap
from gibench.rendering.channels import PARTS
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict

from . import scenes


@pytest.mark.parametrize("level", [1e-8, 1.0, 1e6])
def test_exposure_puts_a_grey_image_at_middle_grey(level):
    exposure = tonemap.auto_exposure(np.full((4, 5, 3), level))
    assert level * exposure == pytest.approx(tonemap.MIDDLE_GREY)


def test_exposure_of_black_and_of_broken_images_is_finite():
    assert tonemap.auto_exposure(np.zeros((3, 3, 3))) == 1.0
    image = np.full((2, 2, 3), 0.5)
    image[0, 0] = np.inf
    assert tonemap.auto_exposure(image) == pytest.approx(tonemap.MIDDLE_GREY / 0.5)
    assert np.isfinite(tonemap.auto_exposure(np.full((2, 2, 3), 1e-200)))


def test_srgb_known_values():
    """IEC 61966-2-1: the two branches meet, 0 and 1 are fixed, 18 % grey is code 118 of 255."""
    np.testing.assert_allclose(tonemap.srgb_encode([0.0, 1.0]), [0, 1], atol=1e-7)
    assert round(255 * float(tonemap.srgb_encode(0.18))) == 118
    below, above = tonemap.srgb_encode(np.array([0.0031307, 0.0031309]))
    assert abs(above - below) < 1e-5
    assert tonemap.display(np.array([1e9, 0.5, 0.0]), 1.0).max() == 1.0


def test_denoising_reduces_the_error_and_keeps_the_sum():
    scene = load_dict(scenes.box("coat"))
    options = {"resolution": (64, 64), "channels": ["radiance"], "max_depth": 6}
    reference = render_frame(scene, scenes.CAMERA, spp=1024, seed=1, **options).arrays
    noisy = render_frame(scene, scenes.CAMERA, spp=16, seed=2, **options).arrays
    clean = render_frame(scene, scenes.CAMERA, spp=16, seed=2, denoise=True, **options).arrays

    def relmse(image):
        return float(np.mean((image - reference["color"]) ** 2 / (reference["color"] ** 2 + 0.01)))

    assert relmse(clean["color"]) < 0.5 * relmse(noisy["color"])
    np.testing.assert_array_equal(sum((clean[n] for n in PARTS[1:]), clean[PARTS[0]]), clean["color"])
    np.testing.assert_array_equal(clean["color_se"], noisy["color_se"])
    np.testing.assert_array_equal(clean["emission"], noisy["emission"])
    assert min(clean[name].min() for name in PARTS) >= 0


def test_a_black_part_stays_exactly_black():
    black = np.zeros((16, 16, 3), dtype=np.float32)
    assert not denoise.denoise(black).any()


def test_denoising_is_reproducible():
    image = np.random.default_rng(0).exponential(size=(40, 56, 3)).astype(np.float32)
    np.testing.assert_array_equal(denoise.denoise(image), denoise.denoise(image.copy()))
