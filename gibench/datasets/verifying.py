"""Checking a dataset on disk against its own records and against the channel contract."""

from __future__ import annotations

import hashlib
import io
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gibench import gate
from gibench.datasets.cache import cache_faults
from gibench.datasets.errors import DatasetError, StorageError
from gibench.datasets.exr import decode, is_radiance, total_of_parts
from gibench.datasets.exr_header import HeaderError, read_header
from gibench.datasets.folder import CARD, ENVIRONMENTS, MANIFEST, PREVIEW, TABLE, whole_rooms
from gibench.datasets.lightings import kept_panorama
from gibench.datasets.manifest import (
    frame_table,
    other_values,
    read_manifest,
    recipe_of,
    records_digest,
    rejections_of,
    room_record,
    short,
    totals_of,
)
from gibench.datasets.recipes import Recipe
from gibench.datasets.table import read_table
from gibench.errors import GibenchError
from gibench.rendering.channels import CHANNELS, PARTS

if TYPE_CHECKING:
    import pandas as pd

#: Types in which a kind of channel may be stored.
STORED = {"half": (np.float16, np.float32), "float": (np.float32,), "uint": (np.uint32,)}


@dataclass(frozen=True)
class Problem:
    """Something that is wrong. file: from the dataset's folder."""

    file: str
    what: str


def verify(root: Path, on_room: Callable[[int, int], None] = lambda done, of: None) -> list[Problem]:
    """Check a whole dataset; an empty list says that nothing is wrong.

    Hashes of all files, completeness against the recipe, the recipe against what the dataset was begun with, totals
    against the rooms, and for each frame: channels, types, resolution, finite values, no negative radiance, and `color`
    equal to the sum of its five parts to the last bit.
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
    table = frame_table(records, recipe)
    problems.extend(_table_problems(root, table, recipe))
    problems.extend(Problem(MANIFEST, what) for what in _contradictions(manifest, recipe))
    if len(records) == len(expected):
        problems.extend(Problem(*fault) for fault in cache_faults(root, table))
        if manifest["complete"]:
            problems.extend(Problem(MANIFEST, what) for what in _wrong_sums(manifest, records, table, recipe))
    problems.extend(_page_problems(root, manifest))
    return problems


def _contradictions(manifest: Mapping[str, Any], recipe: Recipe) -> Iterator[str]:
    """Say where the recipe is not the one that the dataset was begun with. Files count by their names alone."""
    there = {key: value for key, value in manifest["identity"].items() if key not in recipe.keys_of_files}
    for key, (begun, now) in other_values(there, recipe.identity(files=False)).items():
        yield f"its recipe contradicts its identity ({key}: {short(now)} in one, {short(begun)} in the other)"
    for key in sorted(recipe.keys_of_files - manifest["identity"].keys()):
        yield f"its recipe contradicts its identity ({key} is in one of them only)"


def _wrong_sums(
    manifest: Mapping[str, Any], records: Sequence[Mapping[str, Any]], table: pd.DataFrame, recipe: Recipe
) -> Iterator[str]:
    """Say what a complete dataset sums up of its rooms, and they say otherwise. Older versions summed up less."""
    summed = manifest.get("totals")
    if summed is None:
        yield "it has no totals, though it is complete"
        return
    totals = totals_of(records, table, recipe)
    del totals["denoise_changes"]  # those above a limit that versions may move
    for key, found in totals.items():
        if key in summed and not _same(summed[key], found):
            yield f"its total of {key} is {short(summed[key])}, the rooms have {short(found)}"
    if manifest.get("rejections") not in (None, rejections_of(records)):
        yield "its rejections are not those of the rooms"
    if manifest.get("records") not in (None, records_digest(records)):
        yield "a frames.json of its rooms is not what it was when the dataset was whole"


def _same(there: Any, found: Any) -> bool:
    """Whether values are equal, numbers but for the order in which they were summed."""
    if isinstance(found, dict) and isinstance(there, dict):
        return there.keys() == found.keys() and all(_same(there[key], found[key]) for key in found)
    if isinstance(found, float) and isinstance(there, int | float):
        return math.isclose(there, found, rel_tol=1e-9)
    return bool(there == found)


def _page_problems(root: Path, manifest: Mapping[str, Any]) -> Iterator[Problem]:
    """What is wrong with the pages for people. Older versions wrote no card."""
    from PIL import Image

    try:
        Image.open(io.BytesIO(gate.read_inside(root, PREVIEW)), formats=["png"]).verify()
    except gate.GateError as problem:
        what = "the contact sheet is missing: `gibench dataset preview` makes it"
        yield Problem(PREVIEW, what if problem.missing else str(problem))
    except Exception:  # Pillow raises whatever a broken part made it stumble over
        yield Problem(PREVIEW, "the contact sheet is damaged: `gibench dataset preview` makes it anew")
    if manifest.get("card") and not (root / CARD).is_file():
        yield Problem(
            CARD,
            f"the card is missing: remove {TABLE} and run `{manifest['command']}`, which writes both anew",
        )


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


def _table_problems(root: Path, told: pd.DataFrame, recipe: Recipe) -> Iterator[Problem]:
    """What is wrong with the table of frames. told: what the records of the rooms say."""
    try:
        table = read_table(root, recipe)
    except gate.GateError as problem:
        what = "the table is missing: the run that made the dataset was cut off"
        yield Problem(TABLE, what if problem.missing else str(problem))
        return
    except DatasetError as problem:
        yield Problem(TABLE, str(problem))
        return
    if not told.equals(table):
        yield Problem(TABLE, "the table does not say what the records of the rooms say")
