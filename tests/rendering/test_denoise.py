"""Denoising."""

from __future__ import annotations

import os

import mitsuba as mi
import numpy as np
import pytest
from scipy.ndimage import uniform_filter

from gibench.rendering import denoise
from gibench.rendering.backend import is_scalar, limit_threads
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.channels import PARTS, SAMPLED
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from gibench.stress.scenes import area, diffuse, rectangle, small_room

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


def _detail(image):
    """What differs from the mean of the 7 × 7 pixels around, in units of the image's mean."""
    image = image / image.mean()
    return (image - uniform_filter(image, (7, 7, 0))).ravel()


@pytest.mark.parametrize("spp", [4, 16])
def test_textures_are_not_blurred(spp):
    """Tiles of some two pixels under a lamp that shines at the ceiling.

    Without albedo to guide it the denoiser keeps .2 of their contrast at 4 samples and .5 at 16.
    """
    tiles = np.random.default_rng(0).uniform(0.2, 0.8, (24, 24, 1)) * [1.0, 0.8, 0.6]
    texture = {"type": "bitmap", "bitmap": mi.Bitmap(tiles.astype(np.float32)), "raw": True}
    floor = {"type": "diffuse", "reflectance": {**texture, "filter_type": "nearest"}}
    room = small_room(glossy=False)
    room["floor"]["bsdf"] = floor
    room["lamp"] = rectangle([0, 0, 1.4], [0, 0, 1], (0.25, 0.25), bsdf=diffuse(0.5), emitter=area(8))
    scene, camera = load_dict(room), PinholeCamera((0.0, 0.0, 1.3), (0.01, 0.0, 0.0), 1.0)
    options = {"resolution": (64, 64), "channels": ["color"], "max_depth": 8}
    truth = _detail(render_frame(scene, camera, spp=4096, seed=1, **options).arrays["color"])
    clean = _detail(render_frame(scene, camera, spp=spp, seed=2, denoise=True, **options).arrays["color"])
    assert clean @ truth > 0.9 * (truth @ truth)
    assert np.corrcoef(clean, truth)[0, 1] > 0.85


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


def speckled(seed: int = 3) -> np.ndarray:
    """A part that is mostly dust, with a small coloured highlight and a few stray samples."""
    rng = np.random.default_rng(seed)
    image = rng.exponential(1e-4, (96, 128, 3)).astype(np.float32)
    image[40:44, 60:66] += rng.uniform(2, 4, (4, 6, 1)).astype(np.float32) * np.float32([1, 0.7, 0.3])
    stray = rng.random((96, 128)) < 0.002
    image[stray] += np.float32(0.3)
    return image


@pytest.mark.parametrize("level", [1e-30, 1.0, 1e6])
def test_every_part_keeps_its_mean(level):
    """The network alone brightens such a highlight by a fifth."""
    image = speckled() * np.float32(level)
    raw = image.mean((0, 1), dtype=np.float64)
    clean = denoise.denoise_part(image)
    np.testing.assert_allclose(clean.mean((0, 1), dtype=np.float64) / raw, 1, atol=0.03)
    assert abs(denoise.mean_change(clean, image)) <= denoise.ALLOWED_CHANGE
    rough = denoise.denoise(image).mean((0, 1), dtype=np.float64)
    assert np.abs(rough / raw - 1).max() > denoise.ALLOWED_CHANGE


def test_what_is_mended_is_the_brightness_that_is_wrong():
    """A highlight that came back too bright and green is mended; what lies around it stays as it was."""
    rng = np.random.default_rng(4)
    truth = np.full((64, 64, 3), 0.02, dtype=np.float32)
    truth[20:30, 20:40] = (3.0, 2.0, 1.0)
    samples = truth * rng.gamma(16, 1 / 16, (64, 64, 1)).astype(np.float32)
    clean = truth.copy()
    clean[20:30, 20:40] *= np.float32([1.1, 1.5, 1.2])
    mended = denoise.balanced(clean, samples)
    np.testing.assert_allclose(mended[20:30, 20:40].mean((0, 1)), (3, 2, 1), rtol=0.04)
    np.testing.assert_allclose(mended[50:], truth[50:], rtol=0.03)


def test_a_mean_that_is_nearly_right_is_left_alone():
    image = np.random.default_rng(5).exponential(size=(48, 64, 3)).astype(np.float32)
    clean = np.full_like(image, image.mean())
    np.testing.assert_array_equal(denoise.balanced(clean, image), np.minimum(clean, clean.max()))


def test_the_change_is_that_of_the_channel_that_changed_most():
    samples = np.ones((4, 4, 3), dtype=np.float32)
    clean = samples * np.float32([1.0, 0.9, 1.05])
    assert denoise.mean_change(clean, samples) == pytest.approx(-0.1)
    assert denoise.mean_change(0 * samples, 0 * samples) == 0


def test_the_change_of_a_part_that_nobody_sees_is_none():
    dust = np.full((4, 4, 3), 1e-12, dtype=np.float32)
    assert denoise.mean_change(2 * dust, dust, whole=1.0) == 0
    assert denoise.mean_change(2 * dust, dust, whole=1e-9) == pytest.approx(1)


def test_a_frame_says_how_much_denoising_changed():
    scene = load_dict(scenes.box("coat"))
    options = {"resolution": (48, 48), "channels": ["radiance"], "max_depth": 4, "spp": 8, "seed": 2}
    raw = render_frame(scene, scenes.CAMERA, **options)
    clean = render_frame(scene, scenes.CAMERA, denoise=True, **options)
    assert raw.denoise_change == 0
    changes = [denoise.mean_change(clean.arrays[n], raw.arrays[n]) for n in PARTS if n != "emission"]
    assert clean.denoise_change == max(changes, key=abs)
    assert abs(clean.denoise_change) <= denoise.ALLOWED_CHANGE


def test_the_samples_of_a_frame_stay_beside_its_denoised_parts():
    """They are those of the frame that is not denoised, bit by bit, and take no paths of their own."""
    options = {"resolution": (24, 16), "spp": 16, "seed": 3}
    scene = load_dict(scenes.box("coat"))
    raw = render_frame(scene, scenes.CAMERA, channels=["radiance"], **options)
    both = render_frame(scene, scenes.CAMERA, channels=["radiance", "samples"], denoise=True, **options)
    assert both.paths == raw.paths
    for name, part in SAMPLED.items():
        np.testing.assert_array_equal(both.arrays[name], raw.arrays[part])
        assert (both.arrays[part] != raw.arrays[part]).any() or not raw.arrays[part].any()
    alone = render_frame(scene, scenes.CAMERA, channels=["samples"], **options)
    assert list(alone.arrays) == list(SAMPLED)
