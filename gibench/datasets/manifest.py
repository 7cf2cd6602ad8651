"""`dataset.json` and `frames.parquet`: what a dataset says about itself.

Each room carries its own record (`frames.json`), written with the room. The manifest and the table are
gathered from these records, so they can be written anew at any time.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from gibench import gate
from gibench.datasets import cameras, lightings, records
from gibench.datasets.checked import first_problem, parsed, plain, shown
from gibench.datasets.errors import DatasetError, FolderError
from gibench.datasets.files import as_json, write_whole
from gibench.datasets.folder import MANIFEST, RECORD, TABLE, room_folder, whole_rooms
from gibench.datasets.recipes import Recipe

if TYPE_CHECKING:
    import pandas as pd

#: Version of the layout on disk; a reader refuses what it does not know.
FORMAT = 1


def read_manifest(root: Path) -> dict[str, Any]:
    """Read `dataset.json`. Raises `DatasetError` when the folder is no dataset or of another format."""
    try:
        content = gate.read_inside(root, MANIFEST)
        manifest = plain(content)
        if (there := manifest.get("format", FORMAT)) != FORMAT:
            versions = manifest.get("versions")
            maker = versions.get("gibench", "unknown") if isinstance(versions, dict) else "unknown"
            there, maker = shown(str(there))[1:-1], shown(str(maker))[1:-1]
            raise DatasetError(
                f"{root} is of format {there}, this gibench reads format {FORMAT}: install the gibench that made it "
                f"({maker})"
            )
        manifest = parsed(content, records.Manifest)
        recipe_of(manifest)
    except gate.GateError as problem:
        if not problem.missing:
            raise DatasetError(f"{root / MANIFEST} is damaged ({problem})") from None
        raise DatasetError(f"{root} is no dataset: it has no readable {MANIFEST}") from None
    except ValidationError as problems:
        raise DatasetError(
            f"{root / MANIFEST} is damaged: it is no manifest of a dataset (recipe: {first_problem(problems)})"
        ) from None
    except ValueError as problem:
        raise DatasetError(
            f"{root / MANIFEST} is damaged: it is no manifest of a dataset ({problem})"
        ) from None
    return manifest


def recipe_of(manifest: Mapping[str, Any]) -> Recipe:
    """Return the recipe that a dataset was made from."""
    return Recipe.model_validate(manifest["recipe"])


def new_manifest(
    recipe: Recipe, facts: Mapping[str, Any], machine: Mapping[str, Any], command: str
) -> dict[str, Any]:
    """Return the manifest of a dataset that has no room yet. facts: what `Renderer` answered."""
    return {
        "format": FORMAT,
        "complete": False,
        "recipe": recipe.model_dump(mode="json"),
        "identity": recipe.identity(),
        "licence": recipe.licence,
        "command": command,
        "variant": facts["variant"],
        "versions": dict(facts["versions"]),
        "machine": {**machine, "gpu": facts["gpu"]},
        "runs": [],
        "rejected_rooms": {},
    }


def refuse_other(root: Path, manifest: Mapping[str, Any], recipe: Recipe) -> None:
    """Raise `FolderError` where a folder's dataset is not the one that a recipe asks for.

    More rooms than there are is no difference: the dataset is extended.
    """
    differences = other_values(manifest["identity"], recipe.identity())
    if recipe.rooms < manifest["recipe"]["rooms"]:
        differences = {"rooms": (manifest["recipe"]["rooms"], recipe.rooms)} | differences
    if differences:
        listed = "; ".join(
            f"{key}: {short(a)} there, {short(b)} asked" for key, (a, b) in differences.items()
        )
        raise FolderError(
            f"{root} holds another dataset ({listed}): to continue it run `{manifest['command']}`, "
            "for a new one choose another --out"
        )


def other_values(there: Mapping[str, Any], asked: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Keys in which two identities of recipes differ, each with both values; of tables also the order of their names.

    It decides as much as the names: the split of a room, the number of a view, the map of a frame.
    """
    differences = {}
    for key in [*asked, *(there.keys() - asked.keys())]:
        one, other = there.get(key), asked.get(key)
        if one != other:
            differences[key] = (one, other)
        elif isinstance(one, dict) and isinstance(other, dict) and list(one) != list(other):
            differences[f"order of {key}"] = (list(one), list(other))
    return differences


def refuse_other_makers(root: Path, manifest: Mapping[str, Any], facts: Mapping[str, Any]) -> None:
    """Raise `FolderError` where this machine's variant or versions would mix other pixels into a dataset."""
    there = {"variant": manifest["variant"], **manifest["versions"]}
    here = {"variant": facts["variant"], **facts["versions"]}
    listed = "; ".join(
        f"{key}: {there.get(key)} there, {here.get(key)} here"
        for key in {**there, **here}
        if there.get(key) != here.get(key)
    )
    if listed:
        raise FolderError(
            f"{root} was begun with something else ({listed}) and its pixels would not match: "
            "use what began it (--variant, pip install), or choose another --out"
        )


def short(value: Any) -> str:
    """JSON of a value in a message, cut to a length."""
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else text[:57] + "…"


def room_record(root: Path, room: int) -> dict[str, Any]:
    """Read the record of a whole room. Raises `DatasetError` when it is damaged."""
    path = room_folder(root, room) / RECORD
    try:
        record = parsed(gate.read_inside(root, path.relative_to(root)), records.RoomRecord)
    except (gate.GateError, ValueError) as problem:
        raise DatasetError(
            f"{path} is damaged ({problem}): remove {path.parent} and make the room again"
        ) from None
    if record["room"] != room:
        raise DatasetError(f"{path} is the record of room {record['room']}: remove {path.parent}")
    return record


def gathered(root: Path, manifest: Mapping[str, Any]) -> tuple[dict[str, Any], pd.DataFrame]:
    """Gather the records of all whole rooms into the manifest with its totals and the table of frames."""
    records = [room_record(root, room) for room in whole_rooms(root)]
    recipe = recipe_of(manifest)
    table = frame_table(records, recipe)
    rejected = {r: why for r, why in manifest["rejected_rooms"].items() if int(r) < recipe.rooms}
    return {
        **manifest,
        "complete": len(records) + len(rejected) >= recipe.rooms,
        "rejected_rooms": rejected,
        "rejections": rejections_of(records),
        "totals": totals_of(records, table, recipe),
        "records": records_digest(records),
    }, table


def rejections_of(records: Iterable[Mapping[str, Any]]) -> dict[str, int]:
    """Count what was rejected in rooms, by its reason."""
    rejections: Counter[str] = Counter()
    for record in records:
        rejections.update(record["rejections"])
    return dict(sorted(rejections.items()))


def records_digest(records: Iterable[Mapping[str, Any]]) -> str:
    """SHA-256 of the records of rooms, in their order; what they hold besides the table is in nothing else."""
    digest = hashlib.sha256()
    for record in records:
        digest.update(json.dumps(record, sort_keys=True).encode() + b"\n")
    return digest.hexdigest()


def totals_of(records: Sequence[Mapping[str, Any]], table: pd.DataFrame, recipe: Recipe) -> dict[str, Any]:
    """Sums over the rooms that are whole. table: of their records."""
    files = sum(file["bytes"] for record in records for file in record["files"].values())
    totals = {
        "rooms": len(records),
        "frames": len(table),
        "bytes": int(table["bytes"].sum()) + files,
        "frame_bytes": int(table["bytes"].sum()),
        "paths": int(table["paths"].sum()),
        "invalid_paths": int(table["invalid_paths"].sum()),
        "kernel_seconds": float(table["kernel_seconds"].sum()),
        "denoise_seconds": float(table["denoise_seconds"].sum()),
        "room_seconds": {
            lap: sum(record["seconds"][lap] for record in records)
            for lap in ("build", "write", "load", "render")
        },
        "median_error": float(table["median_error"].median()) if len(table) else None,
        "denoise_changes": large_changes(table),
        "processors": {name: int(count) for name, count in table["processor"].value_counts().items()},
        "splits": {split: int((table["split"] == split).sum()) for split in recipe.splits},
    }
    if totals["median_error"] != totals["median_error"]:  # no frame has samples enough for an error
        totals["median_error"] = None
    return totals


def large_changes(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Frames of which denoising changed the mean of a part by more than it may, the largest change first."""
    from gibench.rendering.denoise import ALLOWED_CHANGE

    size = table["denoise_change"].abs()
    order = size[size > ALLOWED_CHANGE].sort_values(ascending=False, kind="stable").index
    rows = table.loc[order, ["room", "view", "denoise_change"]].to_numpy(dtype="float64").tolist()
    return [{"room": int(room), "view": int(view), "change": change} for room, view, change in rows]


def processors_told(manifest: Mapping[str, Any]) -> str:
    """Say that processors of several kinds made a dataset, and how many frames each; empty where they did not.

    They round differently: the last bits of their pixels may differ, and what follows from them.
    """
    counts = (manifest.get("totals") or {}).get("processors", {})
    if len(counts) < 2:
        return ""
    listed = ", ".join(f"{name or 'unknown'} {count}" for name, count in counts.items())
    return f"{len(counts)} kinds ({listed} frames): the last bits of pixels may differ between them"


def frame_table(records: Iterable[Mapping[str, Any]], recipe: Recipe) -> pd.DataFrame:
    """Return a row a frame, in the order of rooms and views.

    Columns: room, view, split, kind, file (from the dataset's folder), sha256, bytes, width, height, camera_x … z and
    target_x … z (m), fov (horizontal, rad), up_x … z (NaN: Z is up), principal_point_x, y (from the middle of the image
    to the right and down, as shares of its width and height), mirrored (0 or 1), path, step, exposure (for display),
    largest (value of color), spp, paths, invalid_paths (counted as 0), median_error (relative standard error of color,
    before denoising), kernel_seconds, denoise_seconds, denoise_change (by how much denoising changed the mean of a
    part, where it is most), seconds (all of the renderer's time), seed, processor (that rendered it). Where frames have
    light of their own, also those of `lightings.COLUMNS`: lighting ("area-light" or "environment"), light_x … z
    (centre, m), light_direction_x … z, light_up_x … z (unit), light_width, light_height (m), light_red … blue
    (radiance), environment (its name), environment_sha256 (of its pixels), environment_rotation (about Z, rad).
    """
    import pandas as pd

    columns = columns_of(recipe)
    rows = [
        {
            "room": record["room"],
            "view": frame["view"],
            "split": record["split"],
            "kind": record["kind"],
            "file": f"rooms/{record['room']:06d}/{frame['file']}",
            "sha256": frame["sha256"],
            "bytes": frame["bytes"],
            "width": recipe.resolution[0],
            "height": recipe.resolution[1],
            **cameras.columns_of(frame),
            "path": frame["path"],
            "step": frame["step"],
            "exposure": frame["exposure"],
            "largest": frame["largest"],
            "spp": frame["spp"],
            "paths": frame["paths"],
            "invalid_paths": frame["invalid_paths"],
            "median_error": frame["median_error"],
            "kernel_seconds": frame["kernel_seconds"],
            "denoise_seconds": frame["denoise_seconds"],
            "denoise_change": frame.get("denoise_change"),  # rooms of older versions have none
            "seconds": frame["seconds"],
            "seed": frame["seed"],
            "processor": frame.get("processor", ""),  # rooms of older versions have none
            **({} if recipe.lighting == "own" else lightings.columns_of(frame.get("lighting"))),
        }
        for record in records
        for frame in record["frames"]
    ]
    return pd.DataFrame(rows, columns=list(columns)).astype(columns)


#: Columns of `frames.parquet` and their types, whatever the recipe.
COLUMNS = {
    "room": "int64",
    "view": "int64",
    "split": "str",
    "kind": "str",
    "file": "str",
    "sha256": "str",
    "bytes": "int64",
    "width": "int64",
    "height": "int64",
    **cameras.COLUMNS,
    "path": "str",
    "step": "int64",
    "exposure": "float64",
    "largest": "float64",
    "spp": "int64",
    "paths": "int64",
    "invalid_paths": "int64",
    "median_error": "float64",
    "kernel_seconds": "float64",
    "denoise_seconds": "float64",
    "denoise_change": "float64",
    "seconds": "float64",
    "seed": "int64",
    "processor": "str",
}


def columns_of(recipe: Recipe) -> dict[str, str]:
    """Columns of `frames.parquet` and their types."""
    return COLUMNS if recipe.lighting == "own" else COLUMNS | lightings.COLUMNS


def write_manifest(root: Path, manifest: Mapping[str, Any]) -> None:
    """Write `dataset.json`."""
    write_whole(root / MANIFEST, as_json(manifest))


def write_table(root: Path, table: pd.DataFrame) -> None:
    """Write `frames.parquet`."""
    content = io.BytesIO()
    table.to_parquet(content, index=False)
    write_whole(root / TABLE, content.getvalue())
