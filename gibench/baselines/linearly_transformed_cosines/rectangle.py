"""A rectangle of light, as a surface sees it."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from gibench.baselines.linearly_transformed_cosines.polygons import Edge, form_factor, outline
from gibench.baselines.linearly_transformed_cosines.table import Transform
from gibench.rendering.light_sampling import inverse
from gibench.rendering.lighting import AreaLight


def light_arrays(area: AreaLight) -> dict[str, Any]:
    """What kernels read of a light, an argument of a `Replay`."""
    across, up, forward = (mi.Vector3f(*map(float, axis)) for axis in area.axes)
    arrays = {
        "centre": mi.Point3f(*area.centre),
        "across": across,
        "up": up,
        "forward": forward,
        "width": mi.Float(area.width),
        "height": mi.Float(area.height),
        "radiance": mi.Color3f(*(float(np.float32(c)) for c in area.radiance)),
    }
    dr.make_opaque(arrays)
    return arrays


class Receiver:
    """Surfaces under a rectangle of light, in frames whose z is the normal on the viewer's side, x towards the viewer.

    view: mi.Vector3f, of unit length. edges: of the rectangle, from the surface. lit: whether it shines that way.
    """

    def __init__(self, si: Any, light: Mapping[str, Any]) -> None:
        """si: hits, wi towards the viewer. light: `light_arrays`."""
        self.si, self.light = si, light
        self._side = dr.mulsign(mi.Float(1), si.wi.z)
        level = dr.sqrt(dr.square(si.wi.x) + dr.square(si.wi.y))
        tilted = level > 1e-7
        self._cosine = dr.select(tilted, si.wi.x / dr.select(tilted, level, 1), 1)
        self._sine = dr.select(tilted, si.wi.y / dr.select(tilted, level, 1), 0)
        self.view = mi.Vector3f(level, 0, dr.abs(si.wi.z))
        across, up = light["across"] * light["width"], light["up"] * light["height"]
        corner = light["centre"] - 0.5 * (across + up) - si.p
        sides = [across, up, -across, -up]
        corners = [corner, corner + across, corner + across + up, corner + up]
        self.edges = outline(
            *([self.turned(mi.Vector3f(v)) for v in vectors] for vectors in (corners, sides))
        )
        self.lit = dr.dot(si.p - light["centre"], light["forward"]) > 0

    def turned(self, vector: Any) -> Any:
        """A mi.Vector3f of the world in this frame."""
        local = self.si.to_local(vector)
        c, s, side = self._cosine, self._sine, self._side
        # From behind y turns with z: a frame that is mirrored would run around the light the other way.
        return mi.Vector3f(c * local.x + s * local.y, (c * local.y - s * local.x) * side, local.z * side)

    def for_bsdf(self, vector: Any) -> Any:
        """A mi.Vector3f of this frame as a BSDF takes it."""
        c, s, side = self._cosine, self._sine, self._side
        y = vector.y * side
        return mi.Vector3f(c * vector.x - s * y, s * vector.x + c * y, vector.z * side)

    def form_factor(self, above: list[Edge], transform: Transform | None = None) -> Any:
        """For a cosine or a transformed one, mi.Float in [0, 1]. above: edges of the rectangle over the surface."""
        edges = above if transform is None else [edge.mapped(transform.inverse) for edge in above]
        return dr.select(self.lit, form_factor(edges), 0)

    def drawn(self, u: Any) -> tuple[Any, Any]:
        """A point of the rectangle, mi.Point3f, for mi.Point2f u in [0, 1)², and its direction in this frame."""
        light = self.light
        point = light["centre"] + (u.x - 0.5) * light["width"] * light["across"]
        point = point + (u.y - 0.5) * light["height"] * light["up"]
        return point, self.turned(dr.normalize(mi.Vector3f(point - self.si.p)))

    def met(self, direction: Any) -> tuple[Any, Any]:
        """Where a direction of the world meets the rectangle's plane, and whether on its bright side within it."""
        light = self.light
        towards = -dr.dot(direction, light["forward"])
        distance = dr.dot(self.si.p - light["centre"], light["forward"]) * inverse(towards)
        point = self.si.p + distance * direction
        beside = mi.Vector3f(point - light["centre"])
        within = dr.abs(dr.dot(beside, light["across"])) <= 0.5 * light["width"]
        within &= dr.abs(dr.dot(beside, light["up"])) <= 0.5 * light["height"]
        return point, within & (towards > 0) & self.lit

    def density(self, point: Any) -> Any:
        """Of `drawn`, per steradian, at a point of the rectangle."""
        towards = mi.Vector3f(point - self.si.p)
        squared = dr.squared_norm(towards)
        cosine = -dr.dot(towards, self.light["forward"]) * inverse(dr.sqrt(squared))
        area = self.light["width"] * self.light["height"]
        return dr.select(cosine > 0, squared * inverse(cosine * area), 0)


def cosine_density(transform: Transform, direction: Any) -> Any:
    """Of a transformed cosine, mi.Float, sr⁻¹; 0 below the surface. direction: mi.Vector3f in a receiver's frame."""
    back = transform.inverse(direction)
    value = dr.maximum(back.z, 0) * dr.inv_pi
    value *= inverse(transform.m11 * transform.m22 * dr.square(dr.squared_norm(back)))
    return dr.select(direction.z > 0, value, 0)
