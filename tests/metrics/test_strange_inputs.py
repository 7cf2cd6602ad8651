"""Arrays that other libraries hand over, numbers at the ends of the range, and dust."""

import warnings

import numpy as np
import pytest

from gibench import metrics
from gibench.metrics.errors import DtypeError, MetricInputError, RangeError
from gibench.metrics.hdrflip import exposure_range

RNG = np.random.default_rng(0)
REF = RNG.random((16, 18, 3)).astype(np.float32)
PRED = (REF + 0.1 * RNG.random(REF.shape)).astype(np.float32)
PER_PIXEL = ("mse", "rmse", "relmse", "mae", "smape")


def value(name, pred, ref, **keywords):
    return float(metrics.metric(name).function(pred, ref, **keywords))


@pytest.mark.parametrize("name", PER_PIXEL)
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("bits", ["f2", "f4", "f8"])
def test_the_order_of_bytes_is_no_matter_of_the_value(name, order, bits):
    assert value(name, PRED.astype(order + bits), REF) == value(name, PRED.astype(bits), REF)


def test_masked_arrays_are_refused_with_the_keyword_that_does_it():
    hidden = np.zeros(REF.shape, bool)
    hidden[:4] = True
    masked = np.ma.masked_array(PRED, hidden)
    for pred, ref in (
        (masked, REF),
        (REF, masked),
        ([masked, masked], [REF, REF]),
        ((REF, masked), (REF, REF)),
    ):
        with pytest.raises(DtypeError, match=r"is a masked array, .* mask=~(pred|ref)\.mask\.any\(-1\)"):
            metrics.mse(pred, ref)
    with pytest.raises(DtypeError, match="mask is a masked array"):
        metrics.mse(PRED, REF, mask=np.ma.masked_array(~hidden.any(-1), hidden.any(-1)))
    # What the message says does it; a mask that hides nothing is none.
    assert metrics.mse(masked.data, REF, mask=~masked.mask.any(-1)) == metrics.mse(PRED[4:], REF[4:])
    assert metrics.mse(np.ma.masked_array(PRED), REF) == metrics.mse(PRED, REF)


def test_what_no_array_can_be_made_of_is_named():
    torch = pytest.importorskip("torch")
    tensor = torch.tensor(PRED)
    assert metrics.rmse(tensor, REF) == metrics.rmse(PRED, REF)
    strange = [
        tensor.clone().requires_grad_(),
        tensor.bfloat16(),
        tensor.to_sparse(),
        [[1.0, 2.0], [3.0]],
        None,
        "x",
    ]
    for one in strange:
        with pytest.raises(MetricInputError):
            metrics.rmse(one, REF)
        with pytest.raises(MetricInputError):
            metrics.tone_map(one, 1.0)
    with pytest.raises(DtypeError, match=r"pred cannot be read as an array .*\.detach\(\)"):
        metrics.rmse(strange[0], REF)


@pytest.mark.parametrize("scale", [1e-200, 1e100, 1e200, 1e295])
def test_errors_of_huge_and_tiny_radiance(scale):
    pred, ref = PRED.astype(float) * scale, REF.astype(float) * scale
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_allclose(metrics.rmse(pred, ref), scale * metrics.rmse(PRED, REF), rtol=1e-12)
        np.testing.assert_allclose(metrics.mae(pred, ref), scale * metrics.mae(PRED, REF), rtol=1e-12)
        exact = np.inf if scale > 1e154 else scale * (scale * metrics.mse(PRED, REF))
        np.testing.assert_allclose(metrics.mse(pred, ref), exact, rtol=1e-12)
        if scale > 1:
            relative = np.mean(((PRED.astype(float) - REF) / REF) ** 2)
            np.testing.assert_allclose(metrics.relmse(pred, ref), relative, rtol=1e-12)
        assert 0 <= metrics.smape(pred, ref) <= 1
        assert 0 <= metrics.hdrflip(pred, ref) <= 1


def test_radiance_without_a_sum_is_refused():
    with pytest.raises(RangeError, match=r"pred has values up to 1e\+306, of which a float64 holds no sum"):
        metrics.mae(np.full((4, 4, 3), 1e306), REF[:4, :4].astype(float))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("exposure", [1e-308, 1e-50, 1e50, 1e308])
def test_any_exposure_of_any_radiance_is_a_picture(dtype, exposure):
    radiance = np.array([0.0, 1e-45, 1e-38, 1e-10, 1.0, 1e38], dtype).repeat(3).reshape(1, 6, 3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        seen = metrics.tone_map(radiance, exposure)
    assert seen.dtype == dtype
    assert (seen[0, 0] == 0).all()
    exact = np.minimum(radiance.astype(np.longdouble) * np.longdouble(exposure), 1)
    np.testing.assert_array_equal(seen == 1, exact == 1)
    assert (np.diff(seen, axis=1) >= 0).all()


@pytest.mark.parametrize("dust", [1e-38, 1e-30, 1e-20, 1e-12])
def test_a_background_of_dust_counts_and_costs_as_a_black_one(dust):
    ref = np.full((40, 60, 3), dust, np.float32)
    ref[:5] = RNG.random((5, 60, 3))
    black = np.where(ref < 1e-10, 0, ref).astype(np.float32)
    assert exposure_range(ref) == exposure_range(black)
    assert metrics.reference_exposure(ref) == metrics.reference_exposure(black)
    pred = np.float32(0.9)
    assert metrics.hdrflip(pred * ref, ref) == pytest.approx(metrics.hdrflip(pred * black, black), abs=1e-8)


def test_sun_and_room_are_no_dust():
    """A lamp 2²⁷ times as bright as the room leaves the room its exposures."""
    ref = np.full((40, 60, 3), 0.5, np.float32)
    ref[0, 0] = 0.5 * 2.0**27
    assert exposure_range(ref).count == 27


def test_weights_are_looked_for_where_nobody_has_a_home(monkeypatch):
    def none():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr("pathlib.Path.home", none)
    for name in ("GIBENCH_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    assert metrics.weights_state().state in ("missing", "cached")
    assert "gibench-" in str(metrics.weights_state().path)
