import math

import pandas as pd
import pytest

from gibench.benchmarks.report.csv_files import short_reason, write_csv_files


@pytest.fixture(scope="module")
def tables(run, summary, tmp_path_factory):
    out = tmp_path_factory.mktemp("csv")
    return {path.name: pd.read_csv(path) for path in write_csv_files(run, summary, out)}


def test_every_file_names_the_method_and_setting(tables):
    names = ("leaderboard", "frames", "sequences", "stages", "training", "extras", "results")
    assert set(tables) == {f"{name}.csv" for name in names}
    for table in tables.values():
        assert {"method", "label", "knobs", "machine"} <= set(table.columns)


def test_the_leaderboard_has_each_setting_best_first(run, tables):
    board = tables["leaderboard.csv"]
    for metric, rising in (("rmse", True), ("psnr", False)):
        own = board[(board["part"] == "full") & (board["metric"] == metric)]
        assert set(own["label"]) == {setting.label for setting in run.settings}
        assert own["mean"].is_monotonic_increasing if rising else own["mean"].is_monotonic_decreasing
    assert ((board["low"] <= board["mean"]) & (board["mean"] <= board["high"])).all()
    assert (board["against"] == "rtrt").all()


def test_frames_carry_every_value_and_the_noise_floor(run, tables):
    frames = tables["frames.csv"]
    assert len(frames) == len(run.frames)
    keys = ["result", "frame", "part", "metric"]
    both = frames.merge(run.frames, on=keys, suffixes=("", "_raw"))
    assert len(both) == len(run.frames)
    assert both["value"].to_numpy() == pytest.approx(both["value_raw"].to_numpy(), rel=1e-6)
    assert (frames.loc[frames["metric"] == "rmse", "noise_floor"] == 0.004).all()


def test_extras_carry_what_methods_say_of_their_frames(run, tables):
    extras = tables["extras.csv"]
    assert list(extras.columns[-3:]) == ["frame", "name", "value"]
    assert len(extras) == len(run.extras) > 0
    assert (extras["value"] == 0.25).all()


def test_training_carries_every_look(tables, tmp_path):
    from gibench.benchmarks.report.summary import summarise
    from tests.benchmarks.report.synthetic import Setting, SyntheticRun

    assert tables["training.csv"].empty
    run = SyntheticRun(tmp_path, chosen=[Setting("gpr", kind="network")], scenes=2, frames=1, measured=False)
    run.curves.loc[3, "error"] = math.nan
    write_csv_files(run, summarise(run), tmp_path)
    table = pd.read_csv(tmp_path / "training.csv")
    assert list(table.columns[-5:]) == ["training", "step", "seconds", "error", "kept"]
    assert set(table["method"]) == {"gpr"}
    both = table.merge(run.curves, on=["result", "training", "step"], suffixes=("", "_raw"))
    assert len(both) == len(table) == len(run.curves) == 2 * run.looks
    for name in ("seconds", "error"):
        assert both[name].to_numpy() == pytest.approx(both[f"{name}_raw"].to_numpy(), rel=1e-6, nan_ok=True)
    assert table["error"].isna().sum() == 1


def test_failed_results_are_listed_with_their_reason(tables):
    results, board = tables["results.csv"], tables["leaderboard.csv"]
    assert results.loc[results["status"] == "failed", "label"].tolist() == ["ulr"]
    row = board[board["label"] == "ulr"].iloc[0]
    assert (row["rooms"], row["failed_rooms"]) == (2, 1)
    assert row["reason"] == "room-000002: MemoryError: <b>no</b> room"


def test_a_setting_that_failed_everywhere_has_a_row(run, tmp_path):
    from gibench.benchmarks.report.summary import summarise
    from tests.benchmarks.report.synthetic import SyntheticRun

    lost = SyntheticRun(run.root, scenes=1, frames=1, failed=("ulr",))
    write_csv_files(lost, summarise(lost), tmp_path)
    board = pd.read_csv(tmp_path / "leaderboard.csv")
    (row,) = board[board["label"] == "ulr"].to_dict("records")
    assert row["status"] == "failed"
    assert "MemoryError" in row["reason"]
    assert math.isnan(row["mean"])


def test_a_traceback_is_told_by_its_last_line():
    assert short_reason("Traceback\n  File x\nValueError: y\n\n") == "ValueError: y"
    assert short_reason("") == short_reason(None) == "no reason was recorded"
