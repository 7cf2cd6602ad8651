"""What of the page can be told without a browser."""

import json
import re

from gibench.benchmarks.report import write_report
from gibench.benchmarks.report.page import page_data, write_page
from gibench.benchmarks.report.summary import summarise
from tests.benchmarks.report.synthetic import Setting, SyntheticRun


def data_in(path):
    text = path.read_text()
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)[1])


def test_the_page_asks_nothing_of_a_network(page_file):
    text = page_file.read_text()
    assert not re.findall(r"""(?:src|href)=["'](?!#|data:,)(?![a-z]+\.csv)[^"']*""", text)
    addresses = set(re.findall(r"https?://[^\s\"'<>)]+", text))
    assert addresses <= {"http://www.w3.org/2000/svg"}  # the name of a namespace, never loaded
    assert "@import" not in text
    assert "fetch(" not in text


def test_words_of_methods_and_tracebacks_cannot_end_the_script(run, tmp_path):
    bad = SyntheticRun(run.root, scenes=1, frames=1, failed=("ulr",))
    bad.results.loc[bad.results["label"] == "ulr", "reason"] = "</script><script>alert(1)</script><!--\u2028"
    path = write_page(bad, summarise(bad), tmp_path)
    reasons = [result["reason"] for result in data_in(path)["results"] if result["reason"]]
    assert reasons == ["</script><script>alert(1)</script><!--\u2028"]
    assert path.read_text().count("</script>") == 2


def test_the_numbers_on_the_page_are_those_of_the_run(run, summary, page_file):
    data = data_in(page_file)
    by_id = {result["id"]: result for result in data["results"]}
    for row in run.frames.itertuples():
        scene = next(scene for scene in data["scenes"] if scene["id"] == run.of[row.result][1])
        shown = by_id[row.result]["series"][f"{row.part}/{row.metric}"][scene["frames"].index(row.frame)]
        assert abs(shown - row.value) <= 1e-3 * abs(row.value)
    scores = summary.scores.set_index(["entry", "part", "metric"])
    for entry, shown in enumerate(data["entries"]):
        for name, (mean, low, high, *_) in shown["scores"].items():
            row = scores.loc[(entry, *name.split("/"))]
            for value, expected in ((mean, row["mean"]), (low, row["low"]), (high, row["high"])):
                assert abs(value - expected) <= 1e-3 * abs(expected)


def test_what_is_not_finite_is_no_number_on_the_page(run):
    lost = SyntheticRun(run.root, scenes=1, frames=2)
    lost.frames.loc[lost.frames["metric"] == "psnr", "value"] = float("inf")
    data = page_data(lost, summarise(lost))
    assert all(result["series"]["full/psnr"] == [None, None] for result in data["results"])
    json.dumps(data, allow_nan=False)


def test_a_run_that_failed_everywhere_still_has_a_page(run, tmp_path):
    labels = tuple(setting.label for setting in run.settings)
    lost = SyntheticRun(run.root, scenes=1, frames=1, failed=labels)
    data = data_in(write_report(lost, tmp_path))
    assert data["metrics"] == []
    assert all("MemoryError" in result["reason"] for result in data["results"])


def test_gaps_in_the_frames_are_gaps_in_the_series(run):
    gaps = SyntheticRun(run.root, scenes=1, frames=3)
    first = gaps.results["result"].iloc[0]
    gaps.frames = gaps.frames[(gaps.frames["result"] != first) | (gaps.frames["frame"] != 1)]
    data = page_data(gaps, summarise(gaps))
    shown = next(result for result in data["results"] if result["id"] == first)["series"]["full/rmse"]
    assert shown[1] is None
    assert shown[0] is not None


def test_trainings_keep_their_ends_and_their_best_look(run, tmp_path):
    assert page_data(run, summarise(run))["trainings"] == []
    trained = SyntheticRun(tmp_path, chosen=[Setting("a", kind="network")], scenes=1, frames=1, looks=700)
    trained.curves.loc[501, "error"] = 1e-3
    trained.curves.loc[0, "error"] = float("nan")
    (shown,) = page_data(trained, summarise(trained))["trainings"]
    assert len(shown["steps"]) == len(shown["seconds"]) == len(shown["errors"]) in (100, 101)
    assert (shown["steps"][0], shown["steps"][-1], shown["steps"][shown["best"]]) == (0, 69900, 50100)
    assert (shown["errors"][0], shown["errors"][shown["best"]]) == (None, 1e-3)
    assert (shown["scenes"], shown["seed"], shown["family"]) == (("room-000000",), 1, "a")
    json.dumps(shown, allow_nan=False)


def test_the_page_knows_stills_from_sequences(run, tmp_path):
    stills = SyntheticRun(tmp_path, scenes=1, frames=3, stills=2, measured=False)
    (scene,) = page_data(stills, summarise(stills))["scenes"]
    assert scene["sequences"] == ["", "", "walk"]


def test_metrics_stand_as_the_track_lists_them_and_others_after_them(run, tmp_path):
    listing = SyntheticRun(tmp_path)
    listing.run = {**listing.run, "metrics": ["psnr", "rmse"]}
    data = page_data(listing, summarise(listing))
    names = [metric["name"] for metric in data["metrics"]]
    assert names[:2] == ["psnr", "rmse"]
    assert sorted(names) == sorted({row["metric"] for _, row in summarise(run).scores.iterrows()})
