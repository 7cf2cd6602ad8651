"""Checking a dataset on disk against its own records and against the channel contract."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.datasets.errors import DatasetError, StorageError
from gibench.datasets.exr import decode, is_radiance, total_of_parts
from gibench.datasets.folder import MANIFEST, PREVIEW, TABLE, room_folder, whole_rooms
from gibench.datasets.manifest import frame_table, read_manifest, recipe_of, room_record
from gibench.datasets.recipes import Recipe
from gibench.rendering.channels import CHANNELS, PARTS

#: Types in which a kind of channel may be stored.
STORED = {"half": (np.float16, np.float32), "float": (np.float32,), "uint": (np.uint32,)}


@dataclass(frozen=True)
class Problem:
    """Something that is wrong. file: from the dataset's folder."""

    file: str
    what: str


def verify(root: Path, on_room: Callable[[int, int], None] = lambda done, of: None) -> list[Problem]:
    """Check a whole dataset; an empty list says that nothing is wrong.

    Hashes of all files, completeness against the recipe, and for each frame: channels, types, resolution,
    finite values, no negative radiance, and `color` equal to the sum of its five parts to the last bit.
    on_room: called with (rooms checked, rooms in all). Raises `DatasetError` when the folder is no dataset
    at all.
    """
    manifest = read_manifest(root)
    recipe = recipe_of(manifest)
    rejected = {int(room) for room in manifest["rejected_rooms"]}
    expected = [room for room in range(recipe.rooms) if room not in rejected]
    there = set(whole_rooms(root))
    problems: list[Problem] = []
    if not manifest["complete"]:
        problems.append(
            Problem(MANIFEST, f"the dataset is not complete; to continue it run `{manifest['command']}`")
        )
    for room in sorted(there - set(expected)):
        problems.append(Problem(f"rooms/{room:06d}", "the recipe has no such room"))
    records = []
    for done, room in enumerate(expected):
        on_room(done, len(expected))
        if room not in there:
            problems.append(Problem(f"rooms/{room:06d}", "the room is missing"))
            continue
        try:
            record = room_record(root, room)
            problems.extend(_room_problems(root, record, recipe, room))
            records.append(record)
        except DatasetError as problem:
            problems.append(Problem(f"rooms/{room:06d}/frames.json", str(problem)))
        except (KeyError, TypeError, AttributeError) as problem:
            problems.append(
                Problem(f"rooms/{room:06d}/frames.json", f"the record lacks what it should hold: {problem!r}")
            )
    on_room(len(expected), len(expected))
    problems.extend(_table_problems(root, records, recipe))
    if not (root / PREVIEW).is_file():
        problems.append(Problem(PREVIEW, "the contact sheet is missing: `gibench dataset preview` makes it"))
    return problems


def _room_problems(root: Path, record: Mapping[str, Any], recipe: Recipe, room: int) -> Iterator[Problem]:
    folder, name = room_folder(root, room), f"rooms/{room:06d}"
    if record["room"] != room:
        yield Problem(f"{name}/frames.json", f"the record is that of room {record['room']}")
    for required in ("room.json", "scene.xml", "room.glb"):
        if required not in record["files"]:
            yield Problem(f"{name}/{required}", "the room was stored without this file")
    for file, known in record["files"].items():
        _, problem = _content(folder / file, known)
        if problem:
            yield Problem(f"{name}/{file}", problem)
    views = [frame["view"] for frame in record["frames"]]
    asked = recipe.rendered_views(
        record.get("given_cameras", 0), record["room"]
    )  # older records have no scenes
    if views != list(asked):
        yield Problem(
            f"{name}/frames.json", f"{len(views)} frames are recorded, the recipe has {len(asked)} views"
        )
    for frame in record["frames"]:
        content, problem = _content(folder / frame["file"], frame)
        if problem:
            yield Problem(f"{name}/{frame['file']}", problem)
        if content is None:
            continue
        try:
            for fault in frame_faults(decode(content), recipe):
                yield Problem(f"{name}/{frame['file']}", fault)
        except StorageError as fault:
            yield Problem(f"{name}/{frame['file']}", str(fault))


def _content(path: Path, known: Mapping[str, Any]) -> tuple[bytes | None, str]:
    """Content of a file where it can be read, and what is wrong with it."""
    try:
        content = path.read_bytes()
    except OSError as problem:
        return None, f"cannot be read: {problem.strerror}"
    if len(content) != known["bytes"]:
        return content, f"holds {len(content)} bytes, {known['bytes']} were written"
    if hashlib.sha256(content).hexdigest() != known["sha256"]:
        return content, "was changed after it was written (SHA-256 differs)"
    return content, ""


def frame_faults(arrays: Mapping[str, NDArray[Any]], recipe: Recipe) -> Iterator[str]:
    """Say what is wrong with the channels of one frame. arrays: as stored (`exr.decode`)."""
    for name in recipe.channels:
        if name not in arrays:
            yield f"channel {name} is missing"
    for name in arrays.keys() - set(recipe.channels):
        yield f"channel {name} is none of the recipe's"
    width, height = recipe.resolution
    for name, values in arrays.items():
        channel = CHANNELS[name]
        if values.shape[:2] != (height, width):
            there = f"{values.shape[1]}x{values.shape[0]}"
            yield f"channel {name} is {there}, the recipe asks for {width}x{height}"
        if values.dtype not in STORED[channel.dtype]:
            yield f"channel {name} is stored as {values.dtype}"
        if not np.isfinite(values).all():
            yield f"channel {name} has values that are not finite"
        elif is_radiance(channel) and values.min() < 0:
            yield f"channel {name} has negative values"
    if "color" in arrays and arrays.keys() >= set(PARTS):
        color = arrays["color"]
        with np.errstate(over="ignore", invalid="ignore"):
            wrong = int((total_of_parts(arrays).astype(color.dtype) != color).any(-1).sum())
        if wrong:
            yield f"color is not the sum of its five parts in {wrong} pixels"


def _table_problems(root: Path, records: list[dict[str, Any]], recipe: Recipe) -> Iterator[Problem]:
    import pandas as pd

    try:
        table = pd.read_parquet(root / TABLE)
    except FileNotFoundError:
        yield Problem(TABLE, "the table is missing: the run that made the dataset was cut off")
        return
    except (OSError, ValueError) as problem:
        yield Problem(TABLE, f"the table is damaged: {' '.join(str(problem).split())}")
        return
    if not frame_table(records, recipe).equals(table):
        yield Problem(TABLE, "the table does not say what the records of the rooms say")
