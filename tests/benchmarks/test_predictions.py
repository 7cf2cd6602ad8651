import hashlib

import numpy as np
import pytest

from gibench.baselines.method import Prediction
from gibench.benchmarks import predictions
from gibench.benchmarks.errors import ResultsError
from gibench.benchmarks.predictions import BadPrediction, checked

SIZE = (7, 5)


def good(value: float = 0.5) -> np.ndarray:
    return np.full((5, 7, 3), value, np.float32)


def with_value(value: float) -> np.ndarray:
    image = good()
    image[2, 3, 1] = value
    return image


@pytest.mark.parametrize(
    ("color", "says"),
    [
        (with_value(np.nan), "color is not finite in 1 of 35 pixels, first at row 2, column 3"),
        (with_value(-np.inf), "not finite"),
        (with_value(-1e-9), "color is negative in 1 of 35 pixels, first at row 2, column 3"),
        (good()[:, :6], r"color has shape \(5, 6, 3\), asked for was \(5, 7, 3\)"),
        (good()[..., 0], r"color has shape \(5, 7\)"),
        (good().astype(int), "color is int64, asked for was float32"),
        (np.full((5, 7, 3), 1e300), "above the largest of float32"),
        (None, r"color has shape \(\)"),
    ],
)
def test_what_is_no_image_is_refused(color, says):
    with pytest.raises(BadPrediction, match=says):
        checked(Prediction(color), SIZE)


def test_the_specular_part_is_checked_too_and_may_be_missing():
    with pytest.raises(BadPrediction, match="specular is negative"):
        checked(Prediction(good(), with_value(-1)), SIZE)
    assert set(checked(Prediction(good()), SIZE)) == {"full"}
    with pytest.raises(BadPrediction, match="render returned NoneType"):
        checked(None, SIZE)


def test_zero_and_the_largest_value_are_radiance():
    parts = checked(Prediction(good(0.0), good(3e38)), SIZE)
    assert parts["full"].max() == 0
    assert np.isfinite(parts["specular"]).all()


def test_frames_come_back_as_they_were(tmp_path):
    rng = np.random.default_rng(3)
    parts = {
        "full": np.exp(rng.uniform(-5, 5, (5, 7, 3))).astype(np.float32),
        "specular": np.exp(rng.uniform(0, 14, (5, 7, 3))).astype(np.float32),  # beyond half
    }
    back = read_back(tmp_path, predictions.encode(parts))
    assert list(back) == ["full", "specular"]
    np.testing.assert_allclose(back["full"], parts["full"], rtol=1e-3, atol=1e-4)
    np.testing.assert_array_equal(back["specular"], parts["specular"])
    assert list(read_back(tmp_path, predictions.encode({"full": parts["full"]}))) == ["full"]


def read_back(root, written, *, then=None):
    """What is read of a frame, or of one that was changed after it was written."""
    path = root / "results" / "id" / "0000.exr"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(written if then is None else then)
    known = {"sha256": hashlib.sha256(written).hexdigest(), "bytes": len(written)}
    return predictions.read(root, "id", 0, known)


def test_a_damaged_frame_is_named(tmp_path):
    whole = predictions.encode({"full": good()})
    named = r"0000\.exr cannot be read .*remove .*results/id\.json and run the same command again"
    with pytest.raises(ResultsError, match=named):
        read_back(tmp_path, whole[:200])
    other = predictions.encode({"full": good() + 1})
    for changed in (whole[:-9], whole + b"x" * 9, other):
        with pytest.raises(ResultsError, match=named):
            read_back(tmp_path, whole, then=changed)


def test_images_of_any_library_are_taken():
    torch = pytest.importorskip("torch")
    from gibench.rendering.backend import select_variant

    select_variant("auto")
    import mitsuba as mi

    numbers = np.arange(4 * 5 * 3, dtype=np.float32).reshape(4, 5, 3)
    lazy = mi.TensorXf(numbers) * 2
    prediction = Prediction(torch.from_numpy(numbers), lazy, indirect=numbers)
    prediction.finish()
    parts = checked(prediction, (5, 4))
    assert parts.keys() == {"full", "specular", "indirect"}
    np.testing.assert_array_equal(parts["full"], numbers)
    np.testing.assert_array_equal(parts["specular"], 2 * numbers)


def test_numbers_of_a_frame_are_worked_out_when_they_are_read():
    calls = []
    prediction = Prediction(good(), extra=lambda: calls.append(1) or {"samples": 3.0})
    prediction.finish()
    checked(prediction, (7, 5))
    assert not calls
    assert prediction.extra == prediction.extra == {"samples": 3.0}
    assert len(calls) == 1
    assert Prediction(good()).extra == {}


def test_a_part_that_only_scoring_asks_for_is_made_after_the_clock():
    calls = []

    def part():
        calls.append(1)
        return good()

    prediction = Prediction(good(), part, indirect=part)
    prediction.finish()
    assert calls == []
    assert set(checked(prediction, SIZE)) == {"full", "specular", "indirect"}
    assert calls == [1, 1]
