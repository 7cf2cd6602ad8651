"""Frames of a room that a run was stopped in, kept for the next run where they took a while to render.

A room of a thousand frames takes longer than many a night's queue gives a job. While it is made, each frame that is
written is also a line of a journal; where the run ends, the frames that the journal vouches for move to a folder of
their own, out of which the next run takes them.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from gibench import gate
from gibench.datasets.checked import parsed
from gibench.datasets.records import FrameRecord

JOURNAL = "frames.jsonl"

WORTH_KEEPING = 60.0
"""Seconds of rendering below which the frames of an unfinished room are rendered again: nobody misses them."""


def unfinished_folder(root: Path, room: int) -> Path:
    """Where the frames of a room wait that is not whole."""
    return root / "rooms" / f".{room:06d}.unfinished"


def write_down(folder: Path, record: Mapping[str, Any]) -> None:
    """Add a frame, whose file is written, to the journal of the folder that a room is made in."""
    with (folder / JOURNAL).open("a", encoding="utf-8") as journal:
        journal.write(json.dumps(record, allow_nan=False) + "\n")


def keep_frames(root: Path, room: int, partial: Path) -> None:
    """Move the frames of a room that was not finished to where the next run finds them; the rest is removed.

    Never raises OSError: what cannot be kept is rendered again.
    """
    try:
        waiting = unfinished_folder(root, room)
        before, now = _journal(waiting), _journal(partial)
        seconds = sum(record["seconds"] for record in (before | now).values())
        if now and seconds >= WORTH_KEEPING and not waiting.is_symlink():
            (waiting / "frames").mkdir(parents=True, exist_ok=True)
            for record in now.values():
                _move(partial, waiting, record)
    except OSError:
        pass
    finally:
        shutil.rmtree(partial, ignore_errors=True)


class WaitingFrames:
    """The frames that wait for a room, for the process that makes it."""

    def __init__(self, root: Path, room: int) -> None:
        """Read the journal; without one nothing waits."""
        self._folder = unfinished_folder(root, room)
        self._records = _journal(self._folder)

    def take(self, facts: Mapping[str, Any], into: Path) -> dict[str, Any] | None:
        """Move a frame into the folder that its room is made in, and return its record.

        facts: the part of the record that is known before it is rendered. None, and nothing is moved, where no frame
        waits, where it shows something else, or where its file is not as it was written.
        """
        record = self._records.get(facts["view"])
        plain = json.loads(json.dumps(facts))
        if record is None or any(record.get(name) != value for name, value in plain.items()):
            return None
        try:
            content = gate.read_inside(self._folder, record["file"], record["bytes"])
            if hashlib.sha256(content).hexdigest() != record["sha256"]:
                return None
            _move(self._folder, into, record)
        except (OSError, gate.GateError):
            return None
        return record


def forget_frames(root: Path, room: int) -> None:
    """Remove the frames that wait for a room: it is whole, or there is none of this number."""
    if gate.real_folder(unfinished_folder(root, room)):
        shutil.rmtree(unfinished_folder(root, room), ignore_errors=True)


def unfinished_rooms(root: Path) -> dict[int, int]:
    """How many frames wait for each room that has some."""
    folders = gate.own_leftovers(root / "rooms", r"\.[0-9]{6,9}\.unfinished")
    counts = {int(folder.name.split(".")[1]): len(_journal(folder)) for folder in folders}
    return {room: count for room, count in sorted(counts.items()) if count}


def _move(source: Path, target: Path, record: Mapping[str, Any]) -> None:
    (source / record["file"]).replace(target / record["file"])
    write_down(target, record)


def _journal(folder: Path) -> dict[int, dict[str, Any]]:
    """The frames of a journal whose file is there, by view; without lines that were cut off or are none of ours."""
    if not gate.real_folder(folder) or not gate.real_folder(folder / "frames"):
        return {}
    try:
        lines = gate.read_inside(folder, JOURNAL).decode("utf-8", errors="replace").splitlines()
    except gate.GateError:
        return {}
    found: dict[int, dict[str, Any]] = {}
    for line in lines:
        with suppress(ValueError):
            record = parsed(line.encode(), FrameRecord)
            if (folder / record["file"]).is_file():
                found[record["view"]] = record
    return found
