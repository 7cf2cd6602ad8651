"""Making with a renderer that takes no time; `test_real_dataset` does it with the real one."""

import dataclasses
import errno
import hashlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

from gibench.datasets import folder, pool
from gibench.datasets.errors import FolderError, MakingError
from gibench.datasets.loading import open_dataset
from gibench.datasets.making import Progress, make
from gibench.datasets.manifest import COLUMNS, read_manifest
from gibench.datasets.room_making import RoomMaker
from gibench.datasets.verifying import verify
from tests.datasets.disks import small_disk
from tests.datasets.fakes import FACTS, Asleep, Broken, Killed, Pids, Setup, fake_work, tiny


def make_fake(root: Path, recipe=None, *, workers=1, work=None, **setup):
    recipe = recipe or tiny()
    work = work or fake_work(root, recipe, **setup)
    return make(root, recipe, workers=workers, command=f"make-dataset --out {root.name}", work=work)


def frames_of(root: Path) -> dict[str, str]:
    """Name → hash of every frame."""
    return {
        str(path.relative_to(root)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(root.glob("rooms/0*/frames/*.exr"))
    }


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp("undisturbed") / "d"
    make_fake(root, tiny(4))
    return root


def test_what_a_dataset_holds(undisturbed):
    assert sorted(path.name for path in undisturbed.iterdir()) == [
        "DATASET.md",
        "dataset.json",
        "frames.parquet",
        "preview.png",
        "rooms",
    ]
    assert sorted(path.name for path in (undisturbed / "rooms").iterdir()) == [f"{i:06d}" for i in range(4)]
    assert sorted(path.name for path in (undisturbed / "rooms" / "000000").iterdir()) == [
        "frames",
        "frames.json",
        "room.glb",
        "room.json",
        "scene.xml",
    ]
    assert verify(undisturbed) == []


def test_the_manifest_tells_how_it_was_made(undisturbed):
    manifest = read_manifest(undisturbed)
    assert manifest["complete"]
    assert manifest["recipe"]["resolution"] == [16, 12]
    assert manifest["recipe"]["channels"][0] == "color"
    assert manifest["variant"] == "fake"
    assert manifest["versions"] == FACTS["versions"]
    assert manifest["licence"] == "CC0-1.0"
    assert manifest["command"] == "make-dataset --out d"
    assert manifest["machine"]["cores"] == os.cpu_count()
    assert manifest["rejections"] == {"view: too dark": 4}
    totals = manifest["totals"]
    assert (totals["rooms"], totals["frames"]) == (4, 8)
    assert totals["paths"] == 8 * 16 * 12 * 4
    on_disk = sum(path.stat().st_size for path in undisturbed.glob("rooms/*/**/*") if path.is_file())
    records = sum(path.stat().st_size for path in undisturbed.glob("rooms/*/frames.json"))
    assert totals["bytes"] == on_disk - records
    (run,) = manifest["runs"]
    assert run["rooms"] == 4
    assert run["wall_seconds"] > run["kernel_seconds"] == pytest.approx(0.008)


def test_the_table_has_a_row_a_frame(undisturbed):
    table = pd.read_parquet(undisturbed / "frames.parquet")
    assert list(table.columns) == list(COLUMNS)
    assert list(zip(table["room"], table["view"], strict=True)) == [
        (r, v) for r in range(4) for v in range(2)
    ]
    for row in table.to_dict("records"):
        content = (undisturbed / row["file"]).read_bytes()
        assert (len(content), hashlib.sha256(content).hexdigest()) == (row["bytes"], row["sha256"])
    assert table.groupby("room")["split"].nunique().eq(1).all()
    assert table["exposure"].gt(0).all()
    assert table["seed"].nunique() == 8


def test_pixels_depend_on_neither_workers_nor_the_number_of_rooms(undisturbed, tmp_path):
    make_fake(tmp_path / "d", tiny(5), workers=3)
    more = frames_of(tmp_path / "d")
    assert frames_of(undisturbed).items() < more.items()
    assert len(more) == 10


def test_the_same_again_does_nothing(undisturbed):
    before = {path: path.stat().st_mtime_ns for path in undisturbed.rglob("*") if path.is_file()}
    broken = pool.Work(Broken(None, -1, RuntimeError()), Broken(None, -1, RuntimeError()))
    summary = make_fake(undisturbed, tiny(4), work=broken)  # no worker is started
    assert summary.made == 0
    assert summary.totals["rooms"] == 4
    assert before == {path: path.stat().st_mtime_ns for path in undisturbed.rglob("*") if path.is_file()}


def test_more_rooms_extend_a_dataset(undisturbed, tmp_path):
    root = tmp_path / "d"
    make_fake(root, tiny(2))
    first = frames_of(root)
    summary = make_fake(root, tiny(4))
    assert summary.made == 2
    assert read_manifest(root)["recipe"]["rooms"] == 4
    assert len(read_manifest(root)["runs"]) == 2
    assert first.items() < frames_of(root).items()
    assert frames_of(root) == frames_of(undisturbed)
    assert verify(root) == []


def test_a_folder_with_another_dataset_says_what_differs(undisturbed):
    with pytest.raises(FolderError) as caught:
        make_fake(undisturbed, tiny(4, seed=7, views=3))
    message = str(caught.value)
    assert "seed: 0 there, 7 asked" in message
    assert "views: 2 there, 3 asked" in message
    assert "to continue it run `make-dataset --out d`" in message
    assert "--out" in message
    with pytest.raises(FolderError, match="rooms: 4 there, 2 asked"):
        make_fake(undisturbed, tiny(2))


def test_other_variants_and_versions_are_not_mixed_in(tmp_path):
    root = tmp_path / "d"
    make_fake(root, tiny(1))
    with pytest.raises(FolderError, match="variant: fake there, other here"):
        make_fake(root, tiny(2), facts={**FACTS, "variant": "other"})
    with pytest.raises(FolderError, match="mitsuba: 0 there, 1 here"):
        make_fake(root, tiny(2), facts={**FACTS, "versions": {"gibench": "0", "mitsuba": "1"}})
    assert verify(root) == []


def test_a_damaged_manifest_is_named(tmp_path):
    (tmp_path / "dataset.json").write_text('{"format": 1')
    with pytest.raises(Exception, match=r"dataset\.json is damaged"):
        make_fake(tmp_path)
    (tmp_path / "dataset.json").write_text('{"format": 1, "recipe": {"rooms": "many"}}')
    with pytest.raises(Exception, match=r"dataset\.json is damaged"):
        make_fake(tmp_path)
    (tmp_path / "dataset.json").write_text('{"format": 99, "versions": {"gibench": "9.9"}}')
    with pytest.raises(Exception, match=r"is of format 99.*install the gibench that made it \(9\.9\)"):
        make_fake(tmp_path)


def test_a_worker_that_dies_once_costs_nothing(undisturbed, tmp_path):
    root, recipe = tmp_path / "d", tiny(4)
    work = fake_work(root, recipe)
    make_fake(root, recipe, work=pool.Work(work.setup, Killed(work.job, room=2, times=1)))
    assert frames_of(root) == frames_of(undisturbed)
    assert verify(root) == []
    assert not list((root / "rooms").glob(".*"))


def test_a_worker_that_dies_twice_stops_the_run_and_leaves_what_is_whole(undisturbed, tmp_path):
    root, recipe = tmp_path / "d", tiny(4)
    work = fake_work(root, recipe)
    with pytest.raises(
        MakingError, match="room 2: two workers in a row were killed by SIGKILL; lower --workers"
    ):
        make_fake(root, recipe, work=pool.Work(work.setup, Killed(work.job, room=2, times=2)))
    assert {problem.file for problem in verify(root)} == {"dataset.json", "rooms/000002", "rooms/000003"}
    assert len(open_dataset(root)) == 4
    make_fake(root, recipe)
    assert frames_of(root) == frames_of(undisturbed)
    assert verify(root) == []


@pytest.mark.parametrize(
    ("problem", "says"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "room 1: the disk is full: free some space"),
        (PermissionError(errno.EACCES, "Permission denied", "/x/y"), "room 1: /x/y: Permission denied"),
        (ZeroDivisionError("division\nby zero"), "room 1: ZeroDivisionError: division by zero"),
    ],
)
def test_what_fails_in_a_room_is_named_and_the_rest_stays_valid(undisturbed, tmp_path, problem, says):
    root, recipe = tmp_path / "d", tiny(3)
    work = fake_work(root, recipe)
    with pytest.raises(MakingError, match=says) as caught:
        make_fake(root, recipe, work=pool.Work(work.setup, Broken(work.job, 1, problem)))
    assert "\n" not in str(caught.value)
    assert {p.file for p in verify(root)} == {"dataset.json", "rooms/000001", "rooms/000002"}
    assert not list((root / "rooms").glob(".*"))


def killed_and_gone(pid: int) -> None:
    """Kill a worker; returns when its end of the pipe is closed."""
    os.kill(pid, signal.SIGKILL)
    os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)


def test_a_worker_that_dies_before_it_is_handed_its_room_costs_nothing():
    done, pids = [], []

    def ready(pid: int) -> None:
        pids.append(pid)
        if len(pids) == 1:
            killed_and_gone(pid)

    listener = pool.Listener(ready, lambda *_: None, lambda room, pid: done.append(room), lambda room: None)
    pool.run_rooms(pool.Work(Pids(), Pids()), [0, 1], listener)
    assert done == [0, 1]
    assert len(pids) == 2


def test_a_worker_that_dies_with_nothing_to_do_stops_nobody():
    done, pids = [], []

    def one_done(room: int, pid: int) -> None:
        done.append(room)
        if len(done) == 1:
            killed_and_gone(pid)  # room 0 is done, nothing is left, and room 1 goes on elsewhere

    listener = pool.Listener(pids.append, lambda *_: None, one_done, lambda room: None)
    pool.run_rooms(pool.Work(Pids(), Pids(seconds=1.5)), [0, 1], listener, workers=2)
    assert sorted(done) == [0, 1]


def test_a_worker_that_cannot_start_leaves_nothing_behind(tmp_path):
    work = pool.Work(Broken(None, 0, RuntimeError()), Broken(None, 0, RuntimeError()))
    with pytest.raises(MakingError, match="TypeError"):
        make_fake(tmp_path / "d", work=work)
    assert list(tmp_path.iterdir()) == []


def test_a_room_that_cannot_be_built_is_left_out_and_counted(undisturbed, tmp_path):
    root = tmp_path / "d"
    summary = make_fake(root, tiny(4), rejects=(1,))
    assert summary.made == 3
    manifest = read_manifest(root)
    assert manifest["complete"]
    assert manifest["rejected_rooms"] == {"1": "nothing fits"}
    assert verify(root) == []
    make_fake(root, tiny(5), rejects=(1,))
    assert len(open_dataset(root)) == 8


def test_progress_counts_up_to_the_whole(tmp_path):
    seen: list[tuple[int, int]] = []

    def look(progress: Progress) -> None:
        seen.append((progress.rooms_done, progress.frames_done))

    root, recipe = tmp_path / "d", tiny(2)
    make(root, recipe, work=fake_work(root, recipe), on_progress=look)
    assert seen == [(0, 0), (0, 1), (0, 2), (1, 2), (1, 3), (1, 4), (2, 4)]


def test_workers_are_replaced_after_a_number_of_rooms(tmp_path, monkeypatch):
    hired = []
    original = pool._start_worker
    monkeypatch.setattr(pool, "_start_worker", lambda work: hired.append(original(work)) or hired[-1])
    root, recipe = tmp_path / "d", tiny(5, views=1)
    make_fake(root, recipe, work=dataclasses.replace(fake_work(root, recipe), rooms_per_worker=2))
    assert len(hired) == 3
    assert all(not worker.process.alive for worker in hired)


SLOW_RUN = """
import sys
from pathlib import Path
from gibench.datasets.making import make
from tests.datasets.fakes import fake_work, tiny
if __name__ == "__main__":
    root, recipe = Path(sys.argv[1]), tiny(4)
    make(root, recipe, workers=2, command="again", work=fake_work(root, recipe, slow=0.05))
"""


def started(tmp_path: Path) -> tuple[Path, subprocess.Popen]:
    """A run in a process group of its own, as under a shell."""
    (tmp_path / "run.py").write_text(SLOW_RUN)
    root = tmp_path / "d"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    process = subprocess.Popen(
        [sys.executable, tmp_path / "run.py", root],
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        cwd=Path(__file__).parents[2],
    )
    return root, process


def wait_for(condition, seconds=20.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.005)


def test_ctrl_c_stops_tidily_and_says_how_to_continue(undisturbed, tmp_path):
    root, process = started(tmp_path)
    wait_for(lambda: folder.whole_rooms(root))
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=20)
    assert "Interrupted: stopped with" in said
    assert "to continue run `again`" in said
    assert not list((root / "rooms").glob(".*"))
    assert not (root / folder.LOCK).exists()
    assert 2 <= len(open_dataset(root)) < 8
    make_fake(root, tiny(4))
    assert frames_of(root) == frames_of(undisturbed)
    assert verify(root) == []


@pytest.mark.parametrize("times", [1, 2])
def test_a_worker_that_hangs_is_given_up(undisturbed, tmp_path, monkeypatch, times):
    monkeypatch.setattr(pool, "PATIENCE", 4.0)
    monkeypatch.setattr(pool, "LOOK_SECONDS", 0.2)
    root, recipe = tmp_path / "d", tiny(4)
    work = pool.Work(
        Setup(), Killed(RoomMaker(root, recipe), room=2, times=times, with_signal=signal.SIGSTOP)
    )
    remarks = []

    def note(progress: Progress) -> None:
        while progress.remarks:
            remarks.append(progress.remarks.pop())

    if times == 2:
        with pytest.raises(MakingError, match=r"room 2: two workers in a row were given up, since each hung"):
            make(root, recipe, work=work, on_progress=note)
        assert len(remarks) == 2
    else:
        make(root, recipe, work=work, on_progress=note)
        assert len(remarks) == 1
        assert frames_of(root) == frames_of(undisturbed)
    assert re.match(r"room 2: its worker hangs: it has not computed anything for \d s; once more", remarks[0])
    assert not list((root / "rooms").glob(".*"))


def test_a_worker_that_hangs_before_its_first_room_is_replaced_once(monkeypatch):
    monkeypatch.setattr(pool, "PATIENCE", 4.0)
    monkeypatch.setattr(pool, "LOOK_SECONDS", 0.2)
    told = []
    listener = pool.Listener(
        lambda facts: None, lambda *_: None, lambda *_: None, lambda room: None, told.append
    )
    with pytest.raises(MakingError, match="a worker was given up, since each hung before its first room"):
        pool.run_rooms(pool.Work(Asleep(), Pids()), [0], listener)
    assert len(told) == 2


def test_a_process_that_was_stopped_itself_gives_nobody_up(monkeypatch):
    """Ctrl-Z and `fg` an hour later: nobody has computed anything, and nobody hangs."""
    monkeypatch.setattr(pool, "_processor_seconds", lambda process: 1.0)
    now = [0.0]
    monkeypatch.setattr(pool.time, "monotonic", lambda: now[0])
    watch, worker = (
        pool._Watch(),
        pool._Worker(SimpleNamespace(connection=SimpleNamespace(poll=lambda: False)), 25, room=3, ready=True),
    )
    for now[0] in (3.0, 3600.0, 3603.0):
        watch.look([worker])
    assert worker.hung == ""
    for now[0] in range(3603, 3700, 3):
        watch.look([worker])
    assert worker.hung.startswith("hangs: it has not computed anything for")


@pytest.mark.parametrize("delay", [0.0, 0.15])
def test_a_kill_at_any_instant_is_survived(undisturbed, tmp_path, delay):
    root, process = started(tmp_path)
    wait_for((root / "rooms").exists)
    time.sleep(delay)
    process.kill()  # the main process alone: workers must notice
    process.communicate(timeout=20)
    assert [run["ended"] for run in read_manifest(root)["runs"]] == [False]
    make_fake(root, tiny(4))
    assert frames_of(root) == frames_of(undisturbed)
    assert verify(root) == []
    assert sorted(path.name for path in root.iterdir()) == sorted(path.name for path in undisturbed.iterdir())
    assert [run["ended"] for run in read_manifest(root)["runs"]] == [False, True]


def test_a_full_disk_leaves_what_is_whole_valid(tmp_path):
    """On a file system of 400 kB, where it can be mounted; elsewhere the injected error above stands for it."""
    with small_disk(tmp_path / "disk", kilobytes=400) as disk:
        root = disk / "d"
        with pytest.raises(MakingError, match="the disk is full: free some space"):
            make_fake(root, tiny(30, resolution=(32, 24)))
        whole = folder.whole_rooms(root)
        assert 0 < len(whole) < 30
        problems = {problem.file for problem in verify(root)}
        missing = {f"rooms/{room:06d}" for room in set(range(30)) - set(whole)}
        assert missing <= problems <= missing | {"dataset.json", "preview.png", "frames.parquet"}
        assert json.loads((root / "dataset.json").read_text())["complete"] is False


def test_the_process_that_hands_out_rooms_loads_no_renderer(tmp_path):
    code = (
        SLOW_RUN
        + "    print(*(m for m in ('mitsuba', 'drjit', 'torch') if m in sys.modules), file=sys.stderr)\n"
    )
    (tmp_path / "run.py").write_text(code)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    done = subprocess.run(
        [sys.executable, tmp_path / "run.py", tmp_path / "d"],
        capture_output=True, text=True, env=environment, cwd=Path(__file__).parents[2], check=True,
    )  # fmt: skip
    assert done.stderr.strip() == ""


def test_no_workers_are_no_way_to_make_anything(tmp_path):
    for workers in (0, -1, 10**20):
        with pytest.raises(MakingError, match=f"{workers} workers are not possible: ask for 1 to 1024"):
            make(tmp_path / "d", tiny(), workers=workers)
    assert Setup()  # the fakes stay out of this process: the real modules must be untouched
    assert "fake" not in str(sys.modules.get("gibench.rendering.render"))


def test_a_run_that_fails_in_its_first_room_leaves_nothing_behind(tmp_path):
    root, recipe = tmp_path / "d", tiny(3)
    work = fake_work(root, recipe)
    with pytest.raises(MakingError, match="room 0: the disk is full"):
        make_fake(
            root, recipe, work=pool.Work(work.setup, Broken(work.job, 0, OSError(errno.ENOSPC, "full")))
        )
    assert list(tmp_path.iterdir()) == []


def test_frames_whose_light_the_denoiser_changed_are_named():
    import pandas as pd

    from gibench.datasets.manifest import large_changes

    table = pd.DataFrame({"room": [0, 1, 2, 3], "view": [0, 0, 1, 0]}).assign(
        denoise_change=[0.02, -0.05, 0.2, None]
    )
    assert large_changes(table) == [
        {"room": 2, "view": 1, "change": 0.2},
        {"room": 1, "view": 0, "change": -0.05},
    ]
