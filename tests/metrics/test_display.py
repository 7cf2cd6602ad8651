"""psnr, rmse_display, ssim and dssim against scikit-image and plain loops, and the properties that they must have."""

import itertools
import math

import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from gibench import metrics
from tests.metrics import plain

WANG = {
    "data_range": 1.0,
    "channel_axis": -1,
    "gaussian_weights": True,
    "sigma": 1.5,
    "use_sample_covariance": False,
}


def pairs():
    rng = np.random.default_rng(5)
    noise = rng.random((2, 40, 57, 3))
    steps = np.broadcast_to((np.arange(57) > 20)[None, :, None], (40, 57, 3)).astype(float)
    return {
        "noise": tuple(noise),
        "opposite": (steps, 1 - steps),
        "black and white": (np.zeros((13, 11, 3)), np.ones((13, 11, 3))),
        "constant": (np.full((20, 31, 3), 0.3), np.full((20, 31, 3), 0.7)),
        "almost equal": (noise[0] * 0.999, noise[0] * 0.999 + 1e-7),
        "near-black": (noise[0] * 1e-6, noise[1] * 1e-6),
        "odd size": (noise[0, :11, :13], noise[1, :11, :13]),
    }


@pytest.mark.parametrize("case", pairs())
def test_ssim_equals_scikit_image(case):
    pred, ref = pairs()[case]
    mean, full = structural_similarity(ref, pred, full=True, **WANG)
    assert metrics.ssim(pred, ref) == pytest.approx(mean, abs=1e-10)
    np.testing.assert_allclose(metrics.ssim(pred, ref, map=True), full.mean(axis=-1), atol=1e-10)


def test_ssim_equals_the_plain_loop(rng):
    ref, pred = rng.random((2, 15, 18, 3))
    assert metrics.ssim(pred, ref) == pytest.approx(plain.ssim(pred, ref), abs=1e-12)


@pytest.mark.parametrize("case", pairs())
def test_psnr_equals_scikit_image(case):
    pred, ref = pairs()[case]
    assert metrics.psnr(pred, ref) == pytest.approx(
        peak_signal_noise_ratio(ref, pred, data_range=1.0), rel=1e-10
    )


@pytest.mark.parametrize("case", pairs())
def test_rmse_display_equals_numpy(case, rng):
    pred, ref = pairs()[case]
    expected = np.sqrt(np.mean((pred - ref) ** 2))
    assert metrics.rmse_display(pred, ref) == pytest.approx(expected, rel=1e-10)
    mask = rng.random(ref.shape[:2]) < 0.5
    expected = np.sqrt(np.mean((pred - ref)[mask] ** 2))
    assert metrics.rmse_display(pred, ref, mask=mask) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("name", ["psnr", "rmse_display", "ssim", "dssim"])
@pytest.mark.parametrize("case", pairs())
def test_symmetric_in_range_and_exact_on_equal_images(name, case):
    metric = metrics.metric(name)
    pred, ref = pairs()[case]
    assert metric(pred, ref) == pytest.approx(metric(ref, pred), rel=1e-12)
    assert metric.range[0] <= metric(pred, ref) <= metric.range[1]
    assert metric(ref, ref) == metric.identity


@pytest.mark.parametrize("name", ["psnr", "rmse_display", "ssim", "dssim"])
def test_worse_with_more_noise(name, rng):
    metric = metrics.metric(name)
    ref = 0.25 + 0.5 * rng.random((40, 40, 3))
    noise = rng.uniform(-0.25, 0.25, ref.shape)
    values = [metric(ref + amount * noise, ref) for amount in (0, 0.01, 0.1, 0.5, 1)]
    assert all(metric.better(a, b) for a, b in itertools.pairwise(values))


@pytest.mark.parametrize("name", ["psnr", "rmse_display", "ssim", "dssim"])
def test_the_same_when_images_are_mirrored_or_transposed(name, rng):
    metric = metrics.metric(name)
    ref, pred = rng.random((2, 24, 31, 3))
    for change in (np.flipud, np.fliplr, lambda image: image.swapaxes(0, 1), lambda image: image[..., ::-1]):
        assert metric(change(pred), change(ref)) == pytest.approx(metric(pred, ref), rel=1e-12)


@pytest.mark.parametrize("name", ["psnr", "ssim", "dssim"])
def test_data_range_scales_out(name, rng):
    metric = metrics.metric(name)
    ref, pred = rng.random((2, 24, 31, 3))
    assert metric(255 * pred, 255 * ref, data_range=255.0) == pytest.approx(metric(pred, ref), rel=1e-10)


def test_ssim_of_float32_loses_less_than_1e_6(rng):
    # Bright and nearly constant: here variances computed in float32 would drown in rounding.
    ref = (0.9 + 1e-4 * rng.random((64, 64, 3))).astype(np.float32)
    pred = (0.9 + 1e-4 * rng.random((64, 64, 3))).astype(np.float32)
    exact = metrics.ssim(pred.astype(np.float64), ref.astype(np.float64))
    assert metrics.ssim(pred, ref) == pytest.approx(exact, abs=1e-12)
    assert exact == pytest.approx(
        structural_similarity(ref.astype(np.float64), pred.astype(np.float64), **WANG), abs=1e-10
    )


def test_ssim_mask_is_a_mean_of_the_map(rng):
    ref, pred = rng.random((2, 30, 40, 3))
    mask = rng.random((30, 40)) < 0.4
    shown = metrics.ssim(pred, ref, map=True, mask=mask)
    assert np.array_equal(np.isnan(shown), ~mask)
    inside = shown[5:-5, 5:-5]
    assert metrics.ssim(pred, ref, mask=mask) == pytest.approx(np.nanmean(inside), rel=1e-12)
    assert metrics.ssim(pred, ref, mask=np.ones((30, 40), bool)) == metrics.ssim(pred, ref)


def test_ssim_mask_at_the_border_only_is_empty(rng):
    ref, pred = rng.random((2, 30, 40, 3))
    mask = np.zeros((30, 40), bool)
    mask[:5] = True
    with pytest.warns(metrics.EmptyMaskWarning):
        assert math.isnan(metrics.ssim(pred, ref, mask=mask))


@pytest.mark.parametrize("shape", [(1, 1, 3), (10, 200, 3), (200, 10, 3)])
def test_ssim_refuses_images_that_no_window_fits_in(shape):
    image = np.zeros(shape)
    with pytest.raises(metrics.ImageTooSmallError, match=f"11×11 pixels.*{shape[0]}×{shape[1]}"):
        metrics.ssim(image, image)


def test_psnr_of_one_pixel():
    assert metrics.psnr(np.full((1, 1, 3), 0.5), np.full((1, 1, 3), 0.6)) == pytest.approx(20.0)


@pytest.mark.parametrize("name", ["psnr", "rmse_display", "ssim", "dssim"])
def test_batch_equals_its_frames(name, rng):
    metric = metrics.metric(name)
    ref, pred = rng.random((2, 3, 20, 17, 3))
    assert metric(pred, ref).tolist() == [metric(p, r) for p, r in zip(pred, ref, strict=True)]
