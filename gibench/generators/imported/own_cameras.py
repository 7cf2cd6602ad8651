"""Cameras that a scene brings along, and those of a camera file."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gibench import gate
from gibench.generators.imported.changes import Change
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.films import film_of
from gibench.generators.imported.transforms import matrix_of, numbers
from gibench.generators.imported.tree import Node
from gibench.generators.parts import Camera, FloatArray
from gibench.rendering.camera import CameraError, PinholeCamera

NEGLIGIBLE_ROLL = 1e-4
"""Radians: a tenth of a pixel at the border of a wide image. A camera that is rolled by less has Z up."""

FARTHEST_OFFSET = 100.0
"""Of a principal point, in films."""

ORTHOGONAL = 1e-3
"""Largest relative deviation of a camera's matrix from a rotation; as Mitsuba allows."""

FULL_FRAME = math.hypot(36.0, 24.0)
"""Diagonal of the film that focal lengths are given for, mm."""

DEFAULT_FOCAL_LENGTH = 50.0
"""Mitsuba's, mm."""


@dataclass(frozen=True)
class GivenCamera:
    """A pinhole camera whose field of view may depend on the shape of the image.

    position, target: metres, Z up. angle: field of view, radians. axis: what it spans: "x", "y", "diagonal", "smaller"
    or "larger", of the whole film. up, mirrored: as those of a `PinholeCamera`. principal_point: where the optical axis
    meets the film, from its middle to the right and down, as shares of its width and height. window: what of the film
    is the image: its left, its top, its width and its height, as shares of the film's. near: what is closer along the
    optical axis is cut away by Mitsuba, and seen here; metres. where: its place in the scene file.
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    angle: float
    axis: str
    up: tuple[float, float, float] | None = None
    mirrored: bool = False
    principal_point: tuple[float, float] = (0.0, 0.0)
    window: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    near: float = 0.0
    where: str = ""

    def at(self, resolution: tuple[int, int]) -> Camera:
        """The camera for images of this (width, height), as Mitsuba would fit it.

        The image is the window of the film, so that the film is as much larger.
        """
        left, top, share, share_down = self.window
        width, height = resolution[0] / share, resolution[1] / share_down
        axis = self.axis
        if axis in ("smaller", "larger"):
            axis = "x" if (width < height) == (axis == "smaller") else "y"
        extent = {"x": width, "y": height, "diagonal": math.hypot(width, height)}[axis]
        fov = 2 * math.atan(math.tan(self.angle / 2) * width / extent * share)
        x, y = self.principal_point
        point = (x + (0.5 - (left + share / 2))) / share, (y + (0.5 - (top + share_down / 2))) / share_down
        return Camera(
            self.position,
            self.target,
            fov,
            up=self.up,
            principal_point=point,
            mirrored=self.mirrored,
        )


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
        matrix = matrix_of(sensor.property("to_world"))
        angle, axis = _field_of_view(sensor)
        camera = _aimed(matrix, angle, axis, sensor.where)
        if _uneven(matrix):
            note(sensor, "a camera's shear or uneven scale is left out", True)
        near = sensor.property("near_clip")
        # What lies along the optical axis before this is cut away; the scene's scale is in the matrix.
        size = float(np.linalg.norm(matrix[:3, 2]))
        clip = 0.0 if near is None else size * float(numbers(near, near.get("value", ""), 1)[0])
        # Mitsuba counts from the principal point to the middle of the film.
        point = -_offset(sensor, "x"), -_offset(sensor, "y")
        cameras.append(
            replace(camera, principal_point=point, window=_window(sensor), near=clip, where=sensor.where)
        )
    return cameras


def _offset(sensor: Node, axis: str) -> float:
    offset = sensor.property(f"principal_point_offset_{axis}")
    if offset is None:
        return 0.0
    value = float(numbers(offset, offset.get("value", ""), 1)[0])
    if abs(value) > FARTHEST_OFFSET:
        raise SceneFileError(
            f"{offset.where}: an offset of {value:g} films is none: write a share of the film"
        )
    return value


def _window(sensor: Node) -> tuple[float, float, float, float]:
    film = film_of(sensor)
    (width, height), (x, y), (across, down) = film.size, film.corner, film.window
    return x / width, y / height, across / width, down / height


def _aimed(matrix: FloatArray, angle: float, axis: str, where: str) -> GivenCamera:
    """A camera from its matrix, columns left, up, forward and position, of any length."""
    if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix[:3, :3])) < 1e-12:
        raise SceneFileError(f"{where}: the camera's transformation is singular")
    if not 0 < angle < math.pi:
        raise SceneFileError(f"{where}: a field of view of {math.degrees(angle):g} degrees is none")
    forward = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    position = matrix[:3, 3]
    up = _triple(matrix[:3, 1] / np.linalg.norm(matrix[:3, 1]))
    camera = GivenCamera(
        _triple(position),
        _triple(position + 2 * forward),
        angle,
        axis,
        mirrored=bool(np.linalg.det(matrix[:3, :3]) < 0),
    )
    return replace(camera, up=up) if abs(_roll(camera, up)) > NEGLIGIBLE_ROLL else camera


def _uneven(matrix: FloatArray) -> bool:
    """Whether the axes of a camera's matrix are of several lengths or not at right angles to each other."""
    size = np.linalg.norm(matrix[:3, 2])
    return bool(np.abs(matrix[:3, :3].T @ matrix[:3, :3] / size**2 - np.eye(3)).max() > ORTHOGONAL)


def _roll(camera: GivenCamera, up: tuple[float, float, float]) -> float:
    """Radians from the top of the image of a camera with Z up to `up`, counter-clockwise in the image."""
    right, down, _ = PinholeCamera(camera.position, camera.target, 1.0).frame
    return math.atan2(float(-np.dot(right, up)), float(-np.dot(down, up)))


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
    """Cameras of a JSON file: a list of objects, each with `fov_degrees` (horizontal), and `origin` and `target`, or
    `matrix`. `up` may stand beside `target`, and `principal_point` beside either, as those of a `PinholeCamera`.

    placed: (4, 4) from the scene file's coordinates, in which the file counts, to Z-up metres. matrix: 4 × 4 by row,
    camera to world, whose columns are left, up, forward and position, as in Mitsuba's to_world. changes: matrices that
    roll or mirror the image go there, as those of other conventions do.

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
        camera = _from_json(entry, where, placed)
        cameras.append(camera)
        if changes is not None and "matrix" in entry:
            matrix = placed @ np.array(entry["matrix"], dtype=np.float64)
            changes += [Change("cameras", what, where, loss=True) for what in _unusual(camera, matrix)]
    return cameras


CONVENTION = "are the columns of its matrix left, up, forward and position?"


def _unusual(camera: GivenCamera, matrix: FloatArray) -> Iterator[str]:
    """Description of a matrix that follows another convention."""
    if camera.mirrored:
        yield f"a mirrored camera is rendered as it is: {CONVENTION}"
    if camera.up is not None:
        roll = math.degrees(_roll(camera, camera.up))
        yield f"a camera's roll of {roll:.1f} degrees is rendered as it is: {CONVENTION}"
    if _uneven(matrix):
        yield f"a camera's shear or uneven scale is left out: {CONVENTION}"


def _from_json(entry: Any, where: str, placed: FloatArray) -> GivenCamera:
    if not isinstance(entry, Mapping):
        raise SceneFileError(f'{where}: it is no object like {{"origin": …, "target": …, "fov_degrees": 60}}')
    allowed = {"origin", "target", "up", "fov_degrees", "matrix", "principal_point"}
    if unknown := sorted(set(entry) - allowed):
        raise SceneFileError(f"{where}: unknown key '{unknown[0]}'; known are {', '.join(sorted(allowed))}")
    angle = math.radians(float(_array(entry.get("fov_degrees"), (), where, "fov_degrees")))
    x, y = _array(entry.get("principal_point", (0, 0)), (2,), where, "principal_point")
    point = float(x), float(y)
    if max(map(abs, point)) > FARTHEST_OFFSET:
        raise SceneFileError(f"{where}: a principal_point of {x:g}, {y:g} is none: write shares of the image")
    if "matrix" in entry:
        if other := sorted({"origin", "target", "up"} & set(entry)):
            raise SceneFileError(f"{where}: '{other[0]}' beside 'matrix': leave one of them out")
        matrix = placed @ _array(entry["matrix"], (4, 4), where, "matrix")
        return replace(_aimed(matrix, angle, "x", where), principal_point=point)
    origin, target = (_array(entry.get(name), (3,), where, name) for name in ("origin", "target"))
    if np.array_equal(origin, target):
        raise SceneFileError(f"{where}: origin and target are the same point")
    if not 0 < angle < math.pi:
        raise SceneFileError(f"{where}: fov_degrees must lie between 0 and 180")
    origin, target = (placed[:3, :3] @ point + placed[:3, 3] for point in (origin, target))
    camera = GivenCamera(_triple(origin), _triple(target), angle, "x", principal_point=point)
    if "up" not in entry:
        return camera
    up = _triple(placed[:3, :3] @ _array(entry["up"], (3,), where, "up"))
    try:
        PinholeCamera(camera.position, camera.target, angle, up)
    except CameraError:
        raise SceneFileError(f"{where}: up is along the view, or 0: give another direction") from None
    return replace(camera, up=up) if abs(_roll(camera, up)) > NEGLIGIBLE_ROLL else camera


def _array(value: Any, shape: Sequence[int], where: str, name: str) -> FloatArray:
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.full(1, np.nan)
    if array.shape != tuple(shape) or not np.isfinite(array).all():
        wanted = " × ".join(map(str, shape)) + " numbers" if shape else "a number"
        raise SceneFileError(f"{where}: {name} is missing or not {wanted}")
    return array
