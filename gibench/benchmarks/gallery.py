"""A gallery: a page of pictures that shows what gibench makes and measures, all of them made by one command."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from PIL import Image

from gibench.benchmarks.errors import ResultsError
from gibench.benchmarks.results import Results, load
from gibench.benchmarks.scenes import scene_name
from gibench.datasets.files import write_whole
from gibench.datasets.loading import Dataset, open_dataset
from gibench.datasets.making import Progress, make
from gibench.datasets.previews import frame_panel, grid, image_of, thumbnail
from gibench.datasets.recipes import Recipe, load_preset
from gibench.metrics import reference_exposure, tone_map
from gibench.rendering.channels import SETS

WIDEST = 1600
"""Pixels of a picture of the page across."""

QUALITY = 82
"""Of the JPEGs."""

TITLES = {
    "rooms": "Rooms as they come, furnished and lit at random, each exposed by itself.",
    "channels": "One frame with all its channels.",
    "moving-light": "One room under an area light that moves, under one exposure. Nothing is loaded or compiled anew.",
    "environments": "Still lifes under environment maps, one of its own each.",
}


def recipes(*, rooms: int, spp: int) -> dict[str, Recipe]:
    """The datasets of a gallery, by name. rooms: of the first picture. spp: samples a pixel, then denoised."""
    common: dict[str, Any] = {"spp": spp, "resolution": [192, 144], "channels": ["color"], "rooms": 1}
    light = {"light": {"views": 6, "path": "walk", "moves": "light"}}
    overrides: dict[str, dict[str, Any]] = {
        "rooms": {"rooms": rooms, "views": 1},
        # Parts are noisier than their sum, and all of them are shown.
        "channels": {
            "views": 2,
            "path": "walk",
            "spp": 4 * spp,
            "channels": [s for s in SETS if s != "lighting"],
        },
        "moving-light": {"views": 0, "sequences": light, "lighting": "area-light"},
        "environments": {"rooms": 2, "views": 3, "kinds": ["still-life"], "lighting": "environments"},
    }
    return {name: load_preset("small", common | more) for name, more in overrides.items()}


def make_gallery(
    out: Path,
    runs: Sequence[Path] = (),
    *,
    rooms: int = 20,
    spp: int = 64,
    variant: str = "auto",
    workers: int = 1,
    on_progress: Callable[[Progress], None] = lambda progress: None,
) -> Path:
    """Make the datasets of a gallery below `out/data`, where they are not there yet, then the page and its pictures.

    runs: folders of results, whose methods are shown beside the reference. Returns the page, `out/index.md`. Raises
    ResultsError for a folder that holds none, and whatever `make` raises.
    """
    loaded = [load(run) for run in runs]
    lines = ["# Gallery", "", "All of it was made by one command, `gibench gallery`."]
    asked = recipes(rooms=rooms, spp=spp)
    for name in reversed(asked):  # the many rooms last
        make(out / "data" / name, asked[name], variant=variant, workers=workers, on_progress=on_progress)
    for name, title in TITLES.items():
        lines += _shown(out, name, _picture(name, open_dataset(out / "data" / name)), title)
    for results in loaded:
        track = str(results.run["track"])
        lines += _shown(
            out,
            track,
            _methods(results),
            f"Methods on the track {track}, beside the reference: one frame, under one exposure, with its time.",
        )
    write_whole(out / "index.md", "\n".join([*lines, ""]).encode())
    return out / "index.md"


def _picture(name: str, dataset: Dataset) -> Image.Image:
    if name == "channels":
        return frame_panel(dataset[len(dataset) - 1])  # the first has none before it to move from
    first = dataset[0]["color"]
    exposure = float(reference_exposure(first)) if name == "moving-light" else None
    tiles = []
    for number, row in enumerate(dataset.frames.to_dict("records")):
        title = f"room {row['room']}" if name == "rooms" else f"frame {number}"
        tiles.append((thumbnail(dataset.root / str(row["file"]), exposure), title, str(row["kind"])))
    return grid(tiles, columns=min(len(tiles), 5 if name == "rooms" else 3))


def _methods(results: Results) -> Image.Image:
    """The first frame of the first scene: its reference, and each method at its first setting."""
    records = [record for record in results.records() if record["status"] == "ok"]
    if not records:
        raise ResultsError(
            f"{results.root} has no whole result: `gibench bench list {results.root}` says why"
        )
    scene = scene_name(min(record["room"] for record in records))
    exposure = results.exposure(scene, 0)
    tiles = [(image_of(tone_map(results.reference(scene, 0), exposure)), "reference", "")]
    shown: set[str] = set()
    for record in sorted(records, key=lambda record: str(record["label"])):
        method = str(record["config"]["method"])
        ablation = ":" in method
        if record["config"]["scene"] == scene and method not in shown and not ablation:
            shown.add(method)
            image = image_of(tone_map(results.prediction(record["id"], 0), exposure))
            tiles.append((image, method, f"{1000 * record['frames'][0]['seconds']:.0f} ms"))
    factor = max(1, -(-192 // tiles[0][0].width))
    size = (tiles[0][0].width * factor, tiles[0][0].height * factor)
    tiles = [(image.resize(size, Image.Resampling.NEAREST), title, remark) for image, title, remark in tiles]
    return grid(tiles, columns=min(len(tiles), 5))


def _shown(out: Path, name: str, picture: Image.Image, title: str) -> list[str]:
    """Write a picture, and return its lines of the page."""
    if picture.width > WIDEST:
        height = round(picture.height * WIDEST / picture.width)
        picture = picture.resize((WIDEST, height), Image.Resampling.LANCZOS)
    content = io.BytesIO()
    picture.save(content, "jpeg", quality=QUALITY, optimize=True)
    write_whole(out / f"{name}.jpg", content.getvalue())
    return ["", title, "", f"[![{title}]({name}.jpg)]({name}.jpg)"]
