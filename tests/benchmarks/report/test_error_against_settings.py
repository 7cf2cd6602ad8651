import numpy as np
import pytest

from gibench.benchmarks.report.error_against_settings import error_against_settings, sweeps
from gibench.benchmarks.report.plots import write_plots
from gibench.benchmarks.report.summary import summarise
from tests.benchmarks.report.drawn import boxes
from tests.benchmarks.report.synthetic import Setting, SyntheticRun, settings


def wavelets(count, **more):
    return Setting(
        "nfvr", {"wavelets": count, "denoise": False} | more, f"wavelets={count}", blur=3 / count**0.3
    )


def summary_of(root, chosen, **more):
    return summarise(
        SyntheticRun(root, chosen=chosen, frames=1, metrics=("rmse", "psnr"), measured=False, **more)
    )


def found(summary, metric="rmse"):
    return sweeps(summary, "walkthrough", "full", metric, summary.machines[0])


def test_a_line_for_all_that_else_is_set(tmp_path):
    """The synthetic path tracer has three numbers of samples, with and without its denoiser."""
    summary = summary_of(tmp_path, [*settings(), wavelets(256), wavelets(16), wavelets(64)])
    traced, nfvr = found(summary)
    assert (traced.method, traced.knob, traced.values) == ("path-traced", "spp", [1, 4, 16])
    assert set(traced.lines) == {"path-traced", "path-traced oidn"}
    assert (nfvr.method, nfvr.knob, nfvr.values) == ("nfvr", "wavelets", [16, 64, 256])
    (line,) = nfvr.lines.values()
    scores = summary.scores[(summary.scores["part"] == "full") & (summary.scores["metric"] == "rmse")]
    labels = summary.entries["label"]
    for row in line.itertuples():
        entry = labels[labels == f"nfvr wavelets={row.value:g}"].index[0]
        assert row.mean == scores.loc[scores["entry"] == entry, "mean"].item()


def test_a_line_is_over_the_rooms_that_all_of_its_settings_have(tmp_path):
    """A setting that was run in fewer rooms, or failed in one, would bend the line by the room and not by the knob."""
    whole = summary_of(tmp_path, list(map(wavelets, (16, 64, 256))))
    ((name,),) = (sweep.lines for sweep in found(whole))
    assert name == "nfvr"
    summary = summary_of(tmp_path, list(map(wavelets, (16, 64, 256))), failed=("nfvr wavelets=64",))
    (sweep,) = found(summary)
    ((name, line),) = sweep.lines.items()
    assert name == "nfvr (2 of 3 rooms)"
    assert sweep.named
    values, floor = (
        table[(table["part"] == "full") & (table["metric"] == "rmse") & (table["scene"] != "room-000002")]
        for table in (summary.values, summary.floor)
    )
    for row in line.itertuples():
        own = values.loc[values["entry"] == row.Index, "value"]
        assert len(own) == 2
        assert row.mean == pytest.approx(own.mean(), rel=1e-12)
        assert row.low < row.mean < row.high
        assert row.floor == pytest.approx(floor["value"].mean(), rel=1e-12)
    texts = [
        text
        for text, _ in boxes(
            error_against_settings(summary, "walkthrough", "full", "rmse", summary.machines[0])
        )
    ]
    assert "nfvr (2 of 3 rooms)" in texts


def test_two_values_or_truth_are_no_line(tmp_path):
    assert not found(summary_of(tmp_path, [wavelets(16), wavelets(64), Setting("isg")]))
    # Three values of which no two have all else alike.
    apart = [wavelets(count, table=count) for count in (16, 64, 256)]
    assert not found(summary_of(tmp_path, apart))
    summary = summary_of(tmp_path, [wavelets(16), Setting("isg")])
    assert error_against_settings(summary, "walkthrough", "full", "rmse", summary.machines[0]) is None


def test_knobs_that_are_no_json_object_are_no_line(tmp_path):
    run = SyntheticRun(
        tmp_path,
        chosen=[wavelets(16), wavelets(64), wavelets(256)],
        frames=1,
        metrics=("rmse",),
        measured=False,
    )
    run.results["knobs"] = "[1]"
    run.results.loc[run.results["label"] == "nfvr wavelets=64", "knobs"] = None
    assert not found(summarise(run))


@pytest.mark.parametrize("metric", ["rmse", "psnr"])
def test_panels_share_a_scale_and_have_ticks_where_values_are(tmp_path, metric):
    summary = summary_of(tmp_path, [*settings(), *map(wavelets, (16, 32, 64, 128, 256))])
    figure = error_against_settings(summary, "walkthrough", "full", metric, summary.machines[0])
    first, second = figure.axes
    assert first.get_ylim() == second.get_ylim()
    assert [text.get_text() for text in second.get_xticklabels()] == ["16", "32", "64", "128", "256"]
    low, high = second.get_xlim()
    assert low < 16 < 256 < high
    texts = [text for text, _ in boxes(figure)]
    assert {"path-traced", "path-traced oidn", "nfvr", "wavelets", "spp"} <= set(texts)
    assert any("is better" in text for text in texts)


def test_zero_among_the_values_and_hundreds_of_them(tmp_path):
    many = [Setting("b", {"n": n}, f"n={n}", blur=1 + n / 50) for n in range(40)]
    summary = summary_of(tmp_path, many, scenes=1)
    figure = error_against_settings(summary, "walkthrough", "full", "rmse", summary.machines[0])
    (axes,) = figure.axes
    assert axes.get_xscale() == "linear"
    assert len(axes.get_xticks()) <= 8
    assert np.isfinite(axes.get_ylim()).all()


def test_files_are_named_by_part_and_metric_and_machine(tmp_path):
    run = SyntheticRun(
        tmp_path / "run",
        chosen=list(map(wavelets, (16, 32, 64))),
        frames=1,
        metrics=("rmse",),
        machines=("cpu-a", "cpu-b"),
        measured=False,
        parts=("full",),
    )
    names = {path.name for path in write_plots(run, summarise(run), tmp_path)}
    for number in (1, 2):
        assert f"error-against-settings-full-rmse-machine-{number}.svg" in names
