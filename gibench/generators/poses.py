"""Standing things up in the room: a turn about the vertical axis, then a shift."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gibench.generators.parts import FloatArray, Mesh


def turn(points: FloatArray, yaw: float) -> FloatArray:
    """Points or vectors (..., 2 or 3) turned about Z by `yaw` radians, counter-clockwise seen from above."""
    # Quarter turns are exact, so that things against a wall stay parallel to it to the last bit.
    quarter = round(yaw / (math.pi / 2))
    if abs(yaw - quarter * math.pi / 2) < 1e-9:
        cos, sin = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarter % 4]
    else:
        cos, sin = math.cos(yaw), math.sin(yaw)
    turned = np.array(points, dtype=np.float64)
    turned[..., 0] = cos * points[..., 0] - sin * points[..., 1]
    turned[..., 1] = sin * points[..., 0] + cos * points[..., 1]
    return turned


def stand(mesh: Mesh, position: Sequence[float], yaw: float) -> Mesh:
    """The mesh turned by `yaw` about its own Z axis and moved to `position` (3,), metres; UVs stay."""
    return Mesh(
        turn(mesh.vertices, yaw) + np.asarray(position), mesh.faces, turn(mesh.normals, yaw), mesh.uvs
    )


def facing_yaw(direction: Sequence[float] | FloatArray) -> float:
    """The yaw that turns the front of a thing (its +y) towards a horizontal direction (2,) or (3,)."""
    return math.atan2(-direction[0], direction[1])
