"""Putting furniture into a shell: what stands where, and what still fits.

`FloorPlan` keeps the books: solid boxes, zones that must stay free, rugs that lift what stands on them. The relations
("against a wall", "around a table") are in `relations`; they propose poses and ask the plan.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely

from gibench.errors import GibenchError
from gibench.generators.furniture import sample_furniture
from gibench.generators.layouts.solids import (
    bounds_of,
    component_boxes,
    corners,
    grown,
    meets_any,
    moved,
    overlap,
    rectangle,
    whole_box,
)
from gibench.generators.openings import ARCHITRAVE, SILL, SILL_REACH
from gibench.generators.parts import FloatArray, Furniture, Support
from gibench.generators.poses import turn
from gibench.generators.shell import Shell

LIFT = 2e-4  # what stands on something stands this far above it, so that faces never coincide, m
WALKWAY = 0.6  # width that stays free from the door to every camera, m
DOOR_DEPTH = 0.95  # floor in front of the door that stays free, m
HEADROOM = 2.0  # what hangs higher does not bar the way, m
CLOSE = 0.005  # least distance between things that do not stand on each other, m

# What is pushed under something, and what has room beneath or between its parts, is tested surface by surface,
# all else as one box.
AIRY = frozenset(
    {
        "chair",
        "office_chair",
        "stool",
        "bench",
        "dining_table",
        "desk",
        "side_table",
        "floor_lamp",
        "curtain",
        "pendant",
    }
)


class RejectedRoom(GibenchError):
    """A try at a room that could not be completed. reason: a word or two, by which rejections are counted."""

    def __init__(self, reason: str, advice: str = "the next try draws everything again") -> None:
        """advice: what can be done, for the message."""
        super().__init__(f"room rejected: {reason}; {advice}")
        self.reason, self.advice = reason, advice


@dataclass(frozen=True, eq=False)
class Placed:
    """A piece of furniture in its place. boxes: (N, 7) in the room, see `solids`. on: name of what carries it."""

    name: str
    furniture: Furniture
    position: tuple[float, float, float]
    yaw: float
    boxes: FloatArray
    on: str = ""

    @property
    def half(self) -> tuple[float, float]:
        """Half its length along its own x and y, metres."""
        low, high = bounds_of(self.furniture)
        return float(high[0] - low[0]) / 2, float(high[1] - low[1]) / 2

    @property
    def top(self) -> float:
        """Height of its highest point, metres."""
        return float(self.boxes[:, 6].max())

    def point(self, x: float, y: float) -> tuple[float, float]:
        """World xy of a point given in its own frame."""
        offset = turn(np.array([x, y]), self.yaw)
        return self.position[0] + float(offset[0]), self.position[1] + float(offset[1])


class FloorPlan:
    """A room that is being furnished. rng: the random lane of the layout."""

    def __init__(self, shell: Shell, kind: str, rng: np.random.Generator) -> None:
        """An empty room, with its door and windows kept free."""
        self.shell, self.kind, self.rng = shell, kind, rng
        self.placed: list[Placed] = []
        self._boxes = np.zeros((0, 7))
        self._owners = np.zeros(0, dtype=int)  # of each box, the number of its piece in `placed`
        self._zones = np.zeros((0, 7))
        self._may_enter: list[frozenset[str]] = []  # one for each zone
        self._counts: dict[str, int] = {}
        low, high = shell.footprint.min(0), shell.footprint.max(0)
        self._low, self._high = low, high
        self._notch = np.zeros((0, 7))
        if shell.notch is not None:
            x0, y0, x1, y1 = shell.notch
            self._notch = rectangle(
                (x0 + x1) / 2, (y0 + y1) / 2, (x1 - x0) / 2, (y1 - y0) / 2, 0.0, -1.0, 9.0
            )
        door, wall = shell.door, shell.walls[shell.door.wall]
        x, y = wall.point((door.s0 + door.s1) / 2, DOOR_DEPTH / 2)
        half = (door.s1 - door.s0) / 2 + ARCHITRAVE
        self.keep_free(rectangle(x, y, half, DOOR_DEPTH / 2, wall.yaw, 0.02, HEADROOM))
        for window in shell.windows:
            wall = shell.walls[window.wall]
            x, y = wall.point((window.s0 + window.s1) / 2, 0.2)
            half = (window.s1 - window.s0) / 2 + 0.05
            box = rectangle(x, y, half, 0.2, wall.yaw, window.z0 - 0.05, window.z1)
            self.keep_free(box, ("curtain", "plant", "floor_lamp"))
            x, y = wall.point((window.s0 + window.s1) / 2, SILL_REACH / 2)
            low, high = window.z0 - CLOSE, window.z0 + SILL + CLOSE
            self.keep_free(rectangle(x, y, half, SILL_REACH / 2 + CLOSE, wall.yaw, low, high))

    def sample(self, family: str, **fixed: Any) -> Furniture:
        """Draw a piece of furniture from the layout's lane."""
        return sample_furniture(self.rng, family, **fixed)

    def chance(self, share: float) -> bool:
        """True in that share of the cases."""
        return bool(self.rng.random() < share)

    def boxes_of(self, furniture: Furniture) -> FloatArray:
        """(N, 7) boxes that stand for a piece, in its own frame."""
        return component_boxes(furniture) if furniture.family in AIRY else whole_box(furniture)

    def floor_level(self, boxes: FloatArray) -> float | None:
        """Height of what carries a piece that stands there: the floor, or a rug of one thickness all over.

        None across the edge of a rug, and on rugs with a border that lies lower.
        """
        level = 0.0
        footing = boxes[boxes[:, 5] < boxes[:, 5].min() + 0.02]
        for rug in self.placed:
            if rug.furniture.family == "rug" and overlap(_flat(footing), _flat(rug.boxes)).any():
                if rug.furniture.parameters.get("style", "plain") != "plain":
                    return None
                inside = shapely.Polygon(corners(grown(rug.boxes, -0.01))[0])
                if not all(inside.covers(shapely.Polygon(c)) for c in corners(footing)):
                    return None
                level = rug.top
        return level

    def put(
        self,
        furniture: Furniture,
        xy: Sequence[float],
        yaw: float,
        *,
        z: float | None = None,
        zone: FloatArray | None = None,
        zone_but: Sequence[str] = (),
        margin: float = CLOSE,
        on: Placed | None = None,
    ) -> Placed | None:
        """Place a piece if it fits there.

        xy: metres. z: height of its origin; on the floor or on a rug if None. zone: (1, 7) in the room, floor
        that must be free of other things now and later, `zone_but` naming families that may enter.
        margin: distance to other things. on: what carries it, against which it is not tested.
        """
        own = self.boxes_of(furniture)
        boxes = moved(own, (float(xy[0]), float(xy[1]), 0.0 if z is None else z), yaw)
        if z is None:
            level = self.floor_level(boxes)
            if level is None:
                return None
            z = level + LIFT
            boxes[:, 5:] += z
        if not self._fits(furniture, boxes, margin, on):
            return None
        if zone is not None and self.blocked(zone, zone_but):
            return None
        count = self._counts.get(furniture.family, 0)
        self._counts[furniture.family] = count + 1
        position = (float(xy[0]), float(xy[1]), float(z))
        thing = Placed(f"{furniture.family}.{count}", furniture, position, yaw, boxes, on.name if on else "")
        self._boxes = np.concatenate([self._boxes, boxes])
        self._owners = np.concatenate([self._owners, np.full(len(boxes), len(self.placed))])
        self.placed.append(thing)
        if zone is not None:
            self.keep_free(zone, zone_but)
        return thing

    def keep_free(self, zone: FloatArray, but: Sequence[str] = ()) -> None:
        """Bar a zone (1, 7) for all that comes later, except rugs and the named families."""
        self._zones = np.concatenate([self._zones, zone])
        self._may_enter.append(frozenset({"rug", *but}))

    def replace_furniture(self, thing: Placed, furniture: Furniture) -> None:
        """Exchange a piece for another of the same outline, such as a lamp for itself with other bulbs."""
        self.placed[self.placed.index(thing)] = replace(thing, furniture=furniture)

    def of(self, *families: str) -> list[Placed]:
        """Things of those families that have been placed."""
        return [p for p in self.placed if p.furniture.family in families]

    def _fits(self, furniture: Furniture, boxes: FloatArray, margin: float, on: Placed | None) -> bool:
        # On the floor things stand clear of the skirting; what hangs may touch the wall.
        low_down = furniture.mount == "floor" and furniture.family != "rug"
        inset = self.shell.skirting_depth + 0.003 if low_down else 0.0
        if furniture.family == "rug":
            inset = self.shell.skirting_depth + 0.02
        points = corners(boxes).reshape(-1, 2)
        if (points < self._low + inset - 1e-9).any() or (points > self._high - inset + 1e-9).any():
            return False
        if meets_any(grown(boxes, inset - 1e-6), self._notch):
            return False
        if boxes[:, 6].max() > self.shell.height + 1e-6:
            return False
        barred = [furniture.family not in families for families in self._may_enter]
        if meets_any(boxes, self._zones[barred]):
            return False
        others = self._boxes
        if on is not None:
            others = others[self._owners != self.placed.index(on)]
        return not meets_any(grown(boxes, margin), others)

    def blocked(self, zone: FloatArray, but: Sequence[str] = ()) -> bool:
        """Whether a zone (1, 7) leaves the room, or meets furniture other than rugs and the named families."""
        if (corners(zone)[0] < self._low - 1e-6).any() or (corners(zone)[0] > self._high + 1e-6).any():
            return True
        if overlap(zone, self._notch).any():
            return True
        solid = [p.boxes for p in self.placed if p.furniture.family not in ("rug", *but)]
        return bool(solid) and bool(overlap(zone, np.concatenate(solid)).any())

    def free_floor(self, width: float = WALKWAY) -> shapely.Geometry:
        """Floor that the middle of someone `width` metres wide can stand, having come in through the door.

        A polygon, or an empty geometry if the door is blocked.
        """
        bars = [p.boxes for p in self.placed if p.furniture.family != "rug"]
        boxes = np.concatenate([np.zeros((0, 7)), *bars])
        boxes = boxes[boxes[:, 5] < HEADROOM]
        solid = shapely.union_all(shapely.polygons(corners(boxes)))
        floor = shapely.Polygon(self.shell.footprint)
        free = floor.difference(solid).buffer(-width / 2, quad_segs=4)
        door, wall = self.shell.door, self.shell.walls[self.shell.door.wall]
        sill = shapely.Point(wall.point((door.s0 + door.s1) / 2, width / 2 + 0.02))
        for part in getattr(free, "geoms", [free]):
            if part.distance(sill) < 0.02:
                return part
        return shapely.Polygon()


def _flat(boxes: FloatArray) -> FloatArray:
    result = boxes.copy()
    result[:, 5], result[:, 6] = 0.0, 1.0
    return result


def first(tries: int, attempt: Callable[[], Placed | None]) -> Placed | None:
    """The first success of at most `tries` attempts."""
    for _ in range(tries):
        if (thing := attempt()) is not None:
            return thing
    return None


def required(thing: Placed | None, what: str) -> Placed:
    """The thing, or RejectedRoom if there is none."""
    if thing is None:
        raise RejectedRoom(f"no place for {what}")
    return thing


def support_area(support: Support) -> float:
    """m²."""
    return (support.x1 - support.x0) * (support.y1 - support.y0)


def turned(yaw: float) -> float:
    """The opposite direction."""
    return math.remainder(yaw + math.pi, 2 * math.pi)
