"""Transformations of scene files as matrices."""

from __future__ import annotations

import math
import re

import numpy as np

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.tree import Node
from gibench.generators.parts import FloatArray


def numbers(node: Node, text: str, *counts: int) -> FloatArray:
    """The numbers of an attribute. Raises SceneFileError where there are not as many as one of `counts`."""
    try:
        values = np.array([float(word) for word in re.split(r"[\s,]+", text.strip()) if word])
    except ValueError:
        values = np.zeros(0)
    if len(values) not in counts or not np.isfinite(values).all():
        wanted = " or ".join(map(str, counts))
        raise SceneFileError(f"{node.where}: '{text}' is not {wanted} finite number(s)")
    return values


def triple(node: Node, default: float) -> FloatArray:
    """(3,) of an element with `value`, or with x, y and z of which those that are missing are `default`."""
    if node.get("value") is not None:
        values = numbers(node, node.get("value", ""), 1, 3)
        return np.broadcast_to(values, 3).copy()
    return np.array([numbers(node, node.get(axis, str(default)), 1)[0] for axis in "xyz"])


def matrix_of(transform: Node | None) -> FloatArray:
    """(4, 4) of a `<transform>`, whose operations apply in their order; the identity where there is none.

    Raises SceneFileError for an operation that is none.
    """
    result = np.eye(4)
    for step in transform.nodes() if transform is not None else ():
        result = _operation(step) @ result
    return result


def _operation(step: Node) -> FloatArray:
    matrix = np.eye(4)
    if step.tag == "matrix":
        values = numbers(step, step.get("value", ""), 9, 16)
        side = math.isqrt(len(values))
        matrix[:side, :side] = values.reshape(side, side)
    elif step.tag == "translate":
        matrix[:3, 3] = triple(step, 0.0)
    elif step.tag == "scale":
        matrix[:3, :3] = np.diag(triple(step, 1.0))
    elif step.tag == "rotate":
        axis = triple(step, 0.0)
        length = float(np.linalg.norm(axis))
        if length == 0:
            raise SceneFileError(f"{step.where}: <rotate> has no axis")
        matrix[:3, :3] = rotation(
            axis / length, math.radians(float(numbers(step, step.get("angle", ""), 1)[0]))
        )
    elif step.tag == "lookat":
        origin, target = (numbers(step, step.get(name, ""), 3) for name in ("origin", "target"))
        up = numbers(step, step.get("up", "0 1 0"), 3)
        matrix[:3, :3] = _looking(step, target - origin, up)
        matrix[:3, 3] = origin
    else:
        raise SceneFileError(f"{step.where}: <{step.tag}> is no transformation")
    return matrix


def rotation(axis: FloatArray, angle: float) -> FloatArray:
    """(3, 3) about a unit axis, radians (Rodrigues' formula)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)


def _looking(step: Node, towards: FloatArray, up: FloatArray) -> FloatArray:
    """Columns left, up and forward, as Mitsuba's cameras have them."""
    if not np.linalg.norm(towards) > 0 or not np.linalg.norm(np.cross(up, towards)) > 0:
        raise SceneFileError(f"{step.where}: <lookat> looks nowhere, or along its own up")
    forward = towards / np.linalg.norm(towards)
    left = np.cross(up, forward)
    left /= np.linalg.norm(left)
    return np.stack([left, np.cross(forward, left), forward], axis=1)
