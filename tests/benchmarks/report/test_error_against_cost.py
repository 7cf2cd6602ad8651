import numpy as np

from gibench.benchmarks.report.error_against_cost import COSTS, error_against
from gibench.benchmarks.report.summary import summarise
from tests.benchmarks.report.drawn import boxes
from tests.benchmarks.report.synthetic import Setting, SyntheticRun

TIME, PREPARATION, BYTES = COSTS


def test_every_error_plot_shows_the_noise_floor_and_the_front(run, summary):
    for cost in COSTS:
        figure = error_against(summary, "walkthrough", "full", "rmse", cost)
        texts = [text for text, _ in boxes(figure)]
        assert any(text.startswith("noise floor of the reference, 0.004") for text in texts)
        assert "Pareto front" in texts


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


def test_of_one_frame_in_one_room_there_is_no_interval(tmp_path):
    run = SyntheticRun(
        tmp_path, scenes=1, frames=1, metrics=("rmse", "psnr"), parts=("full",), measured=False
    )
    run.floor["value"] = np.nan
    for metric in run.metrics:
        summary = summarise(run)
        assert np.isinf(summary.scores["low"]).all()
        axes = error_against(summary, "walkthrough", "full", metric, TIME).axes[0]
        (low, high), means = axes.get_ylim(), summary.scores.loc[summary.scores["metric"] == metric, "mean"]
        assert low < means.min() <= means.max() < high < 2 * means.max()


def test_an_interval_that_leaves_a_logarithmic_axis_is_not_drawn(tmp_path):
    """One that reaches 0 has no end there; on an even axis it has, and is drawn."""
    run = SyntheticRun(tmp_path, scenes=2, metrics=("rmse", "psnr"), parts=("full",))
    summary = summarise(run)
    summary.scores.loc[summary.scores.index[::2], "low"] = -1.0
    for metric, told in (("rmse", True), ("psnr", False)):
        figure = error_against(summary, "walkthrough", "full", metric, TIME)
        drawn = [
            text for text, _ in boxes(figure) if text.endswith("intervals that leave the axis are not drawn")
        ]
        assert bool(drawn) == told
        ends = [
            point[1]
            for collection in figure.axes[0].collections
            for segment in getattr(collection, "get_segments", list)()
            for point in segment
            if np.isfinite(point[1])
        ]
        assert (min(ends) > 0) == told
