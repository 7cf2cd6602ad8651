"""mse, rmse, mae, relmse and smape against plain loops, and the properties that they must have."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gibench import metrics
from tests.metrics.plain import LINEAR

RADIANCE = st.one_of(st.just(0.0), st.floats(1e-8, 1e6))


@st.composite
def image_pairs(draw):
    shape = (draw(st.integers(1, 7)), draw(st.integers(1, 7)), 3)
    return tuple(draw(arrays(np.float64, shape, elements=RADIANCE)) for _ in range(2))


@pytest.mark.parametrize("name", LINEAR)
@settings(max_examples=40, deadline=None)
@given(pair=image_pairs())
def test_equals_the_plain_loop(name, pair):
    assert metrics.metric(name)(*pair) == pytest.approx(LINEAR[name](*pair), rel=1e-12, abs=1e-300)


@pytest.mark.parametrize("name", LINEAR)
@settings(max_examples=40, deadline=None)
@given(pair=image_pairs())
def test_stays_in_range_and_is_zero_only_for_equal_images(name, pair):
    metric = metrics.metric(name)
    low, high = metric.range
    assert low <= metric(*pair) <= high
    assert metric(pair[0], pair[0]) == 0
    assert (metric(*pair) == 0) == np.array_equal(*pair)


@pytest.mark.parametrize("name", ["mse", "rmse", "mae", "smape"])
@settings(max_examples=40, deadline=None)
@given(pair=image_pairs())
def test_symmetric(name, pair):
    metric = metrics.metric(name)
    assert metric(*pair) == metric(*pair[::-1])


@pytest.mark.parametrize("name", LINEAR)
@settings(max_examples=30, deadline=None)
@given(pair=image_pairs(), seed=st.integers(0, 99))
def test_order_of_pixels_and_channels_does_not_matter(name, pair, seed):
    metric = metrics.metric(name)
    order = np.random.default_rng(seed).permutation(pair[0].size)
    shuffled = (image.ravel()[order].reshape(image.shape) for image in pair)
    assert metric(*shuffled) == pytest.approx(metric(*pair), rel=1e-12)


@pytest.mark.parametrize(("name", "power"), [("mse", 2), ("rmse", 1), ("mae", 1)])
@settings(max_examples=30, deadline=None)
@given(pair=image_pairs(), scale=st.floats(1e-3, 1e3))
def test_scales_with_radiance(name, power, pair, scale):
    metric = metrics.metric(name)
    scaled = metric(*(image * scale for image in pair))
    assert scaled == pytest.approx(metric(*pair) * scale**power, rel=1e-9, abs=1e-30)


def test_relmse_asks_which_image_is_the_reference():
    dark, bright = np.full((4, 4, 3), 1.0), np.full((4, 4, 3), 2.0)
    assert metrics.relmse(dark, bright) == pytest.approx(1 / 4.01)
    assert metrics.relmse(bright, dark) == pytest.approx(1 / 1.01)


@pytest.mark.parametrize("name", LINEAR)
def test_grows_with_noise(name, rng):
    ref = rng.gamma(0.5, 2.0, (32, 32, 3))
    noise = rng.random(ref.shape)
    values = [metrics.metric(name)(ref + amount * noise, ref) for amount in (0, 0.01, 0.1, 1, 10)]
    assert values == sorted(values)
    assert len(set(values)) == len(values)


@pytest.mark.parametrize("name", LINEAR)
def test_float32_loses_less_than_1e_6(name, rng):
    # 1e-8 to 1e6 in one image, of a size at which sums in float32 would drift.
    ref = (10 ** rng.uniform(-8, 6, (300, 401, 3))).astype(np.float32)
    pred = (ref * rng.uniform(0.9, 1.1, ref.shape)).astype(np.float32)
    exact = LINEAR[name](pred, ref)
    assert metrics.metric(name)(pred, ref) == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("name", LINEAR)
def test_huge_float32_values_do_not_overflow(name):
    ref, pred = (np.full((2, 2, 3), value, dtype=np.float32) for value in (1e30, 2e30))
    assert math.isfinite(metrics.metric(name)(pred, ref))


@pytest.mark.parametrize("name", LINEAR)
def test_float16_is_computed_as_float32(name, rng):
    ref, pred = (rng.uniform(0, 6e4, (9, 8, 3)).astype(np.float16) for _ in range(2))
    expected = metrics.metric(name)(pred.astype(np.float32), ref.astype(np.float32))
    assert metrics.metric(name)(pred, ref) == expected
    assert math.isfinite(expected)


@pytest.mark.parametrize("name", ["mse", "mae", "relmse", "smape"])
def test_map_averages_to_the_metric(name, rng):
    metric = metrics.metric(name)
    ref, pred = rng.gamma(0.5, 2.0, (2, 3, 120, 133, 3))
    maps = metric(pred, ref, map=True)
    assert maps.shape == (3, 120, 133)
    np.testing.assert_allclose(maps.mean(axis=(1, 2)), metric(pred, ref), rtol=1e-12)
    expected = LINEAR[name](pred[1, 7, 5], ref[1, 7, 5])
    assert maps[1, 7, 5] == pytest.approx(expected, rel=1e-12)


def test_squared_map_of_rmse_averages_to_its_square(rng):
    ref, pred = rng.gamma(0.5, 2.0, (2, 20, 13, 3))
    assert (metrics.rmse(pred, ref, map=True) ** 2).mean() == pytest.approx(metrics.mse(pred, ref), rel=1e-12)


@pytest.mark.parametrize("name", LINEAR)
def test_mask_counts_only_its_pixels(name, rng):
    metric = metrics.metric(name)
    ref, pred = rng.gamma(0.5, 2.0, (2, 20, 13, 3))
    mask = rng.random((20, 13)) < 0.3
    assert metric(pred, ref, mask=mask) == pytest.approx(LINEAR[name](pred[mask], ref[mask]), rel=1e-12)
    shown = metric(pred, ref, mask=mask, map=True)
    assert np.array_equal(np.isnan(shown), ~mask)
    assert np.array_equal(shown[mask], metric(pred, ref, map=True)[mask])


@pytest.mark.parametrize("name", LINEAR)
def test_batch_equals_its_frames(name, rng):
    metric = metrics.metric(name)
    ref, pred = rng.gamma(0.5, 2.0, (2, 4, 6, 5, 3))
    mask = rng.random((4, 6, 5)) < 0.7
    together = metric(pred, ref, mask=mask)
    assert together.shape == (4,)
    assert together.tolist() == [metric(p, r, mask=m) for p, r, m in zip(pred, ref, mask, strict=True)]
