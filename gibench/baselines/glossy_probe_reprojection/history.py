"""The frame before, for pixels that no probe has a sample for.

Rodriguez et al. 2020, section 5.2: their glossy light is that of the last frame, at the place where its camera saw the
point.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.rendering.replay import ray_generator

APART = 4.0
"""Sizes of a pixel by which the point that the earlier camera saw may lie aside of the one that is looked for."""


@dataclass
class PastFrame:
    """A frame that was rendered, a lane a pixel in row order.

    camera: from `replay.camera_arrays`. width, height: mi.Int32 of one lane. color: its glossy light, mi.Color3f.
    position: mi.Point3f, m. material: mi.UInt32. known: mi.Bool, whether the color is one.
    """

    camera: dict[str, Any]
    width: Any
    height: Any
    color: Any
    position: Any
    material: Any
    known: Any


def recalled(frame: PastFrame, point: Any, material: Any, active: Any) -> tuple[Any, Any]:
    """Glossy light of points in an earlier frame, mi.Color3f, and whether that frame saw them, mi.Bool.

    point: mi.Point3f, m. material: mi.UInt32, of their surfaces.
    """
    camera = ray_generator(frame.camera)
    at, depth = camera.project(point)
    active = active & (depth > 0)
    active &= (at.x >= 0) & (at.y >= 0) & (at.x < frame.width) & (at.y < frame.height)
    column, row = mi.Int32(dr.select(active, at.x, 0)), mi.Int32(dr.select(active, at.y, 0))
    lane = mi.UInt32(row * frame.width + column)
    found = active & dr.gather(mi.Bool, frame.known, lane, active)
    found &= dr.gather(mi.UInt32, frame.material, lane, active) == material
    there = dr.gather(mi.Point3f, frame.position, lane, active)
    found &= dr.norm(there - point) <= APART * depth * camera.scale
    return dr.gather(mi.Color3f, frame.color, lane, found), found
