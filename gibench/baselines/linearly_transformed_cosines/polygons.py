"""The cosine-weighted solid angle of a polygon, by its edges (Lambert 1760), clipped at a horizon without a branch.

Edges are kept with their own vectors: of a light of a millimetre the difference of two corners would be rounding.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi


@dataclass
class Edge:
    """From one corner to the next, seen from the origin, a lane each.

    start, end, along: mi.Vector3f, along = end − start. there: mi.Bool, whether it is part of the polygon.
    """

    start: Any
    end: Any
    along: Any
    there: Any

    def mapped(self, linear: Callable[[Any], Any]) -> Edge:
        """Under a linear map of mi.Vector3f."""
        return Edge(linear(self.start), linear(self.end), linear(self.along), self.there)


def outline(corners: Sequence[Any], sides: Sequence[Any]) -> list[Edge]:
    """The edges of a polygon. corners: mi.Vector3f, in order. sides: from each to the next."""
    following = [*corners[1:], corners[0]]
    return [Edge(*parts, mi.Bool(True)) for parts in zip(corners, following, sides, strict=True)]


def above_horizon(edges: Sequence[Edge]) -> list[Edge]:
    """What of a convex polygon has z > 0: its edges, cut, and one more along the horizon."""
    kept = []
    left = entered = mi.Vector3f(0)
    leaves = enters = mi.Bool(False)
    for edge in edges:
        begins, ends = edge.start.z > 0, edge.end.z > 0
        crosses = begins != ends
        share = dr.select(crosses, edge.start.z / dr.select(crosses, edge.start.z - edge.end.z, 1), 0)
        share = dr.clip(share, 0, 1)
        point = edge.start + share * edge.along
        point.z = mi.Float(0)
        length = dr.select(crosses, dr.select(begins, share, 1 - share), 1)
        kept.append(
            Edge(
                dr.select(begins, edge.start, point),
                dr.select(ends, edge.end, point),
                edge.along * length,
                edge.there & (begins | ends),
            )
        )
        leaving, entering = edge.there & begins & ~ends, edge.there & ends & ~begins
        left, leaves = dr.select(leaving, point, left), leaves | leaving
        entered, enters = dr.select(entering, point, entered), enters | entering
    kept.append(Edge(left, entered, entered - left, leaves & enters))
    return kept


def irradiance_vector(edges: Sequence[Edge]) -> Any:
    """∫ ω/π over the directions to a polygon, mi.Vector3f.

    Its component along a normal is the form factor where all of the polygon is above that surface, ≥ 0 where the
    corners run counter-clockwise as the origin sees them.
    """
    total = mi.Vector3f(0)
    for edge in edges:
        across = dr.cross(edge.along, edge.start)
        sine, cosine = dr.norm(across), dr.dot(edge.start, edge.end)
        angle = dr.atan2(sine, cosine)
        # Of a short edge sine and angle are the same; one that runs through the origin has no direction.
        scale = dr.select(sine > 0, angle / dr.select(sine > 0, sine, 1), 0)
        total += dr.select(edge.there, across * scale, 0)
    return total * dr.inv_two_pi


def form_factor(edges: Sequence[Edge]) -> Any:
    """∫ cos/π over the part of a convex polygon with z > 0, mi.Float in [0, 1]."""
    return dr.clip(irradiance_vector(above_horizon(edges)).z, 0, 1)
