import itertools

import numpy as np
import pytest

from gibench.benchmarks.report.error_against_training import CAPTION, error_against_training
from gibench.benchmarks.report.labels import Box
from gibench.benchmarks.report.plots import write_plots
from gibench.benchmarks.report.summary import summarise
from gibench.benchmarks.report.trainings import trainings
from tests.benchmarks.report.drawn import boxes
from tests.benchmarks.report.synthetic import Setting, SyntheticRun


def network(method, **more):
    return Setting(method, kind="network", **more)


def made(root, *chosen, change=None, **more):
    """The figure, and the trainings that it shows."""
    run = SyntheticRun(root, chosen=chosen, frames=1, metrics=("rmse",), measured=False, **more)
    if change is not None:
        change(run.curves)
    summary = summarise(run)
    curves = trainings(run, summary)
    return error_against_training(curves, summary, "walkthrough", summary.machines[0]), curves


def lines(axes, least=2):
    """Lines of looks: as long as `least`, in the coordinates of data."""
    return [
        line
        for line in axes.lines
        if line.get_linestyle() != "None" and len(line.get_xdata()) >= least and line.get_color() != "#6e6e6e"
    ]


def test_a_line_a_training_a_row_a_method(tmp_path):
    figure, curves = made(
        tmp_path, network("a"), network("a:plain", blur=0.1), network("b", blur=40), scenes=2, seeds=(1, 2, 3)
    )
    assert len(figure.axes) == 2 * 2
    assert [len(lines(axes)) for axes in figure.axes] == [12, 12, 6, 6]
    for column, what in enumerate(("seconds", "steps")):
        for line, curve in zip(lines(figure.axes[column]), curves[:12], strict=True):
            assert np.array_equal(line.get_ydata(), curve.errors)
            assert np.array_equal(line.get_xdata()[1:], getattr(curve, what)[1:])
        # Rows share time and steps, so that they can be read down; errors they do not share.
        assert figure.axes[column].get_xlim() == figure.axes[column + 2].get_xlim()
    assert figure.axes[0].get_ylim() == figure.axes[1].get_ylim() != figure.axes[2].get_ylim()
    texts = [text for text, _ in boxes(figure)]
    assert {"a, 12 trainings", "b, 6 trainings", "a", "a:plain", *CAPTION} <= set(texts)
    assert "held-out error, own measure" in texts


def test_the_marker_is_where_weights_are_kept(tmp_path):
    """Where a training says so, and at its smallest error where it does not."""

    def keep(curves):
        curves["kept"] = curves["step"] == 300

    (curve,) = made(tmp_path / "says", network("a"), scenes=1, change=keep)[1]
    assert curve.steps[curve.best] == 300
    assert curve.errors[3] > curve.errors.min()
    (curve,) = made(tmp_path / "silent", network("a"), scenes=1)[1]
    assert curve.best == np.argmin(curve.errors)


def test_the_untrained_network_stands_at_0(tmp_path):
    figure, _ = made(tmp_path, network("a"), scenes=1)
    for axes in figure.axes:
        (line,) = lines(axes)
        (nothing, *_), labels = axes.get_xticks(), axes.get_xticklabels()
        assert labels[0].get_text() == "0"
        assert line.get_xdata()[0] == nothing < line.get_xdata()[1]


@pytest.mark.parametrize("looks", [1, 2, 500])
def test_few_and_many_looks(tmp_path, looks):
    figure, _ = made(tmp_path, network("a"), scenes=1, looks=looks)
    assert [len(lines(axes, 1)[0].get_xdata()) for axes in figure.axes] == [looks, looks]
    figure.canvas.draw()


def crosses(axes):
    return sum(len(line.get_xdata()) for line in axes.lines if line.get_marker() == "x")


def test_errors_that_are_not_finite_are_crosses_and_gaps(tmp_path):
    def change(table):
        first, second, third = table["result"].unique()
        table.loc[(table["result"] == first) & (table["step"] > 500), "error"] = np.nan
        table.loc[table["result"] == second, "error"] = np.nan
        table.loc[(table["result"] == third) & (table["step"] != 300), "error"] = np.inf

    figure, _ = made(tmp_path, network("a"), network("b"), network("c"), scenes=1, change=change)
    assert [crosses(axes) for axes in figure.axes] == [6, 6, 12, 12, 11, 11]
    figure.canvas.draw()
    (dot,) = [line for line in figure.axes[4].lines if line.get_marker() == "."]
    assert len(dot.get_xdata()) == 1


def test_errors_of_0_or_below_are_drawn_evenly(tmp_path):
    def change(table):
        table.loc[table["step"] == 1100, "error"] = 0.0

    figure, _ = made(tmp_path, network("a"), scenes=1, change=change)
    assert figure.axes[0].get_yscale() == "linear"


@pytest.mark.parametrize("count", [1, 9])
def test_no_text_lies_on_another_or_is_cut_off(tmp_path, count):
    chosen = [
        network(f"a:a-long-name-of-an-ablation-{number}", blur=2 + 0.01 * number) for number in range(count)
    ]
    figure, _ = made(tmp_path, *chosen, network("b", blur=1e-4), scenes=2, seeds=(1, 2))
    found, page = boxes(figure), Box(0, 0, *(figure.get_size_inches() * figure.dpi))
    for text, box in found:
        assert page.holds(box), f"{text!r} is cut off"
    for (one, first), (other, second) in itertools.combinations(found, 2):
        assert not first.meets(second), f"{one!r} lies on {other!r}"


def test_without_trainings_there_is_no_plot_and_with_two_machines_one_each(tmp_path):
    def written(*chosen, **more):
        run = SyntheticRun(
            tmp_path,
            chosen=chosen,
            scenes=1,
            frames=1,
            metrics=("rmse",),
            parts=("full",),
            measured=False,
            **more,
        )
        return {path.name for path in write_plots(run, summarise(run), tmp_path) if "training" in path.name}

    assert written(Setting("a"), Setting("b")) == set()
    assert written(network("a"), Setting("b")) == {"training-curves.svg", "training-curves.png"}
    two = written(network("a"), machines=("m1", "m2"))
    assert two == {f"training-curves-machine-{n}.{kind}" for n in (1, 2) for kind in ("svg", "png")}
