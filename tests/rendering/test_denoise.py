"""Denoising."""

from __future__ import annotations

import numpy as np

from gibench.rendering import denoise
from gibench.rendering.channels import PARTS
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict

from . import scenes


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
