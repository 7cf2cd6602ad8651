"""Rooms on Dask, with real schedulers and worker processes; only the renderer is a fake."""

from __future__ import annotations

import contextlib
import hashlib
import os
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

import pytest

from gibench.cli import run
from gibench.cli.app import make_app
from gibench.datasets import cluster, cluster_opening, cluster_workers, folder, open_dataset, pool
from gibench.datasets.cluster_opening import refuse_other
from gibench.datasets.errors import ClusterError, FolderError, Interrupted, MakingError
from gibench.datasets.making import make
from gibench.datasets.pool import Report
from gibench.datasets.room_making import RoomMaker
from tests.clusters import ENVIRONMENT, dask, idle, killed, scheduler, wait_until
from tests.datasets.disks import small_disk
from tests.datasets.fakes import Broken, Killed, Setup, fake_work, tiny

pytest.importorskip("distributed")


def frames_of(root: Path) -> dict[str, str]:
    return {
        str(path.relative_to(root)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(root.glob("rooms/0*/frames/*.exr"))
    }


@pytest.fixture(scope="module")
def made_locally(tmp_path_factory) -> dict[str, str]:
    """Frames of six rooms."""
    root = tmp_path_factory.mktemp("local") / "d"
    make(root, tiny(6), work=fake_work(root, tiny(6)))
    return frames_of(root)


def first(rooms: int, frames: dict[str, str]) -> dict[str, str]:
    """Those of so many rooms."""
    return {name: content for name, content in frames.items() if int(name.split("/")[1]) < rooms}


def left_behind(root: Path) -> list[str]:
    return [p.name for p in [*root.iterdir(), *(root / "rooms").iterdir()] if p.name.startswith(".")]


def names_on_the_dashboard(file: Path) -> set[str]:
    """Of the tasks in hand, shortened as Dask's plots do."""
    from dask.utils import key_split
    from distributed import Client

    with Client(scheduler_file=str(file), set_as_default=False) as client:
        return {key_split(key) for keys in client.processing().values() for key in keys}


@dataclass
class Stopped:
    """A job whose worker is stopped in the middle of one room, the first time."""

    job: RoomMaker
    room: int

    def __call__(self, room: int, report: Report):
        mark = self.job.root.parent / "stopped"
        if room == self.room and not mark.exists():
            mark.write_text(str(os.getpid()))
            os.kill(os.getpid(), signal.SIGSTOP)
        return self.job(room, report)


def test_a_cluster_of_this_machine_and_a_local_run_make_the_same_and_go_on_for_each_other(
    no_patience, made_locally, tmp_path
):
    """Though a worker hangs: it is given up, and its room made by another."""
    root = tmp_path / "both"
    work = pool.Work(Setup(), Stopped(RoomMaker(root, tiny(4)), 1))
    summary = make(root, tiny(4), cluster="local:2", work=work)
    assert (tmp_path / "stopped").exists()
    assert (summary.made, summary.frames) == (4, 8)
    assert left_behind(root) == []
    make(root, tiny(6), work=fake_work(root, tiny(6)))
    assert frames_of(root) == made_locally
    assert open_dataset(root).manifest["complete"]


def test_a_worker_of_a_cluster_of_this_machine_is_looked_for_every_second():
    """So what is given up after a minute of silence has been silent for no second one."""
    from distributed import Client

    def limits(dask_scheduler) -> tuple[float, float]:
        return dask_scheduler.worker_ttl, dask_scheduler.periodic_callbacks["worker-ttl"].callback_time

    with cluster_opening.opened("local:1") as address, Client(address, set_as_default=False) as client:
        assert client.run_on_scheduler(limits) == (cluster_opening.SILENCE, 1000.0)


def test_workers_started_by_hand_that_die_and_fail(workplace, made_locally, tmp_path):
    """One after another on the same cluster: what happens to one run leaves the workers to the next."""
    root = tmp_path / "plain"
    seen, shown = [], set()

    def look(progress) -> None:
        seen.append((progress.rooms_done, progress.frames_done))
        if not shown:
            shown.update(names_on_the_dashboard(workplace))

    make(root, tiny(6), cluster=str(workplace), work=fake_work(root, tiny(6), slow=0.1), on_progress=look)
    assert frames_of(root) == made_locally
    assert seen[-1] == (6, 12)
    assert shown
    assert shown <= {f"room {number}" for number in range(6)}
    assert left_behind(root) == []

    # A room whose worker is killed goes to another worker.
    root = tmp_path / "killed"
    work = pool.Work(Setup(), Killed(RoomMaker(root, tiny(4)), room=1, times=1))
    make(root, tiny(4), cluster=str(workplace), work=work)
    assert frames_of(root) == first(4, made_locally)
    assert left_behind(root) == []

    # A job that fails ends the run with its reason; what is whole stays.
    root = tmp_path / "broken"
    full = OSError(28, "No space left on device")
    work = pool.Work(Setup(), Broken(RoomMaker(root, tiny(4)), 2, full))
    with pytest.raises(MakingError, match=r"^room 2: the disk is full"):
        make(root, tiny(4), cluster=str(workplace), work=work)
    make(root, tiny(4), cluster=str(workplace), work=fake_work(root, tiny(4)))
    assert len(frames_of(root)) == 8
    assert left_behind(root) == []


def test_a_disk_that_is_full_in_truth(workplace, tmp_path):
    """Here and for the workers; elsewhere the failure above stands for it."""
    with small_disk(tmp_path / "disk", kilobytes=400) as disk:
        root, recipe = disk / "d", tiny(30, resolution=(32, 24))
        with pytest.raises(MakingError, match="the disk is full: free some space"):
            make(root, recipe, cluster=str(workplace), work=fake_work(root, recipe))
        assert 0 < len(folder.whole_rooms(root)) < 30
        assert left_behind(root) == []
        assert open_dataset(root).manifest["complete"] is False


def test_a_room_that_takes_three_workers_with_it_is_set_aside_by_name(workplace, tmp_path):
    root = tmp_path / "d"
    work = pool.Work(Setup(), Killed(RoomMaker(root, tiny(4)), room=1, times=99))
    summary = make(root, tiny(4), cluster=str(workplace), work=work)
    assert summary.made == 3
    assert list(summary.manifest["rejected_rooms"]) == ["1"]
    assert "3 workers that made it died" in summary.manifest["rejected_rooms"]["1"]
    assert len((tmp_path / "tries").read_text()) == cluster.DEATHS
    assert left_behind(root) == []


def known_clients(dask_scheduler) -> set[str]:
    return {key for key in dask_scheduler.clients if key != "fire-and-forget"}


def found_again(address: str) -> bool:
    """Whether a scheduler has a client, beside the one that asks."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        return len(client.run_on_scheduler(known_clients)) > 1


def test_a_scheduler_that_is_killed_and_started_again_and_one_whose_workers_are_gone(
    made_locally, tmp_path, monkeypatch
):
    """The second time Dask's client has found the new one by itself before the run looks again."""
    file, root = tmp_path / "scheduler.json", tmp_path / "d"
    there = [scheduler(file)]
    port = int(file.read_text().split("tcp://127.0.0.1:")[1].split('"')[0])
    address = f"tcp://127.0.0.1:{port}"
    words = ["worker", address, "--nthreads", "1", "--no-dashboard", "--no-nanny", "--death-timeout", "120"]
    there.append(dask(*words))
    breaks = []

    def break_off(progress) -> None:
        if len(breaks) < 2 and progress.rooms_done == 2 * len(breaks) + 2:
            breaks.append(progress.rooms_done)
            killed(*there)
            there[:] = [scheduler(file, port), dask(*words)]
            if len(breaks) == 2:
                wait_until(lambda: found_again(address))

    def kill_worker(progress) -> None:
        if progress.rooms_done == 1:
            killed(there[1])

    try:
        work = fake_work(root, tiny(6), slow=0.05)
        make(root, tiny(6), cluster=address, work=work, on_progress=break_off)
        assert breaks == [2, 4]
        assert frames_of(root) == made_locally

        monkeypatch.setattr(cluster_opening, "ABANDONED", 1.0)
        root = tmp_path / "abandoned"
        work = fake_work(root, tiny(4), slow=0.05)
        with pytest.raises(ClusterError, match="no worker has been there for 1 s: start some"):
            make(root, tiny(4), cluster=str(file), work=work, on_progress=kill_worker)
        assert folder.whole_rooms(root)
    finally:
        killed(*there)


def test_ctrl_c_stops_rooms_that_are_being_made_and_keeps_those_that_are_whole(workplace, tmp_path):
    root = tmp_path / "d"

    def stop(progress) -> None:
        if progress.rooms_done >= 2:
            raise KeyboardInterrupt

    work = fake_work(root, tiny(12), slow=0.2)
    with pytest.raises(Interrupted, match=r"of 12 rooms whole; to continue run `again`"):
        make(root, tiny(12), cluster=str(workplace), work=work, command="again", on_progress=stop)
    assert open_dataset(root).manifest["complete"] is False
    wait_until(lambda: idle(workplace))  # rooms in hand end at their next frame
    assert 2 <= len(folder.whole_rooms(root)) <= 6
    make(root, tiny(12), cluster=str(workplace), work=fake_work(root, tiny(12)))
    assert len(frames_of(root)) == 24
    assert left_behind(root) == []


RUN = """
import sys
from pathlib import Path
from gibench.datasets.making import make
from tests.datasets.disks import small_disk
from tests.datasets.fakes import fake_work, tiny
if __name__ == "__main__":
    root, recipe = Path(sys.argv[1]), tiny(2, views=50)
    make(root, recipe, cluster=sys.argv[2], work=fake_work(root, recipe, slow=0.4))
"""


def test_a_run_that_is_killed_takes_its_rooms_with_it_and_another_goes_on(workplace, tmp_path):
    root = tmp_path / "d"
    process = subprocess.Popen(
        [sys.executable, "-c", RUN, root, workplace], env=ENVIRONMENT, start_new_session=True
    )
    try:
        wait_until(lambda: len(list(root.glob("rooms/.0*/frames/*.exr"))) >= 4)
    finally:
        killed(process)
    wait_until(lambda: not list(root.glob("rooms/.0*")))  # they would take 20 s
    assert folder.whole_rooms(root) == []
    summary = make(root, tiny(2, views=50), cluster=str(workplace), work=fake_work(root, tiny(2, views=50)))
    assert (summary.made, summary.frames) == (2, 100)
    assert [run["ended"] for run in summary.manifest["runs"]] == [False, True]
    assert left_behind(root) == []


def test_two_runs_on_one_folder(workplace, tmp_path):
    root, refused = tmp_path / "d", []

    def another() -> None:
        try:
            make(root, tiny(2), cluster=str(workplace), work=fake_work(root, tiny(2)))
        except FolderError as problem:
            refused.append(str(problem))

    def start_another(progress) -> None:
        if progress.frames_done == 1 and not refused:
            thread = threading.Thread(target=another)
            thread.start()
            thread.join()

    make(root, tiny(2), cluster=str(workplace), work=fake_work(root, tiny(2)), on_progress=start_another)
    assert "in use by another run" in refused[0]


def test_clusters_that_cannot_be_used(workplace, tmp_path, monkeypatch, capsys):
    from distributed import LocalCluster

    def refused(words: list[str]) -> str:
        out = ["--out", str(tmp_path / "d"), "--preset", "smoke"]
        assert run(make_app, [*out, *words]) == 2
        assert not (tmp_path / "d").exists()
        said = capsys.readouterr().err.splitlines()
        assert said[-1].startswith("error: ")
        return said[-1]

    assert "exclude each other" in refused(["--cluster", "local:2", "--workers", "2"])
    for wrong in ("local:0", "local:", "local:x", "local:٣", f"local:{10**20}"):
        assert "write local:N with N from 1 to" in refused(["--cluster", wrong])
    assert "there is no scheduler file" in refused(["--cluster", str(tmp_path / "none.json")])
    (other := tmp_path / "other.json").write_text('{"rooms": 3}')
    assert "is not what `dask scheduler --scheduler-file` writes" in refused(["--cluster", str(other)])
    with monkeypatch.context() as changed:
        changed.setattr(cluster_opening, "PATIENCE", 0.5)
        assert "nobody answers at tcp://127.0.0.1:9" in refused(["--cluster", "tcp://127.0.0.1:9"])

    # The scheduler has all the time that it needs, its workers have none.
    connected = cluster_opening.connected

    @contextlib.contextmanager
    def lonely(*given, **more):
        with connected(*given, **more) as client, monkeypatch.context() as changed:
            changed.setattr(cluster_opening, "PATIENCE", 0.5)
            yield client

    with (
        LocalCluster(n_workers=0, dashboard_address=":0", scheduler_kwargs={"dashboard": False}) as empty,
        monkeypatch.context() as changed,
    ):
        changed.setattr(cluster_opening, "connected", lonely)
        assert "has no workers: start some with" in refused(["--cluster", empty.scheduler_address])

    # A folder of the same path that is another one on the workers.
    unseen = contextlib.nullcontext(tmp_path / "d" / ".cluster-0")
    with monkeypatch.context() as changed:
        changed.setattr(cluster, "_token", lambda root: unseen)
        assert f"does not see the folder {tmp_path / 'd'}: " in refused(["--cluster", str(workplace)])
    here = cluster_workers.versions()
    monkeypatch.setattr(cluster_workers, "versions", lambda: {**here, "mitsuba": "1.2.3"})
    said = refused(["--cluster", str(workplace)])
    assert "would make other pixels (mitsuba: " in said
    assert "1.2.3 here" in said
    monkeypatch.undo()
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "pip install 'gibench[cluster]'" in refused(["--cluster", "local:1"])


def test_workers_that_do_not_see_the_folder_are_named():
    here = cluster_workers.versions()
    answer = {"sees": False, "versions": here, "host": "node7"}
    with pytest.raises(ClusterError, match=r"worker tcp://a:1 on node7 does not see the folder /d: "):
        refuse_other("tcp://a:1", answer, here, Path("/d"))
    with pytest.raises(ClusterError, match=r"worker tcp://a:1 cannot be used: No module named 'gibench'"):
        refuse_other("tcp://a:1", ModuleNotFoundError("No module named 'gibench'"), here, Path("/d"))
    with pytest.raises(ClusterError, match=r"gibench: None there"):
        refuse_other("tcp://a:1", {"sees": True, "versions": {}, "host": ""}, here, Path("/d"))
    refuse_other("tcp://a:1", {"sees": True, "versions": here, "host": ""}, here, Path("/d"))
