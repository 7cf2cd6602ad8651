"""Checking a dataset on disk against its own records and against the channel contract."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench import gate
from gibench.datasets.cache import cache_faults
from gibench.datasets.errors import DatasetError, StorageError
from gibench.datasets.exr import decode, is_radiance, total_of_parts
from gibench.datasets.exr_header import HeaderError, read_header
from gibench.datasets.folder import ENVIRONMENTS, MANIFEST, PREVIEW, TABLE, whole_rooms
from gibench.datasets.lightings import kept_panorama
from gibench.datasets.manifest import frame_table, read_manifest, recipe_of, room_record
from gibench.datasets.recipes import Recipe
from gibench.datasets.table import read_table
from gibench.errors import GibenchError
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
    on_room(len(expected), len(expected))
    problems.extend(_panorama_problems(root, records))
    problems.extend(_table_problems(root, records, recipe))
    if len(records) == len(expected):
        problems.extend(Problem(*fault) for fault in cache_faults(root, frame_table(records, recipe)))
    if not (root / PREVIEW).is_file():
        problems.append(Problem(PREVIEW, "the contact sheet is missing: `gibench dataset preview` makes it"))
    return problems


def _room_problems(root: Path, record: Mapping[str, Any], recipe: Recipe, room: int) -> Iterator[Problem]:
    name = f"rooms/{room:06d}"
    for required in ("room.json", "scene.xml", "room.glb"):
        if required not in record["files"]:
            yield Problem(f"{name}/{required}", "the room was stored without this file")
    for file, known in record["files"].items():
        if problem := _file_problem(root, f"{name}/{file}", known):
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
        place = f"{name}/{frame['file']}"
        if problem := _file_problem(root, place, frame):
            yield Problem(place, problem)
        try:
            path = gate.inside(root, place)
            header = read_header(path)
            if (header.width, header.height) != recipe.resolution:
                asked_size = "x".join(map(str, recipe.resolution))
                yield Problem(
                    place, f"the image is {header.width}x{header.height}, the recipe asks for {asked_size}"
                )
                continue
            for fault in frame_faults(decode(path), recipe):
                yield Problem(place, fault)
        except gate.GateError:
            continue  # said above
        except (HeaderError, StorageError) as fault:
            yield Problem(place, str(fault))


def _panorama_problems(root: Path, records: list[dict[str, Any]]) -> Iterator[Problem]:
    lightings = [
        frame["lighting"] for record in records for frame in record["frames"] if frame.get("lighting")
    ]
    for sha256, name in {
        light["sha256"]: light["environment"] for light in lightings if "sha256" in light
    }.items():
        try:
            _ = kept_panorama(root, name, sha256).pixels
        except GibenchError as problem:
            yield Problem(f"{ENVIRONMENTS}/{sha256}.exr", str(problem))


def _file_problem(root: Path, file: str, known: Mapping[str, Any]) -> str:
    """Problem of a file of a room; empty where it is as it was written."""
    try:
        with gate.opened(gate.inside(root, file)) as content:
            size = os.fstat(content.fileno()).st_size
            if size != known["bytes"]:
                return f"holds {size} bytes, {known['bytes']} were written"
            if hashlib.file_digest(content, "sha256").hexdigest() != known["sha256"]:
                return "was changed after it was written (SHA-256 differs)"
    except gate.GateError as problem:
        return str(problem)
    return ""


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
    try:
        table = read_table(root, recipe)
    except gate.GateError as problem:
        what = "the table is missing: the run that made the dataset was cut off"
        yield Problem(TABLE, what if problem.missing else str(problem))
        return
    except DatasetError as problem:
        yield Problem(TABLE, str(problem))
        return
    if not frame_table(records, recipe).equals(table):
        yield Problem(TABLE, "the table does not say what the records of the rooms say")
