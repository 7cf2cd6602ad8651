"""Windows as portals: light from the environment is sampled through the openings that it comes in by.

Inside a room most directions to the sky end on a wall, so sampling the environment by its brightness wastes most
shadow rays. A share of the light samples goes to a point on a portal instead (in the spirit of Bitterli, Novák and
Jarosz 2015, "Portal-masked environment map sampling"; here by area, which suits openings that are far away). The other
samples still go where the environment is bright, such as the sun, and both are weighted by their joint density, so that
the estimate is unbiased whatever the portals are, even where they leave an opening out.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

PORTAL_FRACTION = 0.5
"""Of the light samples that go through portals where nothing is learned. The environment has half of the rest."""

_COLUMNS = 19


class Portals:
    """Rectangles that light enters by, on the device; no number of theirs is part of a kernel."""

    def __init__(self, scene: Any, rectangles: NDArray[Any]) -> None:
        """scene: mitsuba.Scene. rectangles: (N, 3, 3): corner and two edges, whose cross product points inside.

        Without a rectangle or an environment all samples go where they would go without portals.
        """
        rectangles = np.asarray(rectangles, dtype=np.float64).reshape(-1, 3, 3)
        environment = scene.environment()
        if environment is None:
            rectangles = rectangles[:0]
        corner, u, v = rectangles[:, 0], rectangles[:, 1], rectangles[:, 2]
        normal = np.cross(u, v)
        areas = np.linalg.norm(normal, axis=1)
        total = float(areas.sum())
        self._count = mi.UInt32(len(rectangles))
        self.lead_outside = len(rectangles) > 0
        self.open(True)
        self._inverse_area = mi.Float(1 / total if total > 0 else 0.0)
        self.environment = mi.EmitterPtr(environment)
        dr.make_opaque(self._count, self._inverse_area, self.environment)
        # One row a portal: corner, edges, normal, edges over their squared lengths, share of the area up to its end.
        ends = np.cumsum(areas) / max(total, 1e-30)
        rows = [
            corner,
            u,
            v,
            normal / np.maximum(areas, 1e-30)[:, None],
            u / np.maximum((u * u).sum(1), 1e-30)[:, None],
            v / np.maximum((v * v).sum(1), 1e-30)[:, None],
            ends[:, None],
        ]
        table = np.concatenate(rows, axis=1) if len(rectangles) else np.zeros((1, _COLUMNS))
        self._table = mi.Float(table.astype(np.float32).ravel())
        dr.make_opaque(self._table)

    def open(self, bright: bool) -> None:
        """Sample through the portals where the environment is bright, and not where it is dark."""
        self.send(PORTAL_FRACTION if bright and self.lead_outside else 0.0)

    def send(self, fraction: float) -> None:
        """Let this share of the light samples go through the portals, in [0, 1)."""
        self.fraction = mi.Float(fraction)
        dr.make_opaque(self.fraction)

    @property
    def arrays(self) -> dict[str, Any]:
        """What kernels read; see `replay.HoldsArrays`."""
        return {
            "count": self._count,
            "inverse_area": self._inverse_area,
            "environment": self.environment,
            "table": self._table,
            "fraction": self.fraction,
        }

    def _row(self, portal, column):
        offset = portal * _COLUMNS + column
        return mi.Vector3f(*(dr.gather(mi.Float, self._table, offset + i) for i in range(3)))

    def _end(self, portal):
        return dr.gather(mi.Float, self._table, portal * _COLUMNS + _COLUMNS - 1)

    @dr.syntax
    def _chosen(self, u):
        """A portal, in proportion to its area, and a number in [0, 1] that is left of u in [0, 1)."""
        portal, before, after = mi.UInt32(0), mi.Float(0), self._end(mi.UInt32(0))
        while (u >= after) & (portal + 1 < self._count):
            portal += 1
            before = mi.Float(after)
            after = self._end(portal)
        return portal, dr.clip((u - before) / dr.maximum(after - before, 1e-20), 0, 1)

    def _entry(self, u):
        """A portal and a point on it."""
        portal, along = self._chosen(u.x)
        return portal, self._row(portal, 0) + along * self._row(portal, 3) + u.y * self._row(portal, 6)

    def sample(self, point, u):
        """Directions from points through the portals: unit mi.Vector3f, zero where the point lies behind its portal.

        u: mi.Point2f in [0, 1)², of which the first also chooses the portal.
        """
        portal, target = self._entry(u)
        direction = dr.normalize(target - point)
        in_front = dr.dot(direction, self._row(portal, 9)) < 0
        return dr.select(in_front & dr.all(dr.isfinite(direction)), direction, 0)

    def entrance(self, u):
        """Normals of the portals, which point inside, and points on them. u: as for `sample`."""
        portal, target = self._entry(u)
        return self._row(portal, 9), target

    @dr.syntax
    def density(self, point, direction):
        """Density of `sample` for a direction from a point, per steradian."""
        portal, total = mi.UInt32(0), mi.Float(0)
        while portal < self._count:
            normal = self._row(portal, 9)
            cosine = -dr.dot(direction, normal)
            offset = self._row(portal, 0) - point
            distance = -dr.dot(offset, normal) / dr.select(cosine > 1e-7, cosine, mi.Float(1))
            hit = distance * direction - offset
            a, b = dr.dot(hit, self._row(portal, 12)), dr.dot(hit, self._row(portal, 15))
            inside = (cosine > 1e-7) & (distance > 0) & (a >= 0) & (a <= 1) & (b >= 0) & (b <= 1)
            total += dr.select(inside, dr.square(distance) / dr.maximum(cosine, 1e-7), 0)
            portal += 1
        return total * self._inverse_area

    def environment_from(self, direction, active):
        """The environment in a direction: its radiance, mi.Color3f, and the point itself as a mi.DirectionSample3f."""
        sky = dr.zeros(mi.SurfaceInteraction3f)
        sky.wi = -direction
        outside = dr.zeros(mi.DirectionSample3f)
        outside.d = direction
        outside.emitter = self.environment
        return self.environment.eval(sky, active), outside
