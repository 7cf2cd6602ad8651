"""Runs on Dask with real schedulers, workers and renderers; toys in the place of methods."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from gibench.benchmarks import on_cluster, turns
from gibench.benchmarks.errors import Interrupted
from gibench.benchmarks.orders import Order, ordered_methods
from gibench.benchmarks.registry import Found
from gibench.benchmarks.result_files import RunFolder
from gibench.benchmarks.running import run
from gibench.benchmarks.track import check_track
from gibench.cli import bench_printing
from gibench.datasets.errors import ClusterError, FolderError, MakingError
from gibench.errors import GibenchError
from tests.benchmarks import toys
from tests.benchmarks.conftest import TINY, order
from tests.benchmarks.test_training_on_rooms import track
from tests.clusters import ENVIRONMENT, killed, scheduler, wait_until, worker
from tests.datasets.disks import small_disk

pytest.importorskip("distributed")

#: As those of the fixture `made`.
OVERRIDES = {
    "constant": {"shade": (0.25, 1.0), "style": ("plain", "fancy")},
    "plain": {"shade": (0.5, 2.0)},
}


def files_of(folder: RunFolder) -> dict[str, dict[str, object]]:
    """The frames of all results, by their id."""
    return {id: folder.read_result(id)["files"] for id in folder.ids()}


def left_behind(root) -> list[str]:
    return [path.name for path in root.rglob(".*") if path.name != ".lock"]


def test_two_workers_and_a_local_run_make_the_same_and_go_on_for_each_other(
    workplace, made, scenes_only, copy, capsys
):
    local, _ = made
    asked = order(toys.CONSTANT, toys.PLAIN, overrides=OVERRIDES)
    teller = bench_printing.RunPrinter()
    report = run(scenes_only, replace(asked, cluster=str(workplace)), on_state=teller.show)
    assert (report.made, report.failed, report.workers) == (6, (), 2)
    assert files_of(RunFolder(scenes_only)) == files_of(RunFolder(local))
    assert left_behind(scenes_only) == []
    assert capsys.readouterr().err.count("room-000000") == 6
    records = [RunFolder(scenes_only).read_result(id) for id in report.ids]
    assert {record["prepare"]["beside"] for record in records} == {1}
    assert len({record["frames"][0]["extra"]["process"] for record in records}) == 4
    entry = RunFolder(scenes_only).read_run()["runs"][-1]
    assert (entry["workers"], entry["made"], entry["ended"]) == (2, 6, True)
    bench_printing.print_run(scenes_only, report)
    assert "summed over 2 workers" in " ".join(capsys.readouterr().out.split())

    assert run(scenes_only, asked).made == 0
    for id in copy.ids()[::2]:
        copy.result_file(id).unlink()
    assert run(copy.root, replace(asked, cluster=str(workplace))).made == 3
    assert files_of(copy) == files_of(RunFolder(local))


def test_workers_that_die_lose_nothing_and_a_result_that_kills_three_is_a_failed_one(workplace, scenes_only):
    asked = order(
        toys.DEADLY, toys.PLAIN, overrides={"deadly": {"how": ("once", "always")}}, cluster=str(workplace)
    )
    began = []

    def tell(state):
        # Another run on the folder is refused while this one goes on.
        if state.record is not None and not began:
            began.append(state.record)
            with pytest.raises(FolderError, match="in use by another run"):
                run(scenes_only, asked)

    report = run(scenes_only, asked, on_state=tell)
    folder = RunFolder(scenes_only)
    records = {record["label"]: record for record in map(folder.read_result, folder.ids())}
    reasons = {label: record.get("reason", "") for label, record in records.items()}
    assert began
    assert sorted(record["status"] for record in records.values()) == ["failed", "ok", "ok"], reasons
    (failed,) = report.failed
    assert folder.read_result(failed)["reason"] == (
        "before the preparation: 3 workers that made it died; make it alone to see why"
    )
    assert left_behind(scenes_only) == []


def test_what_goes_wrong_in_a_process_is_a_result_and_a_full_disk_stops_the_run(workplace, scenes_only):
    asked = order(
        toys.WRONG, cluster=str(workplace), overrides={"wrong": {"how": ("segfault", "nan", "well")}}
    )
    report = run(scenes_only, asked)
    assert (report.made, len(report.failed)) == (1, 2)
    reasons = [RunFolder(scenes_only).read_result(id)["reason"] for id in report.failed]
    assert any("killed by SIGSEGV" in reason for reason in reasons), reasons
    full = order(toys.WRONG, cluster=str(workplace), overrides={"wrong": {"how": ("disk",)}})
    with pytest.raises(MakingError, match=r"^wrong room-000000: the disk is full: free some space"):
        run(scenes_only, full)
    assert left_behind(scenes_only) == []
    assert len(RunFolder(scenes_only).ids()) == 3


def test_a_disk_that_is_full_in_truth(workplace, made, scenes_only, tmp_path):
    """Here and for the workers; elsewhere the failure above stands for it."""
    files = [path.stat().st_size for path in scenes_only.rglob("*") if path.is_file()]
    with small_disk(tmp_path / "disk", kilobytes=2000 + sum(size // 1024 + 4 for size in files)) as disk:
        root = Path(shutil.copytree(scenes_only, disk / "run"))
        (disk / "other").write_bytes(bytes(shutil.disk_usage(disk).free - 12 * 1024))
        asked = order(toys.PLAIN, overrides=OVERRIDES, cluster=str(workplace))
        with pytest.raises(GibenchError, match="the disk is full: free some space"):
            run(root, asked)
        assert left_behind(root) == []
        (disk / "other").unlink()
        report = run(root, asked)
        local = files_of(RunFolder(made[0]))
        assert files_of(RunFolder(root)) == {id: local[id] for id in report.ids}
        assert left_behind(root) == []


def endless(cluster) -> Order:
    """One result comes, the next one of that process never does, nor does any limit end it."""
    values = deepcopy(TINY)
    values["presets"]["tiny"]["budget"] = {"prepare": 600, "render": 600}
    overrides = {"wrong": {"how": ("well", "hang")}}
    asked = order(toys.WRONG, toys.CONSTANT, overrides=overrides, cluster=str(cluster))
    return replace(asked, track=check_track(values))


RUN = """
import sys
from pathlib import Path
from gibench.benchmarks.running import run
from tests.benchmarks.test_on_cluster import endless
if __name__ == "__main__":
    run(Path(sys.argv[1]), endless(sys.argv[2]))
"""


def wait_for_the_processes_of(root) -> None:
    """Until none is left in the workers."""
    end = time.monotonic() + 60
    while measuring := [p for p in psutil.process_iter(["cmdline"]) if _is_of(p, root)]:
        assert time.monotonic() < end, measuring
        time.sleep(0.2)


def test_ctrl_c_ends_the_processes_of_the_workers(workplace, scenes_only):
    def stop(state):
        if state.record is not None:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted, match="stopped with 1 of 4 results there; to continue run"):
        run(scenes_only, endless(workplace), on_state=stop)
    wait_for_the_processes_of(scenes_only)
    assert left_behind(scenes_only) == []


def test_a_run_that_is_killed_ends_the_processes_of_the_workers_and_another_goes_on(workplace, scenes_only):
    process = subprocess.Popen(
        [sys.executable, "-c", RUN, scenes_only, workplace], env=ENVIRONMENT, start_new_session=True
    )
    folder = RunFolder(scenes_only)
    try:
        wait_until(lambda: folder.ids() and list(folder.logs.glob("*.log")))
    finally:
        killed(process)
    before = {id: folder.result_file(id).read_bytes() for id in folder.ids()}
    wait_for_the_processes_of(scenes_only)
    report = run(scenes_only, order(toys.CONSTANT, cluster=str(workplace)))
    assert report.made == len(set(report.ids) - before.keys())
    assert {id: folder.result_file(id).read_bytes() for id in before} == before
    assert [entry["ended"] for entry in folder.read_run()["runs"]][-2:] == [False, True]
    assert left_behind(scenes_only) == []


def test_a_scheduler_that_is_killed_and_started_again(made, scenes_only, tmp_path):
    file, replaced = tmp_path / "scheduler.json", []
    processes = [scheduler(file), worker(file, "first", nanny=False)]

    def break_off(state) -> None:
        if state.record is not None and not replaced:
            killed(*processes)
            replaced.append(state.record["id"])
            processes[:] = [scheduler(file), worker(file, "second", nanny=False)]

    try:
        asked = order(toys.PLAIN, overrides=OVERRIDES, cluster=str(file))
        report = run(scenes_only, asked, on_state=break_off)
    finally:
        killed(*processes)
    local = files_of(RunFolder(made[0]))
    assert (report.made, report.failed) == (2, ())
    assert replaced
    assert files_of(RunFolder(scenes_only)) == {id: local[id] for id in report.ids}
    assert left_behind(scenes_only) == []


def _is_of(process: psutil.Process, root) -> bool:
    """Whether a process writes a log of the run: the one that makes a result does."""
    try:
        return any(str(root) in file.path for file in process.open_files())
    except psutil.Error:
        return False


def test_workers_that_cannot_be_used_are_named_before_anything_is_made(workplace, tmp_path, monkeypatch):
    root = tmp_path / "run"
    other = Found(toys.card("Plain"), "toys", "2.0")
    asked = order(other, cluster=str(workplace))
    monkeypatch.setattr(on_cluster, "code_version", lambda found: {"package": "toys 3.0"})
    with pytest.raises(
        ClusterError, match=r"worker tcp\S+ cannot be used: method 'plain' is another there \(pack"
    ):
        run(root, asked)
    for wrong, why in (
        ("local:0", "write local:N"),
        (str(tmp_path / "no.json"), "there is no scheduler file"),
    ):
        with pytest.raises(ClusterError, match=why):
            run(root, replace(asked, cluster=wrong))
    assert not root.exists()


def test_one_kind_of_machine_measures_and_the_others_are_told(tmp_path, monkeypatch):
    facts = {"cpu": "A", "cores": 2, "threads": 2, "gpu": None, "variant": "v", "versions": {}}
    answers = {
        "tcp://1": ("one", facts),
        "tcp://2": ("two", facts | {"cpu": "B"}),
        "tcp://3": ("three", facts | {"cpu": "B"}),
    }
    monkeypatch.setattr(on_cluster, "facts_of_workers", lambda setup, **_: answers)
    said = []

    class Doing:
        order, folder, run = order(toys.PLAIN), RunFolder(tmp_path), {}
        remark = said.append

    crew = on_cluster.Crew("tcp://s")
    assert crew.examined(Doing)["cpu"] == "B"
    assert said == ["1 workers make rooms only, as they are other machines (A, 2 threads)"]
    assert crew.workers == 3
    Doing.run = {"machine": {"id": on_cluster.machines.digest(facts)}, "machines": {}}
    assert crew.examined(Doing)["cpu"] == "A"  # a run that was begun goes on where it was measured


def test_rooms_trainings_and_results_from_nothing_on_a_cluster_of_this_machine(no_patience, tmp_path):
    """Among them a training whose worker hangs, which another does, and one that takes three workers with it."""
    root, told = tmp_path / "run", []
    hows = {"learner": {"how": ("stopping", "deadly", "failing")}}
    chosen = ordered_methods(track(), "tiny", [toys.LEARNER], hows)
    asked = Order(track=track(), preset="tiny", methods=chosen, rooms=1, cluster="local:2")
    report = run(root, asked, on_state=lambda state: told.append(state.training))
    folder = RunFolder(root)
    records = [folder.read_result(id) for id in folder.ids()]
    assert sorted(record["status"] for record in records) == ["failed", "failed", "ok"]
    assert [training["method"] for training in told if training] == ["learner"]
    assert len(list(folder.bakes("rooms").glob("training-*/mean.txt"))) == 1
    assert {folder.read_result(id)["reason"] for id in report.failed} == {
        "in the training: ValueError: nothing to learn",
        "in the training: 3 workers that made it died; make it alone to see why",
    }
    assert (root / "bakes" / "stopped").read_text() == "x"
    assert (root / "bakes" / "killed").read_text() == "xxx"
    assert {record["machine"]["threads"] for record in records} == {max(1, (os.cpu_count() or 1) // 2)}
    assert left_behind(root) == []


def test_who_measures_is_alone(tmp_path):
    file, waits = tmp_path / "turns", []
    with turns.beside(file), turns.beside(file):
        pass
    with turns.alone(file, lambda: waits.append(1)):
        child = os.fork()
        if not child:
            code = 1
            try:
                signal.alarm(1)  # it would wait
                with turns.beside(file):
                    code = 0
            finally:
                os._exit(code)
        _, status = os.waitpid(child, 0)
        assert os.WIFSIGNALED(status)
    assert waits == [1]
    with turns.alone(None, lambda: waits.append(2)):
        pass
    assert waits == [1]
