"""A small dataset and a small run as gibench writes them, made without a renderer in a tenth of a second."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from gibench.benchmarks.predictions import encode as encode_prediction
from gibench.benchmarks.result_files import FORMAT, RunFolder, key_of
from gibench.datasets import exr, manifest
from gibench.datasets.files import as_json
from gibench.datasets.folder import RECORD, room_folder
from gibench.datasets.previews import contact_sheet, write_picture
from gibench.datasets.recipes import Recipe
from tests.datasets.fakes import FACTS, pixels, tiny

FRAMES = 3
ALL = ("radiance", "surface", "motion")
MACHINE: dict[str, Any] = {
    "platform": "Linux",
    "cpu": "a processor",
    "cores": 2,
    "memory": 2**33,
    "gpu": None,
    "threads": 2,
    "variant": "fake",
    "versions": {"python": "3.11", "mitsuba": "0"},
}


def _fingerprint(content: bytes) -> dict[str, Any]:
    return {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}


def dataset(root: Path, rooms: int = 2, views: int = 2, **changes: Any) -> Recipe:
    """Write a whole dataset."""
    recipe = tiny(rooms, views=views, resolution=(24, 18), channels=ALL, **changes)
    for room in range(rooms):
        _room(room_folder(root, room), recipe, room)
    facts = {**FACTS, "versions": {"gibench": "0", "mitsuba": "0"}}
    machine = {name: MACHINE[name] for name in ("platform", "cpu", "cores", "memory")}
    whole, table = manifest.gathered(
        root, manifest.new_manifest(recipe, facts, {**machine, "python": "3.11"}, "make-dataset --rooms 2")
    )
    manifest.write_table(root, table)
    write_picture(root / "preview.png", contact_sheet(root, table))
    manifest.write_manifest(root, whole)
    return recipe


def _room(folder: Path, recipe: Recipe, number: int) -> None:
    (folder / "frames").mkdir(parents=True)
    files = {}
    for name in ("room.json", "scene.xml", "room.glb"):
        content = b"{}" if name == "room.json" else f"{name} of {number}".encode()
        (folder / name).write_bytes(content)
        files[name] = _fingerprint(content)
    frames = []
    for view in recipe.rendered_views():
        content = exr.encode(pixels(recipe.channels, recipe.resolution, 7 * number + view))
        (folder / "frames" / f"{view:04d}.exr").write_bytes(content)
        frames.append(
            {
                "view": view,
                "file": f"frames/{view:04d}.exr",
                **_fingerprint(content),
                "camera": [0.0, 0.0, 1.5],
                "target": [1.0, 0.0, 1.5],
                "fov": 1.2,
                "path": recipe.path if recipe.path_views else "",
                "step": view if recipe.path_views else 0,
                "exposure": 1.0,
                "largest": 20.0,
                "spp": 4,
                "paths": 4 * 24 * 18,
                "invalid_paths": 0,
                "median_error": 0.1,
                "kernel_seconds": 0.1,
                "denoise_seconds": 0.0,
                "seconds": 0.1,
                "seed": view,
            }
        )
    record = {
        "room": number,
        "kind": "living",
        "split": "train",
        "given_cameras": 0,
        "materials": ["oak"],
        "shapes": ["floor.0"],
        "rejections": {},
        "seconds": {"build": 0.1, "write": 0.1, "load": 0.1, "render": 0.1},
        "frames": frames,
        "files": files,
    }
    (folder / RECORD).write_bytes(as_json(record))


def run(root: Path) -> RunFolder:
    """Write a run of one room with two results, of which one failed, and without scores."""
    path = {"path": "walk", "path_views": FRAMES, "rendered": "path"}
    identity = {}
    for which, seed in (("reference", 0), ("reference-again", 1)):
        recipe = dataset(root / "scenes" / which, 1, 1, **path, sample_seed=seed)
        identity[which] = recipe.identity()
    from gibench.benchmarks.scenes import scenes_in

    folder = RunFolder(root)
    scene = scenes_in(*folder.references)[0]
    folder.results.mkdir()
    folder.scores.mkdir()
    for method, failed in (("constant", False), ("plain", False), ("wrong", True)):
        config = {
            "track": "walkthrough",
            "scene": scene.name,
            "scene_sha256": scene.sha256,
            "frames": FRAMES,
            "resolution": [24, 18],
            "warmup": 1,
            "training": None,
            "method": method,
            "knobs": {"shade": 1.0},
            "seed": 0,
            "code": {"gibench": "0"},
            "machine": "0123456789ab",
        }
        key = key_of(config)
        record = {
            "format": FORMAT,
            "gibench": "0",
            "id": key[:16],
            "key": key,
            "config": config,
            "title": f"The method {method}",
            "family": "toys",
            "paper": "none",
            "label": f"{method} shade=1",
            "room": 0,
            "kind": "living",
            "created": "2026-01-01T00:00:00+00:00",
            "machine": MACHINE,
        }
        if failed:
            record |= {"status": "failed", "phase": "render", "reason": "while rendering: no bricks"}
            record |= {"traceback": "Traceback\nValueError: no bricks", "log": "", "prepare": None}
        else:
            record |= _good(folder.predictions(key[:16]), 0.5 if method == "plain" else 1.0)
        folder.result_file(key[:16]).write_bytes(as_json(record))
    folder.write_run(
        {
            "format": FORMAT,
            "gibench": "0",
            "track": "walkthrough",
            "title": "Walkthrough",
            "question": "does it hold?",
            "preset": "smoke",
            "seed": 0,
            "parts": ["full", "specular"],
            "metrics": ["rmse_display", "rmse"],
            "sequence_metrics": ["temporal_difference"],
            "created": "2026-01-01T00:00:00+00:00",
            "equal_time": [],
            "runs": [],
            "command": "gibench bench run --out R",
            "identity": identity,
            "base_settings": {"constant": {"shade": 1.0}, "plain": {"shade": 1.0}},
            "machine": {**MACHINE, "id": "0123456789ab"},
            "machines": {"0123456789ab": MACHINE},
        }
    )
    return folder


def _good(predictions: Path, shade: float) -> dict[str, Any]:
    predictions.mkdir()
    files = {}
    for frame in range(FRAMES):
        image = np.full((18, 24, 3), shade, np.float32)
        content = encode_prediction({"full": image, "specular": image / 2})
        (predictions / f"{frame:04d}.exr").write_bytes(content)
        files[f"{frame:04d}.exr"] = _fingerprint(content)
    prepare = {"seconds": 1.0, "lightmap": 1.0, "probes": 0.0, "references": 0.0, "training": 0.0}
    prepare |= {"other": 0.0, "bytes": 100, "wall_seconds": 1.0, "made_seconds": 1.0, "stages": {}}
    prepare["bakes"] = [{"kind": "lightmap", "folder": "lightmap-0", "seconds": 1.0, "bytes": 100}]
    return {
        "status": "ok",
        "prepare": {**prepare, "training_views_read": 0},
        "warmup_seconds": 0.1,
        "frames": [{"seconds": 0.01, "stages": {"gather": 0.005}, "extra": {}}] * FRAMES,
        "peak_mb": 100.0,
        "gpu_mb": None,
        "files": files,
    }


def edited(path: Path, **changes: Any) -> None:
    """Change keys of a JSON file."""
    path.write_bytes(as_json({**json.loads(path.read_text()), **changes}))
