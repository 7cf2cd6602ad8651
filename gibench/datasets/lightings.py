"""The light of frames as columns of the table, and the environments that lie beside the rooms, each once."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gibench import gate
from gibench.datasets.checked import shown
from gibench.datasets.errors import DatasetError
from gibench.datasets.exr import decode
from gibench.datasets.files import write_whole
from gibench.datasets.folder import ENVIRONMENTS
from gibench.rendering.lighting import AreaLight, EnvironmentMap, Lighting
from gibench.rendering.panoramas import Panorama, Pixels

_AXES = ("x", "y", "z")
_PLACES = {"centre": "light", "direction": "light_direction", "up": "light_up"}

#: Columns of the light of a frame, where the recipe says that it has one of its own. Numbers are NaN and texts empty
#: where they do not apply.
COLUMNS = {
    "lighting": "str",
    **{f"{column}_{axis}": "float64" for column in _PLACES.values() for axis in _AXES},
    "light_width": "float64",
    "light_height": "float64",
    **{f"light_{color}": "float64" for color in ("red", "green", "blue")},
    "environment": "str",
    "environment_sha256": "str",
    "environment_rotation": "float64",
}


def columns_of(record: Mapping[str, Any] | None) -> dict[str, Any]:
    """The columns of a lighting as a room's record has it (`scene_files.lighting_record`); None: the room's own."""
    record = record or {"kind": "own"}
    row: dict[str, Any] = {name: "" if kind == "str" else None for name, kind in COLUMNS.items()}
    row["lighting"] = record["kind"]
    if record["kind"] == "area-light":
        for key, column in _PLACES.items():
            row |= {f"{column}_{axis}": value for axis, value in zip(_AXES, record[key], strict=True)}
        row |= {"light_width": record["width"], "light_height": record["height"]}
        names = ("light_red", "light_green", "light_blue")
        row |= dict(zip(names, record["radiance"], strict=True))
    elif record["kind"] == "environment":
        row |= {"environment": record["environment"], "environment_sha256": record["sha256"]}
        row["environment_rotation"] = record["rotation"]
    return row


def lighting_of(row: Mapping[str, Any], root: Path) -> Lighting:
    """The light of a row of the table. root: of its dataset, from which an environment is read when it is asked for.

    Raises LightingError and `DatasetError` for a row that nothing of ours has written.
    """
    kind = row.get("lighting", "own")
    if kind == "area-light":
        places = {key: _vector(row, column) for key, column in _PLACES.items()}
        red, green, blue = (float(row[f"light_{color}"]) for color in ("red", "green", "blue"))
        return Lighting(
            AreaLight(
                width=row["light_width"], height=row["light_height"], radiance=(red, green, blue), **places
            )
        )
    if kind == "environment":
        panorama = kept_panorama(root, str(row["environment"]), str(row["environment_sha256"]))
        return Lighting(environment=EnvironmentMap(panorama, float(row["environment_rotation"])))
    return Lighting()


def _vector(row: Mapping[str, Any], column: str) -> tuple[float, float, float]:
    x, y, z = (float(row[f"{column}_{axis}"]) for axis in _AXES)
    return x, y, z


def _file(sha256: str) -> str:
    """The file of a panorama, from the folder of its dataset. Raises `DatasetError` for a text that is no hash."""
    if not re.fullmatch("[0-9a-f]{64}", sha256):
        raise DatasetError(f"an environment is called {shown(sha256)}, which is no SHA-256")
    return f"{ENVIRONMENTS}/{sha256}.exr"


def keep_panorama(root: Path, panorama: Panorama) -> None:
    """Write a panorama into a dataset unless it is there: OpenEXR, float32, bit for bit what lights the frames."""
    import OpenEXR

    path = root / _file(panorama.sha256)
    if path.is_file():
        return
    path.parent.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="gibench-") as scratch:
        file = Path(scratch) / path.name
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"RGB": panorama.pixels.copy()}).write(str(file))
        content = file.read_bytes()
    write_whole(path, content)


def kept_panorama(root: Path, name: str, sha256: str) -> Panorama:
    """A panorama of a dataset, read when its pixels are asked for. Raises `DatasetError`, then also `StorageError`."""
    return Panorama(name, sha256, partial(_read, root, _file(sha256)))


def _read(root: Path, file: str) -> Pixels:
    pixels = decode(gate.inside(root, file), ["color"])["color"]
    return np.ascontiguousarray(pixels, dtype=np.float32)
