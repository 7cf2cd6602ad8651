"""Descriptors, the registry, `evaluate`, the table of definitions, and what an import costs."""

import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from gibench import metrics
from gibench.metrics.registry import METRICS, register

CHEAP = ["mse", "rmse", "mae", "relmse", "smape", "psnr", "rmse_display", "ssim", "dssim"]
SEQUENCE = ["warping_error", "mabd", "temporal_difference"]
TABLE = Path(__file__).parents[2] / "docs" / "metrics.md"


@pytest.fixture
def frames(rng):
    ref = rng.gamma(0.5, 2.0, (3, 20, 21, 3)) * np.array([1, 3, 9])[:, None, None, None]
    return ref * np.exp(0.2 * rng.standard_normal(ref.shape)), ref


def test_all_metrics_of_the_package_are_listed():
    expected = {*CHEAP, "lpips_alex", "lpips_vgg", "flip", "hdrflip", *SEQUENCE}
    assert set(METRICS) == expected
    assert [name for name, metric in METRICS.items() if metric.inputs == "sequence"] == SEQUENCE


@pytest.mark.parametrize("name", METRICS)
def test_descriptor_is_complete(name):
    metric = METRICS[name]
    assert metric.name == name
    assert metric.direction in ("lower", "higher")
    assert metric.values in ("linear", "display")
    assert metric.range[0] < metric.range[1]
    assert metric.units
    assert re.search(r"(19|20)\d\d", metric.reference)
    if metric.identity is not None:
        assert metric.identity == metric.range[0 if metric.direction == "lower" else 1]
    worse = math.inf if metric.direction == "lower" else -math.inf
    assert metric.better(0.5, worse)
    assert not metric.better(worse, 0.5)
    assert not metric.better(0.5, 0.5)


@pytest.mark.parametrize("name", METRICS)
def test_docstring_gives_what_a_reader_needs(name):
    text = METRICS[name].function.__doc__
    for part in ("Args:", "Returns:", "Raises:", "References:", "H, W, 3)"):
        assert part in text


def test_two_metrics_of_one_name_are_refused():
    with pytest.raises(ValueError, match="two metrics are named 'mse'"):
        register(
            name="mse",
            direction="lower",
            range=(0, 1),
            identity=0,
            units="1",
            values="linear",
            reference="2024",
        )(lambda pred, ref: 0.0)


def test_a_metric_of_ones_own_is_one_decorator(frames):
    @register(
        name="worst",
        direction="lower",
        range=(0, 9),
        identity=0,
        units="1",
        values="display",
        reference="2024",
    )
    def worst(pred, ref):
        return float(np.abs(pred - ref).max())

    try:
        row = metrics.evaluate(frames[0][0], frames[1][0], metrics=["worst"])
        assert 0 < row["worst"] <= 1
    finally:
        del METRICS["worst"]


def test_unknown_metric_lists_those_that_exist():
    with pytest.raises(metrics.UnknownMetricError, match=r"'smse'.*mse, rmse"):
        metrics.metric("smse")


def test_evaluate_one_image(frames):
    pred, ref = frames[0][1], frames[1][1]
    row = metrics.evaluate(pred, ref, metrics=CHEAP)
    assert list(row) == ["exposure", *CHEAP]
    assert all(type(value) is float for value in row.values())
    exposure = metrics.reference_exposure(ref)
    assert row["exposure"] == exposure
    assert row["relmse"] == metrics.relmse(pred, ref)
    shown = metrics.tone_map(pred, exposure), metrics.tone_map(ref, exposure)
    assert row["ssim"] == metrics.ssim(*shown)
    assert row["psnr"] == metrics.psnr(*shown)
    assert row["dssim"] == metrics.dssim(*shown)
    assert metrics.evaluate(pred, ref, metrics=["dssim"]) == {
        "exposure": exposure,
        "dssim": metrics.dssim(*shown),
    }
    assert pd.DataFrame([row]).shape == (1, 1 + len(CHEAP))


def test_evaluate_a_batch(frames):
    pred, ref = frames
    row = metrics.evaluate(pred, ref, metrics=CHEAP)
    table = pd.DataFrame(row)
    assert table.shape == (3, 1 + len(CHEAP))
    for index in range(3):
        assert table.iloc[index].to_dict() == metrics.evaluate(pred[index], ref[index], metrics=CHEAP)


def test_exposure_does_not_depend_on_the_prediction(frames):
    pred, ref = frames
    exposures = [metrics.evaluate(p, ref[0], metrics=[])["exposure"] for p in (pred[0], 100 * pred[0])]
    assert exposures[0] == exposures[1]


def test_exposure_can_be_that_of_the_whole_image(frames):
    pred, ref = frames[0][0], frames[1][0]
    row = metrics.evaluate(pred, ref, metrics=["psnr"], exposure=0.25)
    assert row["exposure"] == 0.25
    assert row["psnr"] == metrics.psnr(metrics.tone_map(pred, 0.25), metrics.tone_map(ref, 0.25))
    with pytest.raises(metrics.ShapeError, match="exposure"):
        metrics.evaluate(pred, ref, metrics=["mse"], exposure=[1.0, 2.0])
    both = metrics.evaluate(*frames, metrics=["psnr"], exposure=0.25)
    assert both["exposure"].tolist() == [0.25] * 3


def test_evaluate_with_a_mask(frames, rng):
    pred, ref = frames
    mask = rng.random(ref.shape[:3]) < 0.5
    row = metrics.evaluate(pred, ref, metrics=["mse", "flip"], mask=mask)
    assert row["mse"].tolist() == metrics.mse(pred, ref, mask=mask).tolist()
    with pytest.raises(metrics.UnknownMetricError, match="lpips_alex takes no mask"):
        metrics.evaluate(pred, ref, metrics=["mse", "lpips_alex"], mask=mask)


def test_evaluate_a_sequence(frames):
    pred, ref = frames
    along = {"motion": np.zeros((*ref.shape[:3], 2)), "visible": np.ones(ref.shape[:3], bool)}
    row = metrics.evaluate_sequence(pred, ref, metrics=SEQUENCE, **along)
    parts = [f"{name}{end}" for name in SEQUENCE for end in ("", "_prediction", "_reference")]
    assert list(row) == ["exposure", *parts]
    assert all(type(value) is float for value in row.values())
    exposure = metrics.reference_exposure(ref, shared=True)
    assert row["exposure"] == exposure
    shown = metrics.tone_map(pred, exposure), metrics.tone_map(ref, exposure)
    assert row["warping_error_reference"] == metrics.warping_error(*shown, **along).reference


def test_images_and_sequences_are_not_mixed_up(frames):
    with pytest.raises(
        metrics.UnknownMetricError, match="mabd is a metric of sequences: use evaluate_sequence"
    ):
        metrics.evaluate(*frames, metrics=["mabd"])
    with pytest.raises(metrics.UnknownMetricError, match="mse is a metric of images: use evaluate"):
        metrics.evaluate_sequence(*frames, metrics=["mse"], motion=None, visible=None)


@pytest.mark.parametrize("name", METRICS)
def test_table_of_definitions_agrees_with_the_registry(name):
    metric = METRICS[name]
    rows = [line for line in TABLE.read_text().splitlines() if line.startswith(f"| `{name}`")]
    assert len(rows) == 1
    cells = [cell.strip() for cell in rows[0].strip("|").split("|")]
    low, high = ("∞" if end == math.inf else f"{end:g}".replace("-", "−") for end in metric.range)
    _, formula, interval, units, direction, values, source = cells
    assert formula.startswith("$")
    assert interval.strip("[])") == f"{low}, {high}"
    assert units == metric.units
    assert direction == metric.direction
    assert values.split()[0] == metric.values
    assert metric.reference.split(",")[0] in source


def test_import_loads_nothing_heavy():
    heavy = "{'torch', 'torchvision', 'lpips', 'mitsuba', 'drjit', 'skimage', 'scipy', 'pandas'}"
    code = f"import sys, gibench.metrics; assert not {heavy} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
    code = (
        "import sys, gibench.metrics as m; print(*sorted(n for n in sys.modules if n.startswith('gibench.')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {name.split(".")[1] for name in done.stdout.split()} == {"errors", "llvm", "metrics"}
