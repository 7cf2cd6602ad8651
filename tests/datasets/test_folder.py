import os
from pathlib import Path

import pytest

from gibench.datasets import files, folder
from gibench.datasets.errors import FolderError


def test_a_new_folder_is_made_and_goes_again_when_nothing_was_put_into_it(tmp_path):
    root = tmp_path / "a" / "b"
    with folder.claimed(root):
        assert root.is_dir()
    assert list(tmp_path.iterdir()) == []


def test_what_was_put_into_it_stays_without_lock_and_leftovers(tmp_path):
    with folder.claimed(tmp_path / "a"):
        (tmp_path / "a" / folder.MANIFEST).write_text("{}")
        folder.partial_folder(tmp_path / "a", 3, 77).mkdir(parents=True)
    assert sorted(path.name for path in (tmp_path / "a").rglob("*")) == [folder.MANIFEST, "rooms"]


def test_two_runs_cannot_share_a_folder(tmp_path):
    with folder.claimed(tmp_path / "a"):
        with pytest.raises(FolderError, match="in use by another run"), folder.claimed(tmp_path / "a"):
            pass
        assert (tmp_path / "a" / folder.LOCK).exists()
    with folder.claimed(tmp_path / "a"):
        pass


def test_the_lock_of_a_killed_run_holds_nobody_up(tmp_path):
    (tmp_path / folder.LOCK).touch()
    with folder.claimed(tmp_path):
        pass


def test_a_folder_with_other_things_is_refused_and_left_alone(tmp_path):
    (tmp_path / "thesis.tex").touch()
    refused = pytest.raises(
        FolderError, match=r"holds files but no dataset \(thesis.tex …\): choose an empty"
    )
    with refused, folder.claimed(tmp_path):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_places_that_cannot_be_written(tmp_path):
    (tmp_path / "file").touch()
    for root in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(FolderError, match="is no folder, or lies under a file"), folder.claimed(root):
            pass
    with pytest.raises(FolderError, match="cannot be written"), folder.claimed(Path("/proc/gibench")):
        pass


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_no_permission(tmp_path):
    tmp_path.chmod(0o500)
    refused = pytest.raises(FolderError, match=r"cannot be written \(Permission denied\)")
    with refused, folder.claimed(tmp_path / "a"):
        pass


def test_a_room_is_whole_only_under_its_own_name_with_its_record(tmp_path):
    for name, recorded in (
        ("000004", True),
        ("000002", True),
        ("000003", False),
        (".000005.partial-9", True),
    ):
        (tmp_path / "rooms" / name).mkdir(parents=True)
        if recorded:
            (tmp_path / "rooms" / name / folder.RECORD).touch()
    assert folder.whole_rooms(tmp_path) == [2, 4]


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "x.json"
    files.write_whole(path, b"old")

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        files.write_whole(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
