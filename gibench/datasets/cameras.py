"""The camera of a frame as columns of the table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from gibench.rendering.camera import PinholeCamera

_AXES = ("x", "y", "z")

#: Columns of the camera of a frame. `up` is NaN where it is Z.
COLUMNS = {
    **{f"{what}_{axis}": "float64" for what in ("camera", "target") for axis in _AXES},
    "fov": "float64",
    **{f"up_{axis}": "float64" for axis in _AXES},
    **{f"principal_point_{axis}": "float64" for axis in _AXES[:2]},
    "mirrored": "int64",
}


def columns_of(record: Mapping[str, Any]) -> dict[str, Any]:
    """The columns of a frame as its room's record has it, which leaves out what is ordinary."""
    vectors = {
        "camera": record["camera"],
        "target": record["target"],
        "up": record.get("up") or (math.nan, math.nan, math.nan),
        "principal_point": record.get("principal_point", (0.0, 0.0)),
    }
    values = {
        f"{what}_{axis}": value
        for what, vector in vectors.items()
        for axis, value in zip(_AXES, vector, strict=False)
    }
    return {**values, "fov": record["fov"], "mirrored": int(record.get("mirrored", False))}


def camera_of(row: Mapping[str, Any]) -> PinholeCamera:
    """The camera of a row of the table. Raises CameraError for a row that nothing of ours has written."""
    up = _vector(row, "up")
    return PinholeCamera(
        _vector(row, "camera"),
        _vector(row, "target"),
        float(row["fov"]),
        None if all(map(math.isnan, up)) else up,
        (float(row["principal_point_x"]), float(row["principal_point_y"])),
        bool(row["mirrored"]),
    )


def _vector(row: Mapping[str, Any], what: str) -> tuple[float, float, float]:
    x, y, z = (float(row[f"{what}_{axis}"]) for axis in _AXES)
    return x, y, z
