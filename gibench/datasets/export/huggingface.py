"""Parquet files with a card, as `datasets.load_dataset(FOLDER)` reads them and a hub shows them.

A row a frame: `image` (an 8-bit picture for people), the channels as (H, W, C) float32 or uint32 arrays, the camera as
matrices, and the columns of `frames.parquet`.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import datasets
import yaml
from PIL import Image

from gibench.datasets.card import channel_table
from gibench.datasets.errors import DatasetError
from gibench.datasets.export.frames import picture, row_of
from gibench.datasets.loading import Dataset
from gibench.rendering.channels import CHANNELS

SHARD_BYTES = 500e6
"""Size before compression after which the next file of a split begins."""

SPLIT = r"\w+(\.\w+)*"
"""Names of splits that the library takes (`datasets.naming`)."""

#: What a hub calls the licences that a recipe may name; others are "other".
LICENCES = {"CC0-1.0": "cc0-1.0", "CC-BY-4.0": "cc-by-4.0", "CC-BY-3.0": "cc-by-3.0"}


def write(dataset: Dataset, channels: tuple[str, ...], out: Path, tell: Any) -> None:
    """Write `README.md` and `data/SPLIT-00000-of-00001.parquet`.

    Raises DatasetError for a split that the library would not load.
    """
    names = channels or dataset[0].channels
    width, height = int(dataset.frames["width"].iloc[0]), int(dataset.frames["height"].iloc[0])
    done, splits = 0, list(dict.fromkeys(dataset.frames["split"]))
    for split in splits:
        if not re.fullmatch(SPLIT, split):
            raise DatasetError(
                f"split '{split}' cannot be read by the library datasets: its names are letters, digits and _ with "
                "single dots between; export to webdataset, or name the split otherwise in the recipe"
            )
    features = _features(dataset, names, (width, height))
    (out / "data").mkdir()
    for split in splits:
        part = dataset.split(split)

        def rows(part: Dataset = part) -> Iterator[dict[str, Any]]:
            nonlocal done
            for frame in part:
                arrays = frame.read(*names)
                row: dict[str, Any] = {**row_of(frame), **arrays}
                if "color" in arrays:
                    row["image"] = Image.fromarray(picture(arrays["color"], float(frame.row["exposure"])))
                yield row
                done += 1
                tell(done, len(dataset))

        with tempfile.TemporaryDirectory(dir=out) as cache, _without_bars():
            table = datasets.Dataset.from_generator(rows, features=features, cache_dir=cache)
            shards = max(1, round(table.data.nbytes / SHARD_BYTES))
            for number in range(shards):
                file = out / "data" / f"{split}-{number:05d}-of-{shards:05d}.parquet"
                table.shard(shards, number, contiguous=True).to_parquet(file)
            del table
    (out / "README.md").write_text(_card(dataset, names, splits), encoding="utf-8")


@contextmanager
def _without_bars() -> Iterator[None]:
    """Without the library's own progress bars, of which it draws two a split."""
    were_on = not datasets.are_progress_bars_disabled()
    datasets.disable_progress_bars()
    try:
        yield
    finally:
        if were_on:
            datasets.enable_progress_bars()


def _features(dataset: Dataset, names: tuple[str, ...], resolution: tuple[int, int]) -> Any:
    width, height = resolution
    kinds = {"i": "int64", "f": "float64", "b": "bool"}
    table = dataset.frames.drop(columns=["file", "bytes", "sha256"])
    return datasets.Features(
        {
            **({"image": datasets.Image()} if "color" in names else {}),
            **{name: datasets.Value(kinds.get(table[name].dtype.kind, "string")) for name in table},
            "camera_to_world": datasets.Array2D((4, 4), "float64"),
            "intrinsics": datasets.Array2D((3, 3), "float64"),
            **{
                name: datasets.Array3D(
                    (height, width, CHANNELS[name].components),
                    "uint32" if CHANNELS[name].dtype == "uint" else "float32",
                )
                for name in names
            },
        }
    )


def _card(dataset: Dataset, names: tuple[str, ...], splits: list[str]) -> str:
    manifest, frames = dataset.manifest, dataset.frames
    head = {
        "license": LICENCES.get(manifest["licence"], "other"),
        "tags": ["global-illumination", "rendering", "indoor", "hdr", "mitsuba"],
        "configs": [
            {
                "config_name": "default",
                "data_files": [{"split": name, "path": f"data/{name}-*"} for name in splits],
            }
        ],
    }
    return f"""---
{yaml.safe_dump(head, sort_keys=False)}---

# Rooms by gibench

{len(frames)} frames of {frames["room"].nunique()} rooms ({", ".join(sorted(set(frames["kind"])))}), rendered with
Mitsuba {manifest["versions"].get("mitsuba", "")} by gibench {manifest["versions"].get("gibench", "")}:
`{manifest["command"]}`. Licence: {manifest["licence"]}.

`camera_to_world` (4 × 4) is in OpenCV's convention (x right, y down, z forward), metres, world Z up; `intrinsics`
(3 × 3) in pixels, the outer corner of the first pixel at (0, 0). Radiance is linear Rec. 709; `image` is for people.
Splits go by room.

{channel_table(names)}
"""
