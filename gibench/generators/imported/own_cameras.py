"""Cameras that a scene brings along, and those of a camera file."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gibench import gate
from gibench.generators.imported.changes import Change
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.transforms import matrix_of, numbers
from gibench.generators.imported.tree import Node
from gibench.generators.parts import Camera, FloatArray

NEGLIGIBLE_ROLL = math.radians(0.1)
FULL_FRAME = math.hypot(36.0, 24.0)
"""Diagonal of the film that focal lengths are given for, mm."""

DEFAULT_FOCAL_LENGTH = 50.0
"""Mitsuba's, mm."""


@dataclass(frozen=True)
class GivenCamera:
    """A pinhole camera whose field of view may depend on the shape of the image.

    position, target: metres, Z up. angle: field of view, radians. axis: what it spans: "x", "y", "diagonal", "smaller"
    or "larger". near: what is closer along the optical axis is cut away by Mitsuba, and seen here; metres. where: its
    place in the scene file.
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    angle: float
    axis: str
    near: float = 0.0
    where: str = ""

    def at(self, resolution: tuple[int, int]) -> Camera:
        """The camera for images of this (width, height), as Mitsuba would fit it."""
        width, height = resolution
        axis = self.axis
        if axis in ("smaller", "larger"):
            axis = "x" if (width < height) == (axis == "smaller") else "y"
        extent = {"x": width, "y": height, "diagonal": math.hypot(width, height)}[axis]
        fov = 2 * math.atan(math.tan(self.angle / 2) * width / extent)
        return Camera(self.position, self.target, fov)


Note = Callable[..., None]


def cameras_of(root: Node, note: Note) -> list[GivenCamera]:
    """The perspective cameras of a placed scene, in the order of the file; `note` is told of what is lost."""
    cameras = []
    for sensor in root.nodes("sensor"):
        if sensor.type not in ("perspective", "thinlens"):
            note(sensor, f"a {sensor.type} sensor is left out: only perspective cameras can be used", True)
            continue
        if sensor.type == "thinlens":
            note(sensor, "a thin lens is a pinhole: everything is in focus", True)
        for name in ("principal_point_offset_x", "principal_point_offset_y"):
            offset = sensor.property(name)
            if offset is not None and numbers(offset, offset.get("value", ""), 1)[0] != 0:
                note(sensor, f"{name} is left out", True)
        matrix = matrix_of(sensor.property("to_world"))
        angle, axis = _field_of_view(sensor)
        camera, losses = _aimed(matrix, angle, axis, sensor.where)
        for loss in losses:
            note(sensor, loss, True)
        near = sensor.property("near_clip")
        # What lies along the optical axis before this is cut away; the scene's scale is in the matrix.
        size = float(np.linalg.norm(matrix[:3, 2]))
        clip = 0.0 if near is None else size * float(numbers(near, near.get("value", ""), 1)[0])
        cameras.append(replace(camera, near=clip, where=sensor.where))
    return cameras


def _aimed(matrix: FloatArray, angle: float, axis: str, where: str) -> tuple[GivenCamera, list[str]]:
    """A camera from its matrix, columns left, up, forward and position; and what of it is left out, in words."""
    if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix[:3, :3])) < 1e-12:
        raise SceneFileError(f"{where}: the camera's transformation is singular")
    if not 0 < angle < math.pi:
        raise SceneFileError(f"{where}: a field of view of {math.degrees(angle):g} degrees is none")
    forward = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    up = matrix[:3, 1] / np.linalg.norm(matrix[:3, 1])
    position = matrix[:3, 3]
    level = np.cross([0.0, 0.0, 1.0], forward)
    roll = 0.0
    if np.linalg.norm(level) > 1e-6:
        level /= np.linalg.norm(level)
        upright = np.cross(forward, level)
        roll = math.atan2(float(np.dot(up, level)), float(np.dot(up, upright)))
    losses = ["a mirrored camera looks the right way round"] if np.linalg.det(matrix[:3, :3]) < 0 else []
    if abs(roll) > NEGLIGIBLE_ROLL:
        losses.append(f"a camera's roll of {math.degrees(roll):.1f} degrees is left out")
    return GivenCamera(_triple(position), _triple(position + 2 * forward), angle, axis), losses


def _triple(values: FloatArray) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _field_of_view(sensor: Node) -> tuple[float, str]:
    axis = sensor.value("fov_axis", "x")
    if axis not in ("x", "y", "diagonal", "smaller", "larger"):
        raise SceneFileError(f"{sensor.where}: fov_axis '{axis}' is none of x, y, diagonal, smaller, larger")
    fov = sensor.property("fov")
    if fov is not None:
        return math.radians(float(numbers(fov, fov.get("value", ""), 1)[0])), axis
    length = sensor.property("focal_length")
    millimetres = DEFAULT_FOCAL_LENGTH
    if length is not None:
        match = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*(mm)?\s*", length.get("value", ""), re.ASCII)
        if match is None or not 0 < float(match[1]) < math.inf:
            raise SceneFileError(f"{length.where}: '{length.get('value')}' is no focal length: write 50mm")
        millimetres = float(match[1])
    return 2 * math.atan(FULL_FRAME / (2 * millimetres)), "diagonal"


def read_camera_file(
    path: Path, placed: FloatArray, changes: list[Change] | None = None
) -> list[GivenCamera]:
    """Cameras of a JSON file: a list of objects, each with `fov_degrees` (horizontal) and `origin` and `target`, or
    `matrix`.

    placed: (4, 4) from the scene file's coordinates, in which the file counts, to Z-up metres. matrix: 4 × 4 by row,
    camera to world, whose columns are left, up, forward and position, as in Mitsuba's to_world. changes: what of a
    camera is left out goes there.

    Raises SceneFileError.
    """
    try:
        # Editors of Windows write a byte order mark.
        entries = json.loads(gate.read_regular(path).decode("utf-8-sig"))
    except gate.GateError as problem:
        raise SceneFileError(f"camera file {problem}") from None
    except (ValueError, RecursionError) as problem:
        reason = "too many brackets in one another" if isinstance(problem, RecursionError) else problem
        raise SceneFileError(f"camera file {path} is no JSON: {reason}") from None
    if not isinstance(entries, list) or not entries:
        raise SceneFileError(f"camera file {path}: it is no list of cameras, or an empty one")
    cameras = []
    for number, entry in enumerate(entries):
        where = f"{path}, camera {number}"
        camera, losses = _from_json(entry, where, placed)
        cameras.append(camera)
        if changes is not None:
            changes += [Change("cameras", loss, where, loss=True) for loss in losses]
    return cameras


def _from_json(entry: Any, where: str, placed: FloatArray) -> tuple[GivenCamera, list[str]]:
    if not isinstance(entry, Mapping):
        raise SceneFileError(f'{where}: it is no object like {{"origin": …, "target": …, "fov_degrees": 60}}')
    allowed = {"origin", "target", "fov_degrees", "matrix"}
    if unknown := sorted(set(entry) - allowed):
        raise SceneFileError(f"{where}: unknown key '{unknown[0]}'; known are {', '.join(sorted(allowed))}")
    angle = math.radians(float(_array(entry.get("fov_degrees"), (), where, "fov_degrees")))
    if "matrix" in entry:
        matrix = placed @ _array(entry["matrix"], (4, 4), where, "matrix")
        return _aimed(matrix, angle, "x", where)
    origin, target = (_array(entry.get(name), (3,), where, name) for name in ("origin", "target"))
    if np.array_equal(origin, target):
        raise SceneFileError(f"{where}: origin and target are the same point")
    if not 0 < angle < math.pi:
        raise SceneFileError(f"{where}: fov_degrees must lie between 0 and 180")
    origin, target = (placed[:3, :3] @ point + placed[:3, 3] for point in (origin, target))
    return GivenCamera(_triple(origin), _triple(target), angle, "x"), []


def _array(value: Any, shape: Sequence[int], where: str, name: str) -> FloatArray:
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.full(1, np.nan)
    if array.shape != tuple(shape) or not np.isfinite(array).all():
        wanted = " × ".join(map(str, shape)) + " numbers" if shape else "a number"
        raise SceneFileError(f"{where}: {name} is missing or not {wanted}")
    return array
