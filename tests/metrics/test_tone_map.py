"""Exposure from the reference, and the curve exposure → clip → sRGB."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gibench import metrics
from gibench.metrics.tone_map import LUMINANCE, linear_from_srgb, srgb_from_linear


def srgb(value):
    """IEC 61966-2-1, one number at a time."""
    return 12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055


@settings(max_examples=60, deadline=None)
@given(value=st.floats(0, 1e6), exposure=st.floats(1e-6, 1e6))
def test_curve(value, exposure):
    shown = metrics.tone_map(np.full((1, 1, 3), value), exposure)
    assert shown == pytest.approx(srgb(min(value * exposure, 1.0)), abs=1e-12)


def test_curve_is_inverted():
    linear = np.linspace(0, 1, 5001)
    np.testing.assert_allclose(linear_from_srgb(srgb_from_linear(linear)), linear, atol=2e-8)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_white_and_brighter_is_exactly_one(dtype):
    shown = metrics.tone_map(np.array([[[1, 7, 3e38]]], dtype), 1.0)
    assert shown.dtype == dtype
    assert (shown == 1).all()


def test_nothing_is_rounded_to_8_bits():
    shown = metrics.tone_map(np.linspace(0, 1, 30000).reshape(100, 100, 3), 1.0)
    assert len(np.unique(shown)) == 30000


def test_rises_with_radiance():
    # Across the seam of the two pieces as well.
    shown = srgb_from_linear(np.linspace(0.0031, 0.0032, 10001))
    assert (np.diff(shown) > 0).all()


@settings(max_examples=30, deadline=None)
@given(scale=st.floats(1e-6, 1e6))
def test_exposure_undoes_the_scale_of_the_scene(scale):
    ref = np.random.default_rng(1).gamma(0.5, 2.0, (20, 21, 3))
    exposure = metrics.reference_exposure(ref * scale)
    assert exposure * scale == pytest.approx(metrics.reference_exposure(ref), rel=1e-9)
    assert np.median(ref * scale @ LUMINANCE) * exposure == pytest.approx(0.18)


def test_a_lamp_in_view_does_not_darken_the_room(rng):
    ref = rng.gamma(0.5, 2.0, (40, 40, 3))
    lamp = ref.copy()
    lamp[:4, :4] = 1e5
    assert metrics.reference_exposure(lamp) == pytest.approx(metrics.reference_exposure(ref), rel=0.05)


def test_unlit_pixels_do_not_count(rng):
    lit = rng.gamma(0.5, 2.0, (10, 20, 3)) + 1e-3
    mostly_black = np.concatenate([lit, np.zeros((90, 20, 3))])
    assert metrics.reference_exposure(mostly_black) == metrics.reference_exposure(lit)


@pytest.mark.parametrize("value", [0.0, 1e-320])
def test_black_reference_has_exposure_one(value):
    assert metrics.reference_exposure(np.full((3, 3, 3), value)) == 1.0


def test_exposure_of_a_batch_is_per_frame_or_shared(rng):
    ref = rng.gamma(0.5, 2.0, (3, 10, 11, 3)) * np.array([1, 10, 100])[:, None, None, None]
    each = metrics.reference_exposure(ref)
    assert each.tolist() == [metrics.reference_exposure(frame) for frame in ref]
    assert metrics.reference_exposure(ref, shared=True) == metrics.reference_exposure(ref.reshape(30, 11, 3))
    shown = metrics.tone_map(ref, each)
    assert np.array_equal(shown[1], metrics.tone_map(ref[1], each[1]))


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_impossible_exposures(bad):
    with pytest.raises(metrics.RangeError, match="exposure"):
        metrics.tone_map(np.zeros((2, 2, 3)), bad)


@pytest.mark.parametrize("exposure", [[1.0, 2.0], [[1.0]]])
def test_exposures_of_another_shape(exposure):
    with pytest.raises(metrics.ShapeError, match="exposure"):
        metrics.tone_map(np.zeros((3, 2, 2, 3)), exposure)


def test_radiance_that_is_none():
    with pytest.raises(metrics.NonFiniteError):
        metrics.reference_exposure(np.full((2, 2, 3), np.nan))
    with pytest.raises(metrics.RangeError):
        metrics.tone_map(np.full((2, 2, 3), -1.0), 1.0)
    with pytest.raises(metrics.ShapeError):
        metrics.tone_map(np.zeros((2, 2)), 1.0)
