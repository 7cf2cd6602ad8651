"""Rays marched through the distances that probes hold (McGuire et al. 2017; constants from their published shader).

A probe knows the surface that it sees in each texel's direction, and nothing of what lies behind. A ray is followed
over the map from texel to texel. Where it stays before the surface it goes on; where it meets it there is a hit; where
it passes behind, the probe cannot say what it meets, and the next probe is asked from there on. Texels of a map of
least distances, sixteen times as coarse, are skipped whole where the ray passes before all that they hold.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.baselines.light_field_probes.cells import CORNERS, Cells
from gibench.baselines.light_field_probes.segments import octant_planes, segment_end, segment_of
from gibench.baselines.probes.baking import POSITIONS
from gibench.baselines.probes.maps import Probes

COARSE = 16
"""Texels along the side of a coarse texel: maps of 1024² with one of 64²."""

LEAST_THICKNESS, MOST_THICKNESS = 0.03, 0.5
"""Metres that surfaces are taken to be thick."""

THICKENING = 0.1
"""Of the thickness a metre along the ray, a share of the most."""

LEAST_SHARE = 0.05
"""Of that share."""

BUMP = 1e-3
"""Metres from the surface that a ray begins at, and from the planes between octants at which places are looked up."""

FAR = 1e4
"""Metres that are followed."""

CYCLE = 3
"""Corners of a cell from one probe to the next; with 8 corners every one has its turn."""

MISS, HIT, UNKNOWN = 0, 1, 2
"""Verdicts of a probe about a ray: nothing is in its way, it is stopped, or it passes behind something."""


def thickness(direction: Any, towards: Any, normal: Any, way: Any, metre: Any) -> Any:
    """Assumed thickness of a surface, mi.Float in the scene's unit.

    direction: of the ray. towards: unit mi.Vector3f from the probe. normal: of the surface. way: along the ray to it.
    metre: in the scene's unit. Behind what the probe sees along the ray, and what is seen edge-on, more is hidden.
    """
    along = dr.maximum(dr.dot(direction, towards), 0)
    edge_on = 2 - dr.abs(dr.dot(direction, normal))
    share = dr.clip(THICKENING * way / metre, LEAST_SHARE, 1)
    return metre * (LEAST_THICKNESS + (MOST_THICKNESS - LEAST_THICKNESS) * along * edge_on * share)


def least_distances(distances: NDArray[np.float32]) -> NDArray[np.float32]:
    """The least of each block of COARSE × COARSE texels. distances: (N, side, side), side a multiple of COARSE."""
    count, side, _ = distances.shape
    blocks = distances.reshape(count, side // COARSE, COARSE, side // COARSE, COARSE)
    least: NDArray[np.float32] = blocks.min(axis=(2, 4))
    return least


class LightField:
    """Probes that rays can be marched through. arrays: what a `Replay` must hold."""

    def __init__(self, probes: Probes) -> None:
        """probes: on octahedral maps with "distance" and "normal", their sides multiples of COARSE."""
        side = probes.mapping.width
        self.probes = probes
        self.cells = Cells(np.array(probes.arrays[POSITIONS]).reshape(-1, 3))
        distances = np.array(probes.arrays["distance"]).reshape(-1, side, side)
        distances = np.where(distances > 0, distances, np.inf).astype(np.float32)
        self._fine = mi.Float(distances.ravel())
        self._coarse = mi.Float(least_distances(distances).ravel())
        self._side, self._coarse_side = mi.UInt32(side), mi.UInt32(side // COARSE)
        own = {
            "fine": self._fine,
            "coarse": self._coarse,
            "side": self._side,
            "coarse side": self._coarse_side,
        }
        dr.make_opaque(own)
        self.arrays = own | self.cells.arrays | probes.arrays

    @dr.syntax
    def march(self, probe: Any, point: Any, direction: Any, way: Any, metre: Any, active: Any, coarse: Any):
        """Follow rays through what one probe sees.

        probe: mi.UInt32. point, direction: mi.Point3f, unit mi.Vector3f, of the ray. way: mi.Float at which to begin.
        metre: in the scene's unit. coarse: mi.Bool, whether coarse texels are skipped. Returns MISS, HIT or UNKNOWN
        (mi.UInt32), the way to the hit or up to which the ray is free, and how many texels were looked at.
        """
        origin, coarse = mi.Vector3f(point - self.probes.position(probe)), mi.Bool(coarse)
        planes = octant_planes(origin, direction)
        last = FAR * metre
        bump = BUMP * metre
        side, coarse_side = mi.Float(self._side), self._coarse_side
        top = mi.Int32(self._side) - 1
        base = probe * self._side * self._side
        coarse_base = probe * coarse_side * coarse_side

        way = mi.Float(way)
        outcome = mi.UInt32(MISS)
        column, row = mi.Int32(0), mi.Int32(0)
        entering = mi.Bool(True)
        close = ~coarse
        previous = mi.Float(way)
        looked = mi.UInt32(0)
        marching = active & (way < last)

        while marching:
            end = segment_end(planes, way, last)
            segment = segment_of(origin, direction, 0.5 * (way + end), side)
            # At the planes themselves places are undefined, or on the other side of the map.
            begin = dr.minimum(way + bump, 0.5 * (way + end))
            column = dr.select(entering, mi.Int32(segment.column_at(begin)), column)
            row = dr.select(entering, mi.Int32(segment.row_at(begin)), row)
            column, row = dr.clip(column, 0, top), dr.clip(row, 0, top)

            # The texel, fine or coarse, and where the ray leaves it.
            size = dr.select(close, mi.Int32(1), mi.Int32(COARSE))
            left = dr.select(close, column, column // COARSE * COARSE)
            upper = dr.select(close, row, row // COARSE * COARSE)
            right, down = segment.forward(segment.column), segment.forward(segment.row)
            finish = dr.maximum(end - bump, 0.5 * (way + end))
            next_column = dr.select(right, left + size, left)
            next_row = dr.select(down, upper + size, upper)
            final = segment.column_at(finish)
            crosses = dr.select(right, final > next_column, final < next_column)
            aside = dr.select(crosses, segment.crossing(segment.column, mi.Float(next_column)), dr.inf)
            final = segment.row_at(finish)
            crosses = dr.select(down, final > next_row, final < next_row)
            below = dr.select(crosses, segment.crossing(segment.row, mi.Float(next_row)), dr.inf)
            leave = dr.clip(dr.minimum(aside, below), way, end)

            index = dr.select(
                close,
                base + mi.UInt32(row) * self._side + mi.UInt32(column),
                coarse_base + mi.UInt32(row // COARSE) * coarse_side + mi.UInt32(column // COARSE),
            )
            surface = dr.select(
                close,
                dr.gather(mi.Float, self._fine, index, marching & close),
                dr.gather(mi.Float, self._coarse, index, marching & ~close),
            )
            near = dr.norm(origin + way * direction)
            far = dr.norm(origin + leave * direction)
            blocked = (dr.maximum(near, far) >= surface) & dr.isfinite(surface)
            looked += 1

            if marching & blocked & close:
                normal = mi.Vector3f(self.probes.fetch("normal", index))
                towards = self.probes.mapping.direction(mi.Point2f(mi.Float(column), mi.Float(row)) + 0.5)
                seen = surface * towards
                # Within the texel the surface is the plane through what was seen at its centre.
                fall = dr.dot(normal, direction)
                height = dr.dot(normal, origin + way * direction - seen)
                height_after = dr.fma(fall, leave - way, height)
                before = (height > -LEAST_THICKNESS * metre) & (height_after > 0)
                here = dr.dot(seen - origin, direction)
                crossed = dr.select(fall < 0, way - height / fall, here)
                # Behind it already where the ray comes in: it went through in the texel before, which sees another.
                here = dr.clip(crossed, previous, leave)
                thick = thickness(direction, towards, normal, here, metre)
                # What is behind the surface from its origin on never meets it.
                hit = ~before & (fall < 0) & (crossed >= 0) & (dr.minimum(near, far) < surface + thick)
                blocked = ~before
                outcome = dr.select(before, MISS, dr.select(hit, mi.UInt32(HIT), mi.UInt32(UNKNOWN)))
                way = dr.select(hit, here, dr.select(before, way, previous))

            marching &= outcome == MISS
            # What blocks coarsely is looked at closely from here on.
            advance = marching & (~blocked | close)
            closer = marching & blocked & ~close
            out_aside = aside <= below
            over = leave >= end
            fine_column = dr.clip(mi.Int32(segment.column_at(leave)), left, left + size - 1)
            fine_row = dr.clip(mi.Int32(segment.row_at(leave)), upper, upper + size - 1)
            new_column = dr.select(out_aside, dr.select(right, next_column, left - 1), fine_column)
            new_row = dr.select(out_aside, fine_row, dr.select(down, next_row, upper - 1))
            outside = (new_column < 0) | (new_column > top) | (new_row < 0) | (new_row > top)
            elsewhere = (new_column // COARSE != column // COARSE) | (new_row // COARSE != row // COARSE)
            over |= outside
            close = dr.select(advance, ~coarse | (close & ~over & ~elsewhere), close | closer)
            previous = dr.select(advance, way, previous)
            way = dr.select(advance, dr.select(over, end, leave), way)
            column, row = dr.select(advance, new_column, column), dr.select(advance, new_row, row)
            entering = dr.select(advance, over, mi.Bool(False))
            marching &= way < last

        return outcome, way, looked

    @dr.syntax
    def trace(self, point: Any, direction: Any, metre: Any, active: Any, coarse: Any = True):
        """Follow rays (mi.Point3f, unit mi.Vector3f) to what they hit, through the probes around their origin.

        Returns the outcome, the probe (mi.UInt32) whose texel it is, the way, and how many texels were looked at. It
        is UNKNOWN where each probe says so; the probe is then the one nearest to the origin.
        """
        first = self.cells.first(point)
        corner, nearest = mi.UInt32(0), mi.Float(dr.inf)
        for k in range(CORNERS):
            probe = self.cells.probe(first, mi.UInt32(k))
            distance = dr.squared_norm(self.probes.position(probe) - point)
            closer = distance < nearest
            nearest, corner = dr.select(closer, distance, nearest), dr.select(closer, mi.UInt32(k), corner)
        own = self.cells.probe(first, corner)

        probe, outcome = mi.UInt32(own), mi.UInt32(UNKNOWN)
        way = mi.Float(BUMP * metre)
        looked, asked = mi.UInt32(0), mi.UInt32(0)
        while active & (outcome == UNKNOWN) & (asked < CORNERS):
            probe = self.cells.probe(first, corner)
            outcome, way, effort = self.march(probe, point, direction, way, metre, True, coarse)
            corner = (corner + CYCLE) & (CORNERS - 1)
            looked += effort
            asked += 1

        probe = dr.select(outcome == UNKNOWN, own, probe)
        return outcome, probe, way, looked
