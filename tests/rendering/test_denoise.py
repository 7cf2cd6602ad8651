"""Denoising."""

from __future__ import annotations

import os

import numpy as np
import pytest

from gibench.rendering import denoise
from gibench.rendering.backend import is_scalar, limit_threads
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


@pytest.mark.parametrize("spread", [0.5, 3.0])
def test_denoising_does_not_depend_on_the_number_of_threads(spread):
    if is_scalar():
        pytest.skip("Dr.Jit has no threads to limit")
    image = np.random.default_rng(0).lognormal(sigma=spread, size=(96, 128, 3)).astype(np.float32)
    results = []
    for threads in (1, 2, 3):
        limit_threads(threads)
        results.append(denoise.denoise(image))
    limit_threads(os.cpu_count() or 1)
    for result in results[1:]:
        np.testing.assert_array_equal(results[0], result)


@pytest.mark.parametrize("level", [1e-8, 1.0, 1e6])
def test_denoising_is_blind_to_the_unit_of_radiance(level):
    image = np.random.default_rng(1).exponential(size=(48, 64, 3)).astype(np.float32)
    np.testing.assert_allclose(
        denoise.denoise(image * np.float32(level)) / level, denoise.denoise(image), rtol=1e-3
    )
