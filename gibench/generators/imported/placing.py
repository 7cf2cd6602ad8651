"""From the axes and the units of a scene file to gibench's: Z up, metres.

The numbers in the file stay as they are. One more operation at the end of every transformation does the work, and is
recorded, so that what was done can be undone exactly.
"""

from __future__ import annotations

import math

import numpy as np

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.transforms import matrix_of, numbers, triple
from gibench.generators.imported.tree import Node, new
from gibench.generators.parts import FloatArray

AXES = ("x", "y", "z")

UPRIGHT: dict[str, FloatArray] = {
    "x": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
}
"""Rotations of the axis that is up into +z, by its name: permutations, so that no number is rounded."""

DIRECTIONAL = ("envmap", "constant", "directional", "sunsky", "timed_sunsky")
"""Emitters without a place: they turn, but do not grow."""

INTENSITIES = ("point", "spot")
"""Emitters in W/sr: what they send through a metre is less than through a smaller unit."""


def up_axis(root: Node, asked: str = "auto") -> str:
    """The axis that is up: what the user says, or else the one that is nearest to the first camera's up; y without one.

    Raises SceneFileError for a name that is no axis.
    """
    if asked in AXES:
        return asked
    if asked != "auto":
        raise SceneFileError(f"--up: '{asked}' is not allowed; allowed are auto, x, y and z")
    for sensor in root.nodes("sensor"):
        up = _camera_up(sensor.property("to_world"))
        return AXES[int(np.argmax(np.abs(up)))]
    return "y"


def _camera_up(transform: Node | None) -> FloatArray:
    steps = transform.nodes() if transform is not None else []
    if len(steps) == 1 and steps[0].tag == "lookat" and steps[0].get("up"):
        # What its author meant, even where the camera looks steeply down.
        return numbers(steps[0], steps[0].get("up", ""), 3)
    return matrix_of(transform)[:3, 1]


def placed_matrix(up: str, scale: float) -> FloatArray:
    """(4, 4) from a scene file's coordinates to Z-up metres. Raises SceneFileError for a scale that is none."""
    if not (math.isfinite(scale) and scale > 0):
        raise SceneFileError(f"--scale: {scale:g} is not allowed; allowed is a number above 0")
    matrix = np.eye(4)
    matrix[:3, :3] = scale * UPRIGHT[up]
    return matrix


def place(root: Node, up: str, scale: float) -> None:
    """Turn and scale everything in a scene, in place: shapes, lights and cameras.

    A light that is given in W/sr becomes brighter by scale², so that surfaces receive what they received.
    """
    matrix, turn = placed_matrix(up, scale), placed_matrix(up, 1.0)
    if np.array_equal(matrix, np.eye(4)):
        return
    for node in root.nodes("shape"):
        # The shapes of a group are placed by its instances.
        if node.type == "shapegroup":
            continue
        _append(node, matrix)
    for node in root.nodes("emitter"):
        _place_light(node, matrix, turn, scale)
    for node in root.nodes("sensor"):
        _append(node, matrix)


def _place_light(node: Node, matrix: FloatArray, turn: FloatArray, scale: float) -> None:
    for name, by in (("direction", turn), ("sun_direction", turn), ("position", matrix)):
        vector = node.property(name)
        if vector is not None:
            moved = by[:3, :3] @ triple(vector, 0.0) + by[:3, 3]
            vector.attrib = {"name": name, **dict(zip("xyz", map(repr, moved.tolist()), strict=True))}
    if node.type == "constant":
        return
    placed_by_vector = node.property("direction", "position") is not None
    if node.property("to_world") is not None or not placed_by_vector:
        _append(node, turn if node.type in DIRECTIONAL else matrix)
    if node.type == "projector" and scale != 1:
        own = node.property("scale")
        before = 1.0 if own is None else float(numbers(own, own.get("value", ""), 1)[0])
        if own is not None:
            node.remove(own)
        # Mitsuba divides by one distance in the projector's own units and by one in the world's.
        node.append(new("float", node, name="scale", value=repr(before * scale)))
    intensity = node.property("intensity")
    if node.type in INTENSITIES and scale != 1:
        if intensity is None:
            node.append(new("rgb", node, name="intensity", value=repr(scale**2)))
        elif intensity.tag in ("rgb", "float"):
            values = numbers(intensity, intensity.get("value", ""), 1, 3) * scale**2
            intensity.set("value", " ".join(map(repr, values.tolist())))
        else:
            raise SceneFileError(
                f"{intensity.where}: the intensity of a {node.type} light is a <{intensity.tag}>, which cannot be "
                "scaled: make it an <rgb>, or leave --scale at 1"
            )


def _append(node: Node, matrix: FloatArray) -> None:
    transform = node.property("to_world")
    if transform is None:
        transform = new("transform", node, name="to_world")
        node.append(transform)
    transform.append(new("matrix", node, value=" ".join(f"{v:.17g}" for v in matrix.ravel())))
