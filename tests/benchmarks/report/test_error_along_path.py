from gibench.benchmarks.report.error_along_path import best_settings, error_along_path
from gibench.benchmarks.report.summary import summarise
from tests.benchmarks.report.drawn import boxes
from tests.benchmarks.report.synthetic import SyntheticRun, settings


def test_best_settings_leave_out_those_that_failed_somewhere(run, summary):
    labels = summary.entries.loc[best_settings(summary, "walkthrough", "full", "rmse"), "label"]
    assert len(labels) == summary.entries["method"].nunique()
    scores = summary.scores[(summary.scores["part"] == "full") & (summary.scores["metric"] == "rmse")]
    traced = scores[scores["entry"].isin(summary.entries.index[summary.entries["method"] == "path-traced"])]
    assert summary.entries.loc[traced.loc[traced["mean"].idxmin(), "entry"], "label"] in set(labels)


def lines(figure):
    """Frames of each line, and of each row of points without one, of the last method."""
    axes = figure.axes[0]
    colour = axes.lines[-1].get_color()
    found = [line for line in axes.lines if line.get_color() == colour]
    joined = [list(line.get_xdata()) for line in found if line.get_linestyle() != "None"]
    return joined, [list(line.get_xdata()) for line in found if line.get_linestyle() == "None"]


def plotted(tmp_path, sequences):
    run = SyntheticRun(
        tmp_path, chosen=settings()[:2], scenes=1, frames=len(sequences), metrics=("rmse",), measured=False
    )
    run.paths["sequence"] = sequences
    return error_along_path(summarise(run), "walkthrough", "full", "rmse")


def test_stills_are_points_and_each_sequence_is_a_line(tmp_path):
    figure = plotted(tmp_path, ["", "", "", "camera", "camera", "light", "light", "light"])
    joined, points = lines(figure)
    assert (joined, points) == ([[3, 4], [5, 6, 7]], [[0, 1, 2]])
    assert "frame; a point is a still" in [text for text, _ in boxes(figure)]


def test_stills_alone_have_no_line_and_no_path(tmp_path):
    figure = plotted(tmp_path, [""] * 4)
    assert lines(figure) == ([], [[0, 1, 2, 3]])
    assert any("of each still" in text for text, _ in boxes(figure))


def test_a_path_alone_is_one_line(tmp_path):
    figure = plotted(tmp_path, ["walk"] * 4)
    assert lines(figure) == ([[0, 1, 2, 3]], [])
    assert "frame of the path" in [text for text, _ in boxes(figure)]


def test_the_noise_floor_is_named(summary):
    texts = [text for text, _ in boxes(error_along_path(summary, "walkthrough", "full", "rmse"))]
    assert any("noise floor" in text for text in texts)
