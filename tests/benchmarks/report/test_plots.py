"""All plots of a run together."""

import itertools

import pytest
from PIL import Image

from gibench.benchmarks.report.error_against_cost import COSTS, error_against
from gibench.benchmarks.report.error_along_path import error_along_path
from gibench.benchmarks.report.labels import Box
from gibench.benchmarks.report.plot_style import save
from gibench.benchmarks.report.plots import write_plots
from gibench.benchmarks.report.stage_bars import stage_bars
from gibench.benchmarks.report.summary import summarise
from tests.benchmarks.report.drawn import boxes
from tests.benchmarks.report.synthetic import SyntheticRun

TIME = COSTS[0]


def figures(run, summary):
    for part, metric in itertools.product(summary.parts, ("rmse", "psnr")):
        for cost in COSTS:
            yield error_against(summary, "walkthrough", part, metric, cost)
        yield error_along_path(summary, "walkthrough", part, metric)
    yield stage_bars(run, summary, "walkthrough", summary.machines[0])


@pytest.mark.parametrize("which", ["usual", "crowded"])
def test_no_text_lies_on_another_or_is_cut_off(which, run, summary, crowded):
    for figure in figures(*(crowded if which == "crowded" else (run, summary))):
        assert figure is not None
        width, height = figure.get_size_inches() * figure.dpi
        page = Box(0, 0, width, height)
        found = boxes(figure)
        for text, box in found:
            assert page.holds(box), f"{text!r} is cut off in {found[0][0]!r}"
        for (one, first), (other, second) in itertools.combinations(found, 2):
            assert not first.meets(second), f"{one!r} lies on {other!r} in {found[0][0]!r}"


def test_every_setting_or_its_curve_is_named(run, summary, crowded):
    for used, found in ((run, summary), crowded):
        texts = " ".join(text for text, _ in boxes(error_against(found, "walkthrough", "full", "rmse", TIME)))
        for curve in found.entries["curve"]:
            assert curve in texts
        path = " ".join(text for text, _ in boxes(error_along_path(found, "walkthrough", "full", "rmse")))
        bars = [text for text, _ in boxes(stage_bars(used, found, "walkthrough", found.machines[0]))]
        assert all(method in path for method in found.entries["method"])
        assert set(found.entries["label"]) <= set(bars)


def test_times_of_two_machines_never_share_a_plot(tmp_path):
    run = SyntheticRun(
        tmp_path, scenes=1, frames=1, metrics=("rmse",), parts=("full",), machines=("m1", "m2")
    )
    summary = summarise(run)
    names = {path.name for path in write_plots(run, summary, tmp_path)}
    for number in (1, 2):
        assert f"error-against-time-full-rmse-machine-{number}.svg" in names
        assert f"stages-machine-{number}.png" in names
    assert "error-against-time-full-rmse.svg" not in names
    assert "error-against-bytes-full-rmse.svg" in names
    figure = error_against(summary, "walkthrough", "full", "rmse", TIME, machine="m1")
    assert any("m1" in text for text, _ in boxes(figure))


@pytest.mark.parametrize("gpu", [None, "NVIDIA RTX 6000 Ada Generation"])
@pytest.mark.parametrize("cpu", ["EPYC", "Intel(R) Xeon(R) Platinum 8375C CPU @ 2.90GHz"])
def test_bars_of_stages_name_their_machine_however_long_its_name(cpu, gpu, tmp_path):
    run = SyntheticRun(tmp_path, scenes=1, frames=1, metrics=("rmse",), parts=("full",))
    run.run["machine"] |= {"cpu": cpu, "gpu": gpu}
    summary = summarise(run)
    figure = stage_bars(run, summary, "walkthrough", summary.machines[0])
    width, height = figure.get_size_inches() * figure.dpi
    found = boxes(figure)
    assert any(summary.machines[0] in text for text, _ in found)
    assert all(Box(0, 0, width, height).holds(box) for _, box in found)
    assert not any(a.meets(b) for (_, a), (_, b) in itertools.combinations(found, 2))


def test_a_plot_that_is_made_again_is_the_same_file(summary, tmp_path):
    figure = lambda: error_against(summary, "walkthrough", "full", "rmse", TIME)  # noqa: E731
    first, second = (save(figure(), tmp_path, name) for name in ("one", "two"))
    for a, b in zip(first, second, strict=True):
        assert a.read_bytes() == b.read_bytes()
    with Image.open(tmp_path / "one.png") as picture:
        assert picture.width == 1300
