"""What no metric may let pass, and the hard cases that every metric must survive."""

import math

import numpy as np
import pytest

from gibench import metrics

IMAGE = [name for name, metric in metrics.METRICS.items() if metric.inputs == "image"]
FAST = [name for name in IMAGE if not name.startswith("lpips")]
LINEAR = [name for name in FAST if metrics.METRICS[name].values == "linear"]
DISPLAY = [name for name in IMAGE if metrics.METRICS[name].values == "display"]
MASKED = [name for name in IMAGE if metrics.METRICS[name].accepts("mask")]
GOOD = np.full((40, 41, 3), 0.5)


@pytest.mark.parametrize("name", IMAGE)
@pytest.mark.parametrize("side", ["pred", "ref"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_non_finite_says_where_and_how_many(name, side, bad):
    image = GOOD.copy()
    image[7, 3, 2] = image[9, 0, 0] = bad
    arguments = {"pred": GOOD, "ref": GOOD, side: image}
    kind = "2 NaN, 0 infinite" if np.isnan(bad) else "0 NaN, 2 infinite"
    with pytest.raises(metrics.NonFiniteError, match=f"{side} has 2 .*{kind}.*row 7, column 3, channel 2"):
        metrics.metric(name)(**arguments)


def test_non_finite_names_the_frame_of_a_batch():
    batch = np.zeros((3, 4, 5, 3))
    batch[2, 1, 4, 0] = np.nan
    with pytest.raises(metrics.NonFiniteError, match="frame 2, row 1, column 4, channel 0"):
        metrics.mse(np.zeros_like(batch), batch)


@pytest.mark.parametrize("name", DISPLAY)
@pytest.mark.parametrize(
    ("bad", "shown"), [(1.0001, "highest 1.0001"), (-0.25, "lowest -0.25"), (200.0, "200")]
)
def test_display_metrics_refuse_other_ranges(name, bad, shown):
    image = GOOD.copy()
    image[7, 3, 2] = bad
    with pytest.raises(metrics.RangeError, match=rf"1 value outside \[0, 1\].*{shown}.*row 7.*tone_map"):
        metrics.metric(name)(image, GOOD)


@pytest.mark.parametrize("name", LINEAR)
def test_linear_metrics_refuse_negative_radiance(name):
    image = GOOD.copy()
    image[0, 1, 2] = -1e-9
    with pytest.raises(metrics.RangeError, match="row 0, column 1, channel 2"):
        metrics.metric(name)(image, GOOD)


@pytest.mark.parametrize("name", IMAGE)
@pytest.mark.parametrize(
    ("pred", "ref"),
    [
        (GOOD, GOOD[:-1]),
        (GOOD, GOOD[None]),
        (GOOD[..., :1], GOOD[..., :1]),
        (np.zeros((40, 41, 4)), np.zeros((40, 41, 4))),
        (GOOD[..., 0], GOOD[..., 0]),
        (GOOD[:0], GOOD[:0]),
        (GOOD[None][:0], GOOD[None][:0]),
        (GOOD[None, None], GOOD[None, None]),
    ],
    ids=["height", "batch", "one channel", "four channels", "flat", "empty", "no frames", "5-D"],
)
def test_shapes_that_are_no_images(name, pred, ref):
    with pytest.raises(metrics.ShapeError, match=r"\("):
        metrics.metric(name)(pred, ref)


@pytest.mark.parametrize("name", IMAGE)
@pytest.mark.parametrize("dtype", [np.uint8, np.int64, np.bool_, np.complex128, object])
def test_types_that_carry_no_range(name, dtype):
    with pytest.raises(metrics.DtypeError, match="must be float"):
        metrics.metric(name)(GOOD.astype(dtype), GOOD)


@pytest.mark.parametrize("name", MASKED)
def test_empty_mask_is_nan_with_a_warning(name):
    with pytest.warns(metrics.EmptyMaskWarning, match="NaN"):
        assert math.isnan(metrics.metric(name)(GOOD, GOOD, mask=np.zeros(GOOD.shape[:2], bool)))


@pytest.mark.parametrize("name", MASKED)
def test_empty_mask_of_one_frame_leaves_the_others(name, rng):
    ref, pred = rng.random((2, 2, 20, 20, 3))
    mask = np.stack([np.zeros((20, 20), bool), np.ones((20, 20), bool)])
    with pytest.warns(metrics.EmptyMaskWarning):
        values = metrics.metric(name)(pred, ref, mask=mask)
    assert math.isnan(values[0])
    assert values[1] == metrics.metric(name)(pred[1], ref[1])


@pytest.mark.parametrize("name", MASKED)
def test_masks_of_another_shape_or_type(name):
    with pytest.raises(metrics.ShapeError, match="mask has shape"):
        metrics.metric(name)(GOOD, GOOD, mask=np.ones((3, 3), bool))
    with pytest.raises(metrics.DtypeError, match="mask must be boolean"):
        metrics.metric(name)(GOOD, GOOD, mask=np.ones(GOOD.shape[:2]))


@pytest.mark.parametrize("name", FAST)
@pytest.mark.parametrize("value", [0.0, 1e-8, 0.5, 1.0])
def test_equal_constant_images(name, value):
    image = np.full((17, 23, 3), value)
    assert metrics.metric(name)(image, image) == metrics.METRICS[name].identity


@pytest.mark.parametrize("name", FAST)
def test_black_reference_gives_a_finite_error(name, rng):
    metric = metrics.metric(name)
    value = metric(rng.random((17, 23, 3)), np.zeros((17, 23, 3)))
    assert math.isfinite(value)
    assert metric.better(metric.identity, value)


@pytest.mark.parametrize("name", LINEAR)
def test_fourteen_decades_in_one_image(name, rng):
    ref = 10 ** rng.uniform(-8, 6, (15, 13, 3))
    values = [metrics.metric(name)(ref * scale, ref) for scale in (1.0, 1.01, 1.5)]
    assert values == sorted(values)
    assert values[0] == 0
    assert all(map(math.isfinite, values))


@pytest.mark.parametrize("name", [name for name in FAST if "ssim" not in name])
@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 7, 3), (5, 1, 3), (3, 3, 3)])
def test_tiny_images(name, shape, rng):
    ref, pred = rng.random((2, *shape))
    value = metrics.metric(name)(pred, ref)
    assert isinstance(value, float)
    assert math.isfinite(value)
    assert metrics.metric(name)(ref, ref) == metrics.METRICS[name].identity


@pytest.mark.parametrize("name", FAST)
def test_float16_is_computed_as_float32(name, rng):
    ref, pred = rng.random((2, 17, 23, 3)).astype(np.float16)
    metric = metrics.metric(name)
    assert metric(pred, ref) == metric(pred.astype(np.float32), ref.astype(np.float32))


@pytest.mark.parametrize("name", FAST)
def test_inputs_are_left_alone_and_their_layout_does_not_matter(name, rng):
    ref, pred = rng.random((2, 17, 23, 3))
    before = ref.copy(), pred.copy()
    metric = metrics.metric(name)
    value = metric(pred, ref)
    assert np.array_equal(ref, before[0])
    assert np.array_equal(pred, before[1])
    assert metric(np.asfortranarray(pred), np.asfortranarray(ref)) == pytest.approx(value, rel=1e-12)
    assert metric(pred.tolist(), ref.tolist()) == value
    pred.flags.writeable = ref.flags.writeable = False
    assert metric(pred, ref) == value


@pytest.mark.parametrize("bad", [0.0, -1.0, math.inf, math.nan])
def test_impossible_data_range(bad):
    with pytest.raises(metrics.RangeError, match="data_range"):
        metrics.psnr(GOOD, GOOD, data_range=bad)
