import json
import os
import signal
import subprocess
import sys
import time

import pytest

from gibench.baselines import sources
from gibench.baselines.bakes import RECORD, BakeCache


def cache(root):
    return BakeCache(root / "bakes", "a scene", {"cpu": "one"})


def make(folder):
    (folder / "content").write_bytes(b"x" * 100)


def never(folder):
    pytest.fail("it was made again")


def test_the_same_is_made_once(tmp_path):
    first = cache(tmp_path).get("lightmap", {"texels": 4}, make)
    again = cache(tmp_path)
    assert again.get("lightmap", {"texels": 4}, never) == first
    assert again.used == [first]
    assert first.size == 100
    others = [
        cache(tmp_path).get("lightmap", {"texels": 8}, make),
        cache(tmp_path).get("probes", {"texels": 4}, make),
        BakeCache(tmp_path / "bakes", "another", {"cpu": "one"}).get("lightmap", {"texels": 4}, make),
        BakeCache(tmp_path / "bakes", "a scene", {"cpu": "two"}).get("lightmap", {"texels": 4}, make),
    ]
    assert len({bake.folder for bake in [first, *others]}) == 5


@pytest.fixture
def oven(tmp_path, monkeypatch):
    """A package whose `baking.make` bakes, and its `pantry.more`, which that does not import."""
    package = tmp_path / "oven"
    package.mkdir()
    files = {
        "__init__.py": "",
        "baking.py": "from oven import spices\n\ndef make(folder):\n    (folder / 'a').write_text('a')\n",
        "spices.py": "AMOUNT = 1\n",
        "pantry.py": "def more():\n    return 1\n",
    }
    for name, text in files.items():
        (package / name).write_text(text)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    from oven import baking, pantry

    yield package, baking.make, pantry.more
    for name in [name for name in sys.modules if name.partition(".")[0] == "oven"]:
        del sys.modules[name]


def test_edited_code_bakes_anew(oven, tmp_path):
    folder, make, more = oven

    def bake(*using):
        for cached in (sources._top, sources._read):
            cached.cache_clear()
        return cache(tmp_path).get("lightmap", {}, make, using=using).folder

    first, with_more = bake(), bake(more)
    assert first != with_more
    (folder / "pantry.py").write_text("def more():\n    return 2\n")
    assert bake() == first
    assert bake(more) != with_more
    (folder / "spices.py").write_text("AMOUNT = 2\n")
    assert bake() != first
    (folder / "spices.py").write_text("# A little.\nAMOUNT = 1\n")
    assert bake() == first


def test_a_making_that_fails_leaves_nothing(tmp_path):
    def fails(folder):
        make(folder)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cache(tmp_path).get("lightmap", {}, fails)
    assert list((tmp_path / "bakes").iterdir()) == []


def test_two_that_make_the_same_do_not_take_it_from_each_other(tmp_path):
    def late(folder):
        make(folder)
        # Somebody else is done first, and may be reading by now.
        first = cache(tmp_path).root / name
        first.mkdir()
        make(first)
        (first / RECORD).write_text(json.dumps({**record, "seconds": 7.0}))

    name = cache(tmp_path).get("lightmap", {}, make).folder.name
    record = json.loads((tmp_path / "bakes" / name / RECORD).read_text())
    (tmp_path / "bakes" / name / RECORD).unlink()
    (tmp_path / "bakes" / name / "content").unlink()
    (tmp_path / "bakes" / name).rmdir()
    assert cache(tmp_path).get("lightmap", {}, late).seconds == 7.0
    assert [path.name for path in (tmp_path / "bakes").iterdir()] == [name]


SLOW = """
import sys, time
from pathlib import Path
from gibench.baselines.bakes import BakeCache

def make(folder):
    (folder / "map.npy").write_bytes(b"x" * 1000)
    BakeCache.checkpoint(folder).write_text("half")
    (folder.parent / f"{BakeCache.checkpoint(folder).name}.{sys.argv[2]}").write_text("a half of it")
    print(folder, flush=True)
    time.sleep(600)

BakeCache(Path(sys.argv[1]), "a scene", {}).get("probes", {"number": sys.argv[2]}, make)
"""


def test_what_killed_makings_leave_goes_at_the_next_start_and_living_ones_go_on(tmp_path):
    (tmp_path / "slow.py").write_text(
        SLOW.replace(
            "{sys.argv[2]}", "{__import__('gibench.datasets.files').datasets.files.process_number()}"
        )
    )
    root = tmp_path / "bakes"
    processes = [
        subprocess.Popen(
            [sys.executable, tmp_path / "slow.py", root, str(number)], stdout=subprocess.PIPE, text=True
        )
        for number in range(3)
    ]
    try:
        partial = [process.stdout.readline().strip() for process in processes]
        assert all(map(os.path.isdir, partial))
        for process in processes[:2]:
            process.send_signal(signal.SIGKILL)
            process.wait()
        BakeCache(root, "another scene", {})
        assert [os.path.isdir(folder) for folder in partial] == [False, False, True]
        # What had been reached stays, to go on from; what was being written does not.
        assert len(list(root.glob(".*.checkpoint"))) == 3
        assert [path.name.endswith(str(processes[2].pid)) for path in root.glob(".*.checkpoint.*")] == [True]
        processes[2].send_signal(signal.SIGKILL)
        processes[2].wait()
        BakeCache(root, "another scene", {})
        assert not list(root.glob(".*.partial-*"))
    finally:
        for process in processes:
            process.kill()
            process.wait()
            process.stdout.close()


def test_a_checkpoint_outlives_what_fails_and_goes_with_the_bake(tmp_path):
    def dies(folder):
        BakeCache.checkpoint(folder).write_text("half")
        raise RuntimeError

    def goes_on(folder):
        assert BakeCache.checkpoint(folder).read_text() == "half"
        return 10.0

    with pytest.raises(RuntimeError):
        cache(tmp_path).get("training", {}, dies)
    start = time.perf_counter()
    bake = cache(tmp_path).get("training", {}, goes_on)
    assert 10.0 <= bake.seconds <= 10.0 + time.perf_counter() - start
    assert [path.name for path in (tmp_path / "bakes").iterdir()] == [bake.folder.name]


@pytest.mark.parametrize(
    "damage",
    [
        lambda folder: (folder / RECORD).write_text("{"),
        lambda folder: (folder / RECORD).write_text('{"key": {}, "seconds": 1.0, "bytes": 100, "views": []}'),
        lambda folder: (folder / RECORD).write_text("[" * 10**5),
        lambda folder: (folder / "content").write_bytes(b"x" * 50),
        lambda folder: (folder / RECORD).unlink(),
    ],
)
def test_a_bake_that_is_damaged_is_made_again(tmp_path, damage):
    first = cache(tmp_path).get("lightmap", {"texels": 4}, make)
    damage(first.folder)
    again = cache(tmp_path).get("lightmap", {"texels": 4}, make)
    assert (again.folder, again.size) == (first.folder, 100)
    assert (again.folder / "content").read_bytes() == b"x" * 100
    assert json.loads((again.folder / RECORD).read_text())["bytes"] == 100
