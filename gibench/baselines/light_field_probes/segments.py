"""Rays as seen from a probe, on its octahedral map.

Between the planes through a probe along which signs change, a line is mapped to a straight one: column and row are each
a ratio of two linear functions of the way along the ray. So the way at which a ray crosses the edge of a texel is known
in closed form, and no direction needs to be turned into a place, or back, on the way.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi


def octant_planes(origin: Any, direction: Any) -> list[Any]:
    """Ways along a ray (mi.Float, in no order) at which a component of `origin + way · direction` changes sign.

    origin: mi.Vector3f from the probe. Infinite where that is never.
    """
    return [dr.select(d == 0, dr.inf, -o / d) for o, d in zip(origin, direction, strict=True)]


def segment_end(planes: list[Any], way: Any, last: Any) -> Any:
    """End of the segment that begins at `way`: at the next plane, or at `last`."""
    end = last
    for plane in planes:
        end = dr.select((plane > way) & (plane < end), plane, end)
    return end


@dataclass
class Segment:
    """A part of a ray within one octant around a probe.

    column, row, norm: (constant, slope) of functions of the way along the ray; place is column or row over norm, in
    texels. A norm is the distance from the probe as the octahedron measures it: the sum of the three components.
    """

    column: tuple[Any, Any]
    row: tuple[Any, Any]
    norm: tuple[Any, Any]

    def column_at(self, way: Any) -> Any:
        """Place across the map (mi.Float, texels)."""
        return self._at(self.column, way)

    def row_at(self, way: Any) -> Any:
        """Place down the map (mi.Float, texels)."""
        return self._at(self.row, way)

    def _at(self, place, way):
        norm = dr.fma(self.norm[1], way, self.norm[0])
        return dr.fma(place[1], way, place[0]) / dr.select(norm > 0, norm, 1)

    def forward(self, place: Any) -> Any:
        """Whether a place (`column` or `row`) grows along the ray; it does so all the way, or shrinks."""
        return place[1] * self.norm[0] > place[0] * self.norm[1]

    def crossing(self, place: Any, edge: Any) -> Any:
        """The way at which `column` or `row` is `edge` (mi.Float): mi.Float, anything where it never is."""
        return dr.fma(edge, self.norm[0], -place[0]) / dr.fma(-edge, self.norm[1], place[1])


def segment_of(origin: Any, direction: Any, middle: Any, side: Any) -> Segment:
    """The segment of a ray around the way `middle`, on a map of `side` (mi.Float) texels squared."""
    at = origin + middle * direction
    sx, sy, sz = (dr.select(component >= 0, mi.Float(1), mi.Float(-1)) for component in at)
    x, y, z = ((o, d) for o, d in zip(origin, direction, strict=True))
    over = sz > 0

    def linear(k: int):
        norm = sx * x[k] + sy * y[k] + sz * z[k]
        # Below, the triangles are folded outwards: what is left of the norm without the other axis.
        across = dr.select(over, x[k], sx * (norm - sy * y[k]))
        down = dr.select(over, y[k], sy * (norm - sx * x[k]))
        return 0.5 * side * (across + norm), 0.5 * side * (down + norm), norm

    constant, slope = linear(0), linear(1)
    return Segment(*zip(constant, slope, strict=True))
