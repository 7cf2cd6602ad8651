import itertools
import math

import numpy as np
import pytest
from PIL import Image

from gibench.benchmarks.report.error_against_cost import COSTS, error_against
from gibench.benchmarks.report.error_along_path import best_settings, error_along_path
from gibench.benchmarks.report.labels import Box
from gibench.benchmarks.report.plot_style import COLOURS, LINES, MARKERS, log_ticks, look, save, tick_text
from gibench.benchmarks.report.plots import write_plots
from gibench.benchmarks.report.stage_bars import stage_bars
from gibench.benchmarks.report.summary import summarise
from tests.benchmarks.report.synthetic import Setting, SyntheticRun

TIME, PREPARATION, BYTES = COSTS


@pytest.fixture(scope="module")
def crowded(tmp_path_factory):
    """Thirty settings of twenty methods with long names, many of them at nearly one place."""
    rng = np.random.default_rng(2)
    chosen = [
        Setting(
            f"a-method-with-a-name-{number:02d}",
            kind=("probes", "network", "lightmap", "path-traced")[number % 4],
            blur=float(2 + rng.normal(0, 0.02 if number < 10 else 1.0) ** 2),
            ms=float(20 * (1 + 0.02 * number) if number < 10 else 20 * 1.2**number),
        )
        for number in range(20)
    ]
    chosen += [
        Setting(
            "path-traced",
            {"spp": 2**power},
            f"spp={2**power}",
            "path-traced",
            noise=2.0 ** (-power / 2),
            ms=30 * 2**power,
        )
        for power in range(10)
    ]
    run = SyntheticRun(tmp_path_factory.mktemp("crowded"), chosen=chosen, scenes=2, frames=5, measured=False)
    return run, summarise(run)


def figures(run, summary):
    for part, metric in itertools.product(summary.parts, ("rmse", "psnr")):
        for cost in COSTS:
            yield error_against(summary, "walkthrough", part, metric, cost)
        yield error_along_path(summary, "walkthrough", part, metric)
    yield stage_bars(run, summary, "walkthrough", summary.machines[0])


def boxes(figure):
    """The texts of a figure that are seen, with the places that they take."""
    renderer = figure.canvas.get_renderer()
    figure.draw(renderer)
    texts = list(figure.texts)
    for axes in figure.axes:
        texts += [*axes.texts, axes.xaxis.label, axes.yaxis.label, axes.title, axes._left_title]
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            texts += [tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
    return [
        (text.get_text(), Box(*text.get_window_extent(renderer).extents))
        for text in texts
        if text.get_visible() and text.get_text().strip()
    ]


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


def test_every_error_plot_shows_the_noise_floor_and_the_front(run, summary):
    for cost in COSTS:
        figure = error_against(summary, "walkthrough", "full", "rmse", cost)
        texts = [text for text, _ in boxes(figure)]
        assert any(text.startswith("noise floor of the reference, 0.004") for text in texts)
        assert "Pareto front" in texts
    assert any(
        "noise floor" in text for text, _ in boxes(error_along_path(summary, "walkthrough", "full", "rmse"))
    )


def front_of(figure):
    axes = figure.axes[0]
    (line,) = [line for line in axes.lines if line.get_linewidth() == 2.6]
    return line.get_xdata(), line.get_ydata(), axes


def test_the_front_is_what_nothing_cheaper_beats(run, summary):
    across, up, _ = front_of(error_against(summary, "walkthrough", "full", "rmse", TIME))
    scores = summary.scores[(summary.scores["part"] == "full") & (summary.scores["metric"] == "rmse")]
    points = summary.entries.drop(columns="rooms").merge(scores, left_index=True, right_on="entry")
    points = points[points["rooms"] == 3]  # ulr failed in a room
    expected = {
        (row.ms_median, row.mean)
        for row in points.itertuples()
        if not ((points["ms_median"] < row.ms_median) & (points["mean"] <= row.mean)).any()
    }
    assert set(zip(across[1:-1:2], up[1:-1:2], strict=True)) == expected
    assert (np.diff(across) >= 0).all()
    assert (np.diff(up) <= 0).all()


def test_with_a_metric_where_higher_is_better_the_front_rises(summary):
    _, up, axes = front_of(error_against(summary, "walkthrough", "full", "psnr", TIME))
    assert (np.diff(up) >= 0).all()
    assert axes.get_yscale() == "linear"


def test_what_costs_nothing_has_a_place_on_the_logarithmic_axis(summary):
    figure = error_against(summary, "walkthrough", "full", "rmse", PREPARATION)
    axes = figure.axes[0]
    assert axes.get_xscale() == "log"
    assert next(iter(axes.get_xticklabels())).get_text() == "none"


def test_where_nothing_was_baked_there_is_no_plot(tmp_path):
    run = SyntheticRun(tmp_path, chosen=[Setting("a", kind="path-traced"), Setting("b", kind="path-traced")])
    assert error_against(summarise(run), "walkthrough", "full", "rmse", BYTES) is None


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


def test_a_plot_that_is_made_again_is_the_same_file(summary, tmp_path):
    figure = lambda: error_against(summary, "walkthrough", "full", "rmse", TIME)  # noqa: E731
    first, second = (save(figure(), tmp_path, name) for name in ("one", "two"))
    for a, b in zip(first, second, strict=True):
        assert a.read_bytes() == b.read_bytes()
    with Image.open(tmp_path / "one.png") as picture:
        assert picture.width == 1300


def test_best_settings_leave_out_those_that_failed_somewhere(run, summary):
    labels = summary.entries.loc[best_settings(summary, "walkthrough", "full", "rmse"), "label"]
    assert len(labels) == summary.entries["method"].nunique()
    scores = summary.scores[(summary.scores["part"] == "full") & (summary.scores["metric"] == "rmse")]
    traced = scores[scores["entry"].isin(summary.entries.index[summary.entries["method"] == "path-traced"])]
    assert summary.entries.loc[traced.loc[traced["mean"].idxmin(), "entry"], "label"] in set(labels)


def test_methods_differ_in_grey_and_in_colour():
    looks = {(look(n)["color"], look(n)["marker"], str(look(n)["linestyle"])) for n in range(280)}
    assert len(looks) == len(COLOURS) * len(MARKERS) * len(LINES) == 280
    # The eight neighbours of a small plot differ by marker alone, without any colour.
    assert len({look(n)["marker"] for n in range(8)}) == 8


@pytest.mark.parametrize("low", [1e-6, 0.013, 0.9, 37.0, 2e4])
@pytest.mark.parametrize("ratio", [1.3, 2.0, 4.0, 30.0, 1e4, 1e12])
def test_logarithmic_ticks_are_round_inside_and_neither_few_nor_many(low, ratio):
    ticks = log_ticks(low, low * ratio)
    assert 2 <= len(ticks) <= 9
    assert all(low <= tick <= low * ratio for tick in ticks)
    assert all(math.isclose(float(tick_text(tick).replace("−", "-")), tick) for tick in ticks)
