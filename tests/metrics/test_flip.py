"""FLIP and HDR-FLIP against NVIDIA's own program and against a plain version without separated filters."""

import math

import numpy as np
import pytest

from gibench import metrics
from gibench.metrics.flip import PIXELS_PER_DEGREE
from gibench.metrics.hdrflip import aces, exposure_range
from gibench.metrics.tone_map import linear_from_srgb
from tests.metrics import plain

# NVIDIA's program computes in float32. On textured images that costs it about 3e-6; on flat ones the rounding of
# its edge filter passes through a square root, √1e-8, and costs 1e-4.
TEXTURED, FLAT = 5e-6, 2e-4


def display_pairs():
    rng = np.random.default_rng(11)
    noise = rng.random((2, 61, 40, 3))
    grey = np.full((30, 41, 3), 0.5)
    spot = grey.copy()
    spot[15, 20] = 1
    return {
        "noise": (*noise, TEXTURED),
        "colour noise": (
            noise[0],
            np.clip(noise[0] + 0.1 * rng.standard_normal(noise[0].shape), 0, 1),
            TEXTURED,
        ),
        "grey noise": (grey, np.clip(grey + 0.05 * rng.standard_normal((30, 41, 1)), 0, 1), 2e-5),
        "black and white": (np.zeros((20, 20, 3)), np.ones((20, 20, 3)), FLAT),
        "green and blue": (np.full((9, 9, 3), [0.0, 1.0, 0.0]), np.full((9, 9, 3), [0.0, 0.0, 1.0]), FLAT),
        "spot": (spot, grey, FLAT),
        "one pixel": (noise[0, :1, :1], noise[1, :1, :1], FLAT),
        "odd size": (noise[0, :13, :7], noise[1, :13, :7], TEXTURED),
    }


def radiance_pairs():
    rng = np.random.default_rng(12)
    ref = rng.gamma(0.5, 2.0, (40, 31, 3))
    lamp = ref.copy()
    lamp[10:13, 10:13] = 1e4
    return {
        "noise": (ref * np.exp(0.3 * rng.standard_normal(ref.shape)), ref),
        "lamp": (lamp * np.exp(0.1 * rng.standard_normal(ref.shape)), lamp),
        "dim": (ref * 1.2e-3, ref * 1e-3),
        "odd size": (ref[:7, :13], ref[:7, :13] * 1.3),
    }


def nvidia(pred, ref, mode, **parameters):
    evaluator = pytest.importorskip("flip_evaluator", reason="flip-evaluator comes with gibench[bench]")
    images = (np.ascontiguousarray(image, dtype=np.float32) for image in (ref, pred))
    error, _, used = evaluator.evaluate(*images, mode, applyMagma=False, parameters=parameters)
    return error[..., 0], used


@pytest.mark.parametrize("case", display_pairs())
def test_flip_equals_nvidias(case):
    pred, ref, tolerance = display_pairs()[case]
    theirs, _ = nvidia(pred, ref, "LDR")
    ours = metrics.flip(pred, ref, map=True)
    np.testing.assert_allclose(ours, theirs, atol=tolerance)
    assert metrics.flip(pred, ref) == pytest.approx(float(theirs.mean()), abs=tolerance)


def test_flip_equals_nvidias_at_another_distance():
    pred, ref, tolerance = display_pairs()["noise"]
    theirs, _ = nvidia(pred, ref, "LDR", ppd=32.5)
    np.testing.assert_allclose(
        metrics.flip(pred, ref, pixels_per_degree=32.5, map=True), theirs, atol=tolerance
    )


@pytest.mark.parametrize("case", radiance_pairs())
def test_hdrflip_and_its_exposures_equal_nvidias(case):
    pred, ref = radiance_pairs()[case]
    theirs, used = nvidia(pred, ref, "HDR")
    ours = exposure_range(ref)
    assert (ours.start, ours.stop) == pytest.approx((used["startExposure"], used["stopExposure"]), abs=1e-5)
    assert ours.count == used["numExposures"]
    np.testing.assert_allclose(metrics.hdrflip(pred, ref, map=True), theirs, atol=FLAT)
    assert metrics.hdrflip(pred, ref) == pytest.approx(float(theirs.mean()), abs=1e-5)


@pytest.mark.parametrize(
    "case", ["colour noise", "grey noise", "green and blue", "spot", "one pixel", "odd size"]
)
def test_flip_equals_the_plain_version(case):
    pred, ref, _ = display_pairs()[case]
    expected = plain.flip_map(linear_from_srgb(pred), linear_from_srgb(ref))
    # Where both features are equal in truth, the square root turns the last bit of float64 into 1e-8.
    np.testing.assert_allclose(metrics.flip(pred, ref, map=True), expected, atol=1e-7)


def test_hdrflip_equals_the_plain_version():
    pred, ref = (image[:16, :17] for image in radiance_pairs()["noise"])
    stops = exposure_range(ref)
    expected = np.max(
        [
            plain.flip_map(aces(pred, stop), aces(ref, stop))
            for stop in np.linspace(stops.start, stops.stop, stops.count)
        ],
        axis=0,
    )
    np.testing.assert_allclose(metrics.hdrflip(pred, ref, map=True), expected, atol=1e-7)


def test_images_taller_than_a_tile_have_no_seam(rng):
    ref, pred = rng.random((2, 150, 20, 3))
    whole = metrics.flip(pred, ref, map=True)
    part = metrics.flip(pred[40:140], ref[40:140], map=True)
    np.testing.assert_allclose(whole[55:125], part[15:85], atol=1e-9)


@pytest.mark.parametrize("name", ["flip", "hdrflip"])
def test_zero_for_equal_images_symmetric_and_in_range(name, rng):
    metric = metrics.metric(name)
    ref, pred = rng.random((2, 20, 21, 3))
    assert metric(ref, ref) == 0
    assert 0 < metric(pred, ref) <= 1
    if name == "flip":  # HDR-FLIP takes its exposures from one of the two
        assert metric(pred, ref) == metric(ref, pred)


@pytest.mark.parametrize("name", ["flip", "hdrflip"])
def test_grows_with_noise(name, rng):
    ref = 0.25 + 0.5 * rng.random((30, 30, 3))
    noise = rng.uniform(-0.25, 0.25, ref.shape)
    values = [metrics.metric(name)(ref + amount * noise, ref) for amount in (0, 0.03, 0.1, 0.3, 1)]
    assert values == sorted(values)
    assert values[0] == 0 < values[1]


def test_hdrflip_does_not_see_a_common_scale(rng):
    ref, pred = rng.gamma(0.5, 2.0, (2, 20, 21, 3))
    assert metrics.hdrflip(pred * 1e-5, ref * 1e-5) == pytest.approx(metrics.hdrflip(pred, ref), rel=1e-9)


def test_black_reference():
    # NVIDIA's program ends the process here.
    black = np.zeros((5, 6, 3))
    assert exposure_range(black).count == 1
    assert metrics.hdrflip(black, black) == 0
    assert 0 < metrics.hdrflip(black + 1.0, black) <= 1


def test_half_black_reference_has_finite_exposures():
    ref = np.zeros((8, 8, 3))
    ref[:3] = 2.0
    stops = exposure_range(ref)
    assert math.isfinite(stops.stop)
    assert stops.start <= stops.stop
    assert 0 < metrics.hdrflip(ref * 0.5, ref) < 1


def test_extreme_range_of_radiance(rng):
    ref = 10 ** rng.uniform(-8, 6, (9, 9, 3))
    assert 0 < metrics.hdrflip(ref * 1.1, ref) < 1


@pytest.mark.parametrize("name", ["flip", "hdrflip"])
def test_mask_is_a_mean_of_the_map(name, rng):
    metric = metrics.metric(name)
    ref, pred = rng.random((2, 2, 20, 21, 3))
    mask = rng.random((2, 20, 21)) < 0.4
    shown = metric(pred, ref, map=True, mask=mask)
    assert np.array_equal(np.isnan(shown), ~mask)
    np.testing.assert_allclose(metric(pred, ref, mask=mask), np.nanmean(shown, axis=(1, 2)), rtol=1e-12)


@pytest.mark.parametrize("bad", [0.0, 0.5, -1.0, math.nan, math.inf])
def test_impossible_resolution(bad):
    image = np.zeros((4, 4, 3))
    with pytest.raises(metrics.RangeError, match="pixels_per_degree"):
        metrics.flip(image, image, pixels_per_degree=bad)


def test_coarsest_resolution(rng):
    ref, pred = rng.random((2, 9, 8, 3))
    assert 0 < metrics.flip(pred, ref, pixels_per_degree=1) < 1


def test_default_resolution_is_that_of_the_paper():
    assert pytest.approx(67.0206, abs=1e-4) == PIXELS_PER_DEGREE
