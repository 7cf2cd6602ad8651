"""Runs with the real generators, the real renderer and toys in the place of methods."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gibench.benchmarks import machine, running, worker
from gibench.benchmarks.errors import Interrupted, ResultsError, RunError, TrackError
from gibench.benchmarks.orders import ordered_methods
from gibench.benchmarks.result_files import RunFolder, key_of
from gibench.benchmarks.results import load
from gibench.benchmarks.running import run
from gibench.benchmarks.track import check_track
from gibench.datasets.errors import FolderError
from gibench.datasets.verifying import verify
from tests.benchmarks import toys
from tests.benchmarks.conftest import TINY, order


def stamps(root: Path) -> dict[str, int]:
    return {
        str(path.relative_to(root)): path.stat().st_mtime_ns
        for path in (root / "results").rglob("*")
        if path.is_file()
    }


def test_a_run_makes_what_was_asked_for(made):
    root, report = made
    folder = RunFolder(root)
    assert len(folder.ids()) == 6 == len(report.ids)
    assert set(folder.ids()) == set(report.ids)
    assert report.failed == ()
    assert verify(folder.dataset("reference")) == []
    assert verify(folder.dataset("reference-again")) == []
    assert verify(folder.dataset("training")) == []
    assert not list(root.rglob("*partial*"))
    assert not (root / ".lock").exists()
    seconds = report.seconds
    assert seconds["harness"] == pytest.approx(
        seconds["total"] - sum(seconds[name] for name in ("scenes", "prepare", "render", "score"))
    )
    assert folder.read_run()["runs"][0]["seconds"] == seconds


def test_a_result_says_all_that_decides_it(made):
    folder = RunFolder(made[0])
    for id in folder.ids():
        record = folder.read_result(id)
        assert record["key"] == key_of(record["config"])
        assert record["id"] == record["key"][:16]
        config = record["config"]
        assert config["resolution"] == [20, 14]
        assert config["frames"] == 3 == len(record["frames"])
        assert len(config["code"]["sources"]) == 16
        assert record["machine"]["cpu"]
        assert record["machine"]["threads"] >= 1
        assert {"mitsuba", "drjit", "llvm", "python", "numpy"} <= set(record["machine"]["versions"])
        for frame in record["frames"]:
            assert 0 < sum(frame["stages"].values(), 1e-9) <= frame["seconds"] + 1e-9
        assert sorted(record["files"]) == ["0000.exr", "0001.exr", "0002.exr"]
    assert (config["training"] is None) == (config["method"] == "plain")


def test_one_preparation_serves_all_settings_that_do_not_bake(results):
    process = {
        row.label: {frame["extra"]["process"] for frame in results.record(row.result)["frames"]}
        for row in results.results.itertuples()
    }
    assert all(len(processes) == 1 for processes in process.values())
    plain, fancy = process["constant shade=0.25"], process["constant shade=0.25 fancy"]
    assert plain == process["constant shade=1"]
    assert fancy == process["constant shade=1 fancy"]
    assert plain != fancy
    # What cannot be adjusted is prepared anew.
    assert process["plain shade=0.5"] != process["plain shade=2"]


def test_preparation_and_memory_are_booked(results):
    table = results.results.set_index("label")
    constant, plain = table.loc["constant shade=1"], table.loc["plain shade=2"]
    assert constant["prepare_lightmap_s"] >= 0.05
    assert constant["bytes"] == 1000
    assert constant["prepare_training_s"] >= 0.02
    assert constant["prepare_references_s"] > 0  # one view was read
    record = results.record(constant["result"])
    assert record["prepare"]["training_views_read"] == 1
    assert plain["prepare_references_s"] == plain["bytes"] == 0
    assert 50 < plain["peak_mb"] < 5000
    parts = ["lightmap", "probes", "references", "training", "other"]
    assert record["prepare"]["seconds"] == pytest.approx(sum(record["prepare"][part] for part in parts))


def test_running_again_changes_nothing(made):
    before = stamps(made[0])
    overrides = {
        "constant": {"shade": (0.25, 1.0), "style": ("plain", "fancy")},
        "plain": {"shade": (0.5, 2.0)},
    }
    again = run(made[0], order(toys.CONSTANT, toys.PLAIN, overrides=overrides))
    assert again.made == 0
    assert set(again.ids) == set(made[1].ids)
    assert stamps(made[0]) == before


def test_a_run_is_continued_where_it_stopped(copy):
    lost = copy.ids()[2]
    copy.result_file(lost).unlink()  # as if killed between the frames and the result
    kept = {name: when for name, when in stamps(copy.root).items() if lost not in name}
    overrides = {
        "constant": {"shade": (0.25, 1.0), "style": ("plain", "fancy")},
        "plain": {"shade": (0.5, 2.0)},
    }
    report = run(copy.root, order(toys.CONSTANT, toys.PLAIN, overrides=overrides))
    assert report.made == 1
    assert lost in copy.ids()
    assert {name: when for name, when in stamps(copy.root).items() if lost not in name} == kept


def test_everything_that_goes_wrong_is_a_result_and_the_run_goes_on(scenes_only):
    values = (*toys.HOWS, "well")
    report = run(scenes_only, order(toys.WRONG, overrides={"wrong": {"how": values}}))
    assert report.made == 1
    assert len(report.failed) == len(toys.HOWS)
    results = load(scenes_only)
    said = {json.loads(row.knobs)["how"]: results.record(row.result) for row in results.results.itertuples()}
    for how, reason in {
        "crash": "while rendering: RuntimeError: the roof fell in",
        "segfault": "its process was killed by SIGSEGV",
        "exit": "its process ended with code 3",
        "nan": "frame 1: color is not finite in 1 of 280 pixels, first at row 2, column 3",
        "infinite": "frame 1: color is not finite",
        "negative": "frame 1: color is negative in 1 of 280 pixels",
        "shape": r"frame 1: color has shape \(14, 19, 3\), asked for was \(14, 20, 3\)",
        "integers": "frame 1: color is uint8",
        "none": "frame 1: render returned NoneType, not a Prediction",
    }.items():
        assert said[how]["status"] == "failed"
        assert re.search(reason, said[how]["reason"]), said[how]["reason"]
        assert said[how]["phase"] == "render"
    assert 'raise RuntimeError("the roof' in said["crash"]["traceback"]
    assert (
        "ctypes.string_at(0)" in said["segfault"]["traceback"] or "in render" in said["segfault"]["traceback"]
    )
    assert "getting ready" in said["crash"]["log"]
    assert said["well"]["status"] == "ok"
    folder = RunFolder(scenes_only)
    assert [path.name for path in folder.results.iterdir() if path.is_dir()] == [said["well"]["id"]]

    before = stamps(scenes_only)
    again = run(scenes_only, order(toys.WRONG, overrides={"wrong": {"how": values}}))
    assert (again.made, len(again.failed)) == (0, len(toys.HOWS))
    assert stamps(scenes_only) == before
    wanted = order(toys.WRONG, overrides={"wrong": {"how": ("exit", "well")}}, retry_failed=True)
    retried = run(scenes_only, wanted)
    assert (retried.made, len(retried.failed)) == (0, 1)
    aside = list((scenes_only / "set-aside").iterdir())
    assert [path.name for path in aside] == [f"{said['exit']['id']}-0.json"]
    assert json.loads(aside[0].read_text()) == said["exit"]


def test_a_preparation_that_fails_fails_for_all_its_settings(scenes_only):
    report = run(scenes_only, order(toys.WRONG, overrides={"wrong": {"how": ("unprepared", "well")}}))
    assert len(report.failed) == 2
    results = load(scenes_only).results
    assert set(results["reason"]) == {"in the preparation: ValueError: no bricks"}
    assert results["ms_median"].isna().all()


def test_a_method_that_hangs_is_stopped_and_says_where(scenes_only):
    wanted = order(toys.WRONG, overrides={"wrong": {"how": ("hang", "well")}})
    values = json.loads(json.dumps(TINY))
    values["presets"]["tiny"]["budget"]["render"] = 2
    report = run(scenes_only, replace(wanted, track=check_track(values)))
    assert (report.made, len(report.failed)) == (1, 1)
    record = load(scenes_only).record(report.failed[0])
    assert record["reason"] == "while rendering: it took more than 2 s, the track's limit"
    assert "in render" in record["traceback"]


def test_a_failure_that_is_the_disks_is_told_from_one_of_the_method(tmp_path, monkeypatch):
    full = OSError(28, "No space left on device")
    assert worker.disk_refused(full, tmp_path)
    wrapped = RuntimeError("unexpected pos 64 vs 0")
    wrapped.__context__ = full  # as torch does
    assert worker.disk_refused(wrapped, tmp_path)
    lost = RuntimeError("Failed to write pixel data to image file")
    assert not worker.disk_refused(lost, tmp_path / "not" / "there")
    monkeypatch.setattr(
        worker.shutil, "disk_usage", lambda place: shutil._ntuple_diskusage(10**9, 10**9 - 4096, 4096)
    )
    assert worker.disk_refused(lost, tmp_path / "not" / "there")


def test_a_full_disk_stops_the_run_and_leaves_no_half_files(scenes_only):
    with pytest.raises(RunError, match="the disk is full: free some space, then run the same command again"):
        run(scenes_only, order(toys.WRONG, overrides={"wrong": {"how": ("well", "disk")}}))
    folder = RunFolder(scenes_only)
    assert len(folder.ids()) == 1
    assert not list(scenes_only.rglob("*partial*"))
    last = folder.read_run()["runs"][-1]
    assert (last["ended"], last["made"]) == (False, 1)


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="needs process groups")
def test_fewer_rooms_than_a_run_began_with(tmp_path, monkeypatch):
    """Stopped after the first reference of two rooms: the second has to be of both, though one is asked for now."""
    make, calls = running.make, []

    def stopped(*arguments, **options):
        calls.append(arguments)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return make(*arguments, **options)

    monkeypatch.setattr(running, "make", stopped)
    with pytest.raises(Interrupted):
        run(tmp_path / "run", order(toys.PLAIN, rooms=2))
    monkeypatch.setattr(running, "make", make)
    run(tmp_path / "run", order(toys.PLAIN, rooms=1))
    assert {record["room"] for record in load(tmp_path / "run").records()} == {0}


def test_ctrl_c_is_tidy_and_says_how_to_continue(scenes_only):
    code = (
        "from tests.benchmarks import toys; from tests.benchmarks.conftest import order\n"
        "from gibench.benchmarks.running import run; from pathlib import Path\n"
        "if __name__ == '__main__':\n"
        "    o = order(toys.WRONG, overrides={'wrong': {'how': ('well', 'hang')}})\n"
        f"    told = Path({str(scenes_only.parent / 'told')!r})\n"
        f"    run(Path({str(scenes_only)!r}), o, on_state=lambda state: state.record and told.touch())\n"
    )
    script = scenes_only.parent / "interrupted.py"
    script.write_text(code)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    process = subprocess.Popen(
        [sys.executable, str(script)],
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    )
    folder = RunFolder(scenes_only)
    end = time.monotonic() + 120
    while not (scenes_only.parent / "told").exists():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert (
        "Interrupted: stopped with 1 of 2 results there; to continue run `gibench bench run --out R`" in said
    )
    assert len(folder.ids()) == 1
    assert not list(scenes_only.rglob("*partial*"))
    assert not (scenes_only / ".lock").exists()


def test_an_interrupt_is_the_named_one():
    assert issubclass(Interrupted, RunError)


def test_another_preset_or_seed_is_refused_with_what_differs(made):
    values = json.loads(json.dumps(TINY))
    values["presets"]["tiny"]["room"]["resolution"] = [24, 14]
    with pytest.raises(
        ResultsError, match=r"holds a run with another reference .*to continue it run `gibench bench"
    ):
        run(made[0], replace(order(toys.PLAIN), track=check_track(values)))
    values = json.loads(json.dumps(TINY))
    values["presets"]["other"] = values["presets"]["tiny"]
    with pytest.raises(ResultsError, match="another preset \\(tiny, asked was other\\)"):
        run(made[0], replace(order(toys.PLAIN), track=check_track(values), preset="other"))


def test_folders_that_cannot_be_used(tmp_path, made):
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(FolderError, match=r"holds files but no results \(thesis\.tex"):
        run(tmp_path, order(toys.PLAIN))
    with pytest.raises(FolderError, match="cannot be written"):
        run(tmp_path / "thesis.tex" / "r", order(toys.PLAIN))
    with RunFolder(made[0]).claimed(), pytest.raises(FolderError, match="is in use by another run"):
        run(made[0], order(toys.PLAIN))


def test_a_channel_that_the_training_views_lack_is_named_with_how_to_make_it():
    needy = toys.found("Plain", channels=("surface",))
    with pytest.raises(
        TrackError, match=r"'plain' needs channel position, .* does not store: copy the track .*--show"
    ):
        ordered_methods(check_track(TINY), "tiny", [needy], {})
    stranger = toys.found("Plain", tracks=("relight",))
    with pytest.raises(TrackError, match="does not run on track walkthrough, but on relight"):
        ordered_methods(check_track(TINY), "tiny", [stranger], {})


def test_trained_methods_run_every_seed_and_others_the_first(made, tmp_path):
    doing = running.Run(RunFolder(made[0]), order(toys.PLAIN, seeds=(3, 5)), lambda state: None)
    doing.prepare()
    trained = toys.found("Plain", id="trained", trained=True)
    choice = [(found, order(found).methods[0][1]) for found in (toys.PLAIN, trained)]
    seeds = [(job.config["method"], job.seed) for job in doing.jobs(choice)]
    assert seeds == [("plain", 3), ("trained", 3), ("trained", 5)]


def test_the_scene_the_code_the_machine_and_the_knobs_enter_the_key(made):
    doing = running.Run(RunFolder(made[0]), order(toys.PLAIN), lambda state: None)
    doing.prepare()
    (job,) = doing.jobs(doing.order.methods)
    for name, value in {
        "scene_sha256": "0",
        "machine": "other",
        "knobs": {"shade": 9.0},
        "seed": 7,
        "code": {"sources": "edited"},
        "warmup": 9,
    }.items():
        assert key_of({**job.config, name: value}) != job.key
    assert key_of(dict(reversed(job.config.items()))) == job.key


def test_machines_differ_by_what_times_depend_on():
    facts = {
        "cpu": "a",
        "cores": 2,
        "threads": 2,
        "gpu": None,
        "variant": "llvm_ad_rgb",
        "versions": {"mitsuba": "3"},
        "memory": 1,
        "platform": "x",
    }
    for name, value in {"cpu": "b", "threads": 1, "gpu": "H200", "versions": {"mitsuba": "4"}}.items():
        assert machine.digest({**facts, name: value}) != machine.digest(facts)
    assert machine.digest({**facts, "memory": 2, "platform": "y"}) == machine.digest(facts)


def test_predictions_of_a_frame_do_not_depend_on_the_warmup(results):
    label = results.results.set_index("label")["result"]
    image = results.prediction(label["plain shade=2"], 0)
    assert image.shape == (14, 20, 3)
    np.testing.assert_array_equal(image, 2.0)


def test_leftovers_of_killed_runs_go(copy):
    (copy.results / ".0123456789abcdef.partial").mkdir()
    bakes = copy.bakes("room-000000")
    (bakes / f".probes-{24 * 'a'}.partial-1").mkdir()
    (copy.results / "0123456789abcdef").mkdir()
    (copy.scores / ".a.json.partial-1").touch()
    with copy.claimed():
        pass
    assert not list(copy.root.rglob("*partial*"))
    assert not (copy.results / "0123456789abcdef").exists()
    shutil.rmtree(copy.root)
