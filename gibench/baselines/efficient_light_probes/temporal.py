"""Reprojection of the frames before into this one (Guo et al. 2022, section 4.4, "Temporal reprojection").

Two frames are brought to where their surfaces are now and added with falling weights. A pixel takes from them what
lies on its own material and in its tangent plane: all else was hidden then.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.rendering.replay import ray_generator

DECAY = (0.3, 0.1)
"""Weights of the frame before and of the one before that, beside 1 for the present one (section 4.4)."""

OFF_PLANE = 0.01
"""Distance from a pixel's tangent plane, over the distance from the camera, that is still the same surface."""


def reprojected(now: dict[str, Any], past: dict[str, Any], width, height) -> tuple[Any, Any]:
    """An earlier frame at the points of this one: radiance, mi.Color3f, and the share that is known.

    now, past: "position", "normal", "material" and "color", a lane a camera ray in row order, and "camera", from
    `replay.camera_arrays`. width, height: mi.Int32 of one lane. Mixed from the four nearest rays of the earlier frame;
    the share (mi.Float in [0, 1]) is the weight of those that met the same surface.
    """
    camera = ray_generator(past["camera"])
    point, normal = mi.Point3f(now["position"]), mi.Vector3f(now["normal"])
    at, depth = camera.project(point)
    ahead = (now["material"] != 0) & (depth > 0)
    ahead &= (at.x >= 0) & (at.y >= 0) & (at.x <= width) & (at.y <= height)
    at = dr.select(ahead, at - 0.5, 0)
    low = dr.floor(at)
    share = at - low
    reach = OFF_PLANE * dr.norm(point - camera.origin)
    color, total = mi.Color3f(0), mi.Float(0)
    for i, j in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = mi.Int32(low.x) + i, mi.Int32(low.y) + j
        inside = ahead & (column >= 0) & (row >= 0) & (column < width) & (row < height)
        lane = mi.UInt32(row * width + column)
        there = dr.gather(mi.Point3f, past["position"], lane, inside)
        same = inside & (dr.gather(mi.UInt32, past["material"], lane, inside) == now["material"])
        same &= dr.abs(dr.dot(there - point, normal)) <= reach
        weight = (share.x if i else 1 - share.x) * (share.y if j else 1 - share.y)
        weight = dr.select(same, weight, 0)
        color += weight * dr.gather(mi.Color3f, past["color"], lane, same)
        total += weight
    color *= dr.select(total > 0, dr.rcp(total), 0)
    dr.eval(color, total)
    return color, total


def accumulated(color: Any, past: Iterable[tuple[Any, Any]]) -> Any:
    """The weighted mean of a frame's radiance and earlier frames', mi.Color3f.

    past: what `reprojected` gives for the frame before and the one before that, as far as there are any.
    """
    total = mi.Float(1)
    mean = mi.Color3f(color)
    for (value, share), weight in zip(past, DECAY, strict=False):
        mean += weight * share * value
        total += weight * share
    mean /= total
    dr.eval(mean)
    return mean
