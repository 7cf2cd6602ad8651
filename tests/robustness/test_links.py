"""Links in folders from elsewhere: nothing is deleted, written or read through them."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from gibench.benchmarks.errors import ResultsError
from gibench.benchmarks.result_files import RunFolder, key_of
from gibench.benchmarks.results import load
from gibench.benchmarks.scoring import score
from gibench.cli import run as command
from gibench.cli.app import app
from gibench.datasets import folder as folders
from gibench.datasets.errors import FolderError
from gibench.datasets.files import as_json, process_number, write_whole


def tree(root: Path) -> dict[str, bytes | str]:
    """Everything below a folder, links as what they say."""
    found = {}
    for where, names, files in os.walk(root):
        for name in [*names, *files]:
            path = Path(where) / name
            content = os.readlink(path) if path.is_symlink() else path.read_bytes() if path.is_file() else ""
            found[str(path.relative_to(root))] = content
    return found


@pytest.fixture
def home(tmp_path) -> Path:
    """What belongs to the reader: two folders of which one bears the name of a result, and leftovers' names."""
    root = tmp_path / "home"
    for name in (
        "photos/a.jpg",
        ".ssh/id",
        "0123456789abcdef/0000.exr",
        ".0123456789abcdef.partial/0000.exr",
        ".a.json.partial-7",
        ".000001.partial-3/x",
    ):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(name)
    return root


def replaced(path: Path, target: Path) -> None:
    if path.is_dir():
        path.rename(path.with_name("aside-" + path.name))
    path.symlink_to(target)


@pytest.mark.parametrize("name", ["results", "scores", "logs", "set-aside", "bakes", "scenes/reference"])
def test_a_run_with_a_link_for_one_of_its_folders_is_refused(run, home, name):
    before = tree(home)
    replaced(run.root / name, home)
    with pytest.raises(FolderError, match=r"is no folder of .* itself but a link"), run.claimed():
        pass
    assert command(app, ["bench", "score", str(run.root)]) == 2
    assert tree(home) == before


def test_what_a_user_keeps_among_results_stays(run):
    notes = {"notes/a.txt", "fedcba9876543210/thesis.tex", "plot.png", ".draft.partial/x"}
    for name in notes:
        (run.results / name).parent.mkdir(exist_ok=True)
        (run.results / name).write_text(name)
    left = run.results / "aaaaaaaaaaaaaaaa"  # frames of a result whose record was never written
    left.mkdir()
    (left / "0000.exr").write_text("")
    with run.claimed():
        pass
    assert not left.exists()
    assert all((run.results / name).read_text() == name for name in notes)


def test_a_link_among_the_results_is_left_alone(run, home):
    before = tree(home)
    (run.results / "0123456789abcdef").symlink_to(home / "0123456789abcdef")
    (run.results / ".0123456789abcdef.partial").symlink_to(home / "0123456789abcdef")
    with run.claimed():
        pass
    assert tree(home) == before


@pytest.mark.parametrize("lock", ["made", "home"])
def test_no_lock_is_made_or_taken_through_a_link(run, ds, home, tmp_path, lock):
    for root, claimed in ((run.root, run.claimed), (ds, lambda: folders.claimed(ds))):
        (root / ".lock").symlink_to(tmp_path / lock)
        with pytest.raises(FolderError, match=r"\.lock is a link or no file"), claimed():
            pass
    assert not (tmp_path / "made").exists()


def test_a_dataset_whose_rooms_are_a_link_is_not_made_on(ds, home):
    before = tree(home)
    replaced(ds / "rooms", home)
    with pytest.raises(FolderError, match="rooms is no folder"), folders.claimed(ds):
        pass
    folders.remove_partials(ds)
    assert tree(home) == before


def test_only_own_leftovers_go(ds):
    kept = {".git.partial-x/a", ".000001.partial-3x/a", "000001.partial-3/a"}
    for name in kept:
        (ds / "rooms" / name).parent.mkdir()
        (ds / "rooms" / name).write_text("")
    (ds / "rooms" / ".000001.partial-3").mkdir()
    (ds / ".dataset.json.partial-3").write_text("")
    (ds / ".notes.partial-3").write_text("")
    folders.remove_partials(ds)
    assert all((ds / "rooms" / name).exists() for name in kept)
    assert (ds / ".notes.partial-3").exists()
    assert not (ds / "rooms" / ".000001.partial-3").exists()
    assert not (ds / ".dataset.json.partial-3").exists()


def test_a_file_is_not_written_through_a_link_left_under_its_passing_name(tmp_path):
    (tmp_path / "mine").write_text("mine")
    (tmp_path / f".x.json.partial-{process_number()}").symlink_to(tmp_path / "mine")
    with pytest.raises(OSError, match="symbolic links"):
        write_whole(tmp_path / "x.json", b"{}")
    assert (tmp_path / "mine").read_text() == "mine"


@pytest.mark.parametrize("key", ["track", "scene", "method"])
@pytest.mark.parametrize("name", ["../../outside", "/tmp/outside", ".hidden", "a/b", "a\\b", "", "x" * 300])
def test_names_that_become_files_are_refused_at_the_door(run, key, name):
    old = run.ids()[0]
    record = json.loads(run.result_file(old).read_text())
    record["config"][key] = name
    record["key"] = key_of(record["config"])
    record["id"] = record["key"][:16]
    run.result_file(record["id"]).write_bytes(as_json(record))
    with pytest.raises(ResultsError, match=rf"is damaged \(config\.{key}: .* is no name"):
        load(run.root)


@pytest.mark.parametrize("part", ["../../outside", "other"])
def test_parts_and_metrics_that_become_files_are_refused_too(run, part):
    score(run)
    path = run.score_file(next(id for id in run.ids() if run.read_result(id)["status"] == "ok"))
    scores = json.loads(path.read_text())
    for changed in (
        {"frames": {part: scores["frames"]["full"]}},
        {"frames": {"full": {part: [0.1, 0.1, 0.1]}}},
        {"sequences": {"full": {"walk": {part: 0.1}}}},
    ):
        path.write_bytes(as_json({**scores, **changed}))
        with pytest.raises(ResultsError, match=f"{path.name} is damaged"):
            _ = load(run.root).frames


def test_a_report_stays_below_its_folder(run, tmp_path):
    score(run)
    before = tree(tmp_path)
    assert command(app, ["bench", "report", str(run.root), "--out", str(tmp_path / "board")]) == 0
    assert {name for name in tree(tmp_path).keys() - before.keys() if not name.startswith("board")} == set()
    assert isinstance(run, RunFolder)
