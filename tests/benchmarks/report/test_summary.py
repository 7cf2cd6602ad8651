import json
import math

import numpy as np
import pandas as pd
import pytest

from gibench.benchmarks.report.source import ReportError
from gibench.benchmarks.report.summary import machine_names, noise_size, summarise
from gibench.metrics import METRICS, mean_interval, paired_difference
from tests.benchmarks.report.synthetic import Setting, SyntheticRun


def score(summary, label, metric="rmse", part="full", machine=None):
    entries = summary.entries[summary.entries["label"] == label]
    if machine is not None:
        entries = entries[entries["machine"] == machine]
    (entry,) = entries.index
    scores = summary.scores
    (row,) = scores[
        (scores["entry"] == entry) & (scores["metric"] == metric) & (scores["part"] == part)
    ].to_dict("records")
    return row


def raw(run, label, metric="rmse", part="full"):
    table = run.frames.merge(run.results[["result", "label", "scene"]], on="result")
    return table[(table["label"] == label) & (table["metric"] == metric) & (table["part"] == part)]


def test_means_are_those_of_the_metrics_module(run, summary):
    own = raw(run, "rtrt").sort_values(["scene", "frame"])
    expected = mean_interval(own["value"], own["scene"])
    found = score(summary, "rtrt")
    assert (found["mean"], found["low"], found["high"]) == (expected.mean, expected.low, expected.high)
    assert (found["rooms"], found["frames"], found["left_out"]) == (3, 9, 0)


def test_differences_are_paired_on_the_frames_that_both_have(run, summary):
    first, second = (
        raw(run, label).set_index(["scene", "frame"])["value"].sort_index() for label in ("ulr", "rtrt")
    )
    both = first.index  # ulr failed in one room, which rtrt has
    expected = paired_difference(first, second.loc[both], both.get_level_values("scene"))
    found = score(summary, "ulr")
    assert found["difference"] == expected.mean
    assert (found["difference_low"], found["difference_high"]) == (expected.low, expected.high)
    assert found["verdict"] == "worse"
    assert score(summary, "rtrt")["difference"] == 0
    assert score(summary, "rtrt")["verdict"] == "unsure"
    assert score(summary, "path-traced spp=16", metric="psnr")["verdict"] == "better"  # higher is better


def test_a_difference_below_the_noise_floor_is_not_called_one(run):
    class Noisy(SyntheticRun):
        @property
        def floor(self):
            return super().floor.assign(value=1e3)

    found = summarise(Noisy(run.root, frames=3), against="rtrt")
    assert score(found, "lightmap")["verdict"] == "below the noise floor"
    # PSNR has no floor that differences could be held against: infinite for equal images.
    assert score(found, "lightmap", metric="psnr")["verdict"] == "worse"


def test_the_size_of_noise_is_the_distance_from_equal_images():
    assert noise_size(METRICS["ssim"], 0.97) == pytest.approx(0.03)
    assert noise_size(METRICS["rmse"], 0.02) == 0.02
    assert math.isnan(noise_size(METRICS["psnr"], 40))
    assert math.isnan(noise_size(METRICS["rmse"], math.nan))


def test_a_setting_that_failed_in_a_room_says_so(summary):
    row = summary.entries.set_index("label").loc["ulr"]
    assert (row["rooms"], row["failed_rooms"]) == (2, 1)
    assert score(summary, "ulr")["rooms"] == 2


def test_a_setting_that_failed_everywhere_stays_on_the_board(run):
    everywhere = SyntheticRun(run.root, scenes=1, frames=2, failed=("ulr",))
    summary = summarise(everywhere)
    (entry,) = summary.entries.index[summary.entries["label"] == "ulr"]
    assert summary.entries.loc[entry, "rooms"] == 0
    assert math.isnan(summary.entries.loc[entry, "ms_median"])
    assert entry not in set(summary.scores["entry"])


def test_frames_without_a_finite_value_are_left_out_and_counted(run):
    class Undefined(SyntheticRun):
        @property
        def frames(self):
            table = super().frames.copy()
            chosen = (table["metric"] == "psnr") & (table["frame"] == 1)
            table.loc[chosen, "value"] = np.where(np.arange(chosen.sum()) % 2, np.inf, np.nan)
            return table

    found = score(summarise(Undefined(run.root, frames=3)), "rtrt", metric="psnr")
    assert (found["frames"], found["left_out"]) == (6, 3)
    assert math.isfinite(found["mean"])


def test_seeds_are_averaged_frame_by_frame(run):
    once = summarise(run)
    twice = SyntheticRun(run.root, frames=3, failed=("ulr",))
    first, values = twice.results, twice.frames
    twice.results = pd.concat([first, first.assign(seed=2, result="b" + first["result"])], ignore_index=True)
    again = values.assign(result="b" + values["result"], value=values["value"] + 1)
    twice.frames = pd.concat([values, again], ignore_index=True)
    twice = summarise(twice)
    assert score(twice, "rtrt")["mean"] == pytest.approx(score(once, "rtrt")["mean"] + 0.5)
    assert score(twice, "rtrt")["frames"] == score(once, "rtrt")["frames"]
    assert twice.entries.set_index("label").loc["rtrt", "seeds"] == 2


def test_a_room_where_one_seed_failed_or_was_not_run_is_no_part_of_a_mean(run):
    twice = SyntheticRun(run.root, frames=3)
    first, values = twice.results, twice.frames
    second = first.assign(seed=2, result="b" + first["result"])
    lost = (second["label"] == "ulr") & (second["scene"] == "room-000001")
    second.loc[lost, ["status", "reason"]] = ["failed", "no"]
    second = second[(second["label"] != "isg") | (second["scene"] == "room-000000")]
    twice.results = pd.concat([first, second], ignore_index=True)
    again = values.assign(result="b" + values["result"])
    there = set(second.loc[second["status"] == "ok", "result"])
    twice.frames = pd.concat([values, again[again["result"].isin(there)]], ignore_index=True)
    twice = summarise(twice)
    rows = twice.entries.set_index("label")
    for label, rooms, failed_rooms in (("ulr", 2, 1), ("isg", 1, 0), ("rtrt", 3, 0)):
        assert (rows.loc[label, "rooms"], rows.loc[label, "failed_rooms"]) == (rooms, failed_rooms)
        assert score(twice, label)["rooms"] == rooms


def test_machines_have_rows_of_their_own(run):
    summary = summarise(SyntheticRun(run.root, frames=2, scenes=2, machines=("aaaaaaaa", "bbbbbbbb")))
    assert len(summary.machines) == 2
    assert (summary.entries.groupby("label")["machine"].nunique() == 2).all()


def test_machines_are_named_by_what_they_are():
    facts = {
        "a1": {"cpu": "Xeon", "gpu": None, "threads": 2},
        "b2": {"cpu": "Xeon", "gpu": "H200", "threads": 2},
    }
    assert machine_names({"machines": facts}, ["a1", "b2"]) == {
        "a1": "Xeon, 2 threads",
        "b2": "Xeon, H200, 2 threads",
    }
    twins = {"a1ffffff": facts["a1"], "b2ffffff": facts["a1"]}
    assert machine_names({"machines": twins}, list(twins))["a1ffffff"] == "Xeon, 2 threads (a1ffff)"
    assert machine_names({}, ["odd"]) == {"odd": "odd"}


def test_a_curve_joins_the_settings_that_differ_in_one_number(summary):
    curves = summary.entries.set_index("label")["curve"]
    assert curves["path-traced spp=1"] == curves["path-traced"] == "path-traced"
    assert curves["path-traced spp=16 oidn"] == curves["path-traced oidn"] == "path-traced oidn"
    assert curves["rtrt"] == "rtrt"
    steps = summary.entries.set_index("label")["step"]
    assert steps["path-traced oidn"] == "4 spp"
    assert steps["rtrt"] == ""


def test_of_two_numbers_the_one_with_more_values_makes_the_curve(tmp_path):
    chosen = [
        Setting("m", {"spp": spp, "rays": rays}, f"spp={spp} rays={rays}")
        for spp in (1, 2, 4)
        for rays in (1, 4)
    ]
    curves = summarise(SyntheticRun(tmp_path, chosen=chosen, scenes=1, frames=1, measured=False)).entries[
        "curve"
    ]
    assert sorted(set(curves)) == ["m rays=1", "m rays=4"]


@pytest.mark.parametrize(
    ("asked", "said"), [("rtr", "the nearest are: rtrt"), ("path-traced oid", "path-traced oidn")]
)
def test_an_unknown_setting_is_told_the_nearest(run, asked, said):
    with pytest.raises(ReportError, match=said):
        summarise(run, against=asked)


def test_a_method_stands_for_its_only_setting_and_not_for_several(tmp_path):
    chosen = [
        Setting("one", {"k": 1}, "k=1"),
        Setting("two", {"k": 1}, "k=1"),
        Setting("two", {"k": 2}, "k=2"),
    ]
    run = SyntheticRun(tmp_path, chosen=chosen, scenes=1, frames=1, measured=False)
    assert summarise(run, against="one").against == "one k=1"
    with pytest.raises(ReportError, match="two has several settings; choose one of: two k=1, two k=2"):
        summarise(run, against="two")


def test_a_run_without_results_or_scores_says_what_to_do(run, tmp_path):
    with pytest.raises(ReportError, match="no results to report"):
        summarise(SyntheticRun(tmp_path, chosen=[Setting("m")], scenes=0))

    class Unscored(SyntheticRun):
        @property
        def frames(self):
            return super().frames.iloc[:0]

    with pytest.raises(ReportError, match="gibench bench score"):
        summarise(Unscored(tmp_path, frames=1, scenes=1))


def test_knobs_that_are_no_json_object_make_no_curve(tmp_path):
    run = SyntheticRun(tmp_path, chosen=[Setting("m", {"spp": 1})], scenes=1, frames=1, measured=False)
    run.results["knobs"] = json.dumps([1])
    assert summarise(run).entries["curve"].tolist() == ["m"]
