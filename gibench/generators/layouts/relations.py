"""Relations between things: against a wall, in a corner, facing, beside, around, on top, hanging.

Each relation draws poses from the plan's lane and returns what was placed, or None where nothing fitted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gibench.generators.layouts.placement import CLOSE, LIFT, FloorPlan, Placed, first, support_area, turned
from gibench.generators.layouts.solids import bounds_of, rectangle
from gibench.generators.parts import FloatArray, Furniture
from gibench.generators.poses import facing_yaw, turn
from gibench.generators.shell import Wall

TRIES = 16
FRAME = 0.1  # what stays free around doors and windows on the wall, m
WALL_GAP = 0.001  # between a wall and what hangs on it, m


def against_wall(
    plan: FloorPlan,
    furniture: Furniture,
    *,
    walls: Sequence[int] | None = None,
    corner: bool = False,
    centred: bool = False,
    gap: float = 0.01,
    use: float = 0.0,
    use_but: Sequence[str] = (),
    tries: int = TRIES,
) -> Placed | None:
    """Stand a piece with its back to a wall.

    walls: indices to choose from, all if None. corner: at one end of the wall. centred: in its middle. gap: behind the
    piece, beyond the skirting, m. use: depth of floor in front that stays free, m, except for `use_but`.
    """
    low, high = bounds_of(furniture)
    half_x, half_y = (high[:2] - low[:2]) / 2
    chosen = [plan.shell.walls[i] for i in (range(len(plan.shell.walls)) if walls is None else walls)]
    chosen = [w for w in chosen if w.length > 2 * half_x + 0.1]
    if not chosen:
        return None
    weights = np.array([w.length for w in chosen])
    away = half_y + gap + plan.shell.skirting_depth + CLOSE

    def attempt() -> Placed | None:
        wall = chosen[int(plan.rng.choice(len(chosen), p=weights / weights.sum()))]
        first_s = half_x + plan.shell.skirting_depth + 0.02
        last_s = wall.length - first_s
        if corner:
            s = first_s if plan.chance(0.5) else last_s
        elif centred:
            s = wall.length / 2 + float(plan.rng.normal(0.0, 0.15))
        else:
            s = float(plan.rng.uniform(first_s, last_s))
        zone = front_zone(wall.point(s, away + half_y), wall.yaw, half_x, use) if use else None
        return plan.put(furniture, wall.point(s, away), wall.yaw, zone=zone, zone_but=use_but)

    return first(tries, attempt)


def front_zone(edge: Sequence[float], yaw: float, half_x: float, depth: float) -> FloatArray:
    """(1, 7) floor zone of that depth in front of the point `edge` (2,), the middle of a front."""
    x, y = np.asarray(edge) + turn(np.array([0.0, depth / 2]), yaw)
    return rectangle(float(x), float(y), half_x, depth / 2, yaw, 0.03, 1.6)


def in_front(
    plan: FloorPlan,
    furniture: Furniture,
    anchor: Placed,
    distance: float,
    *,
    across: float = 0.0,
    face: bool = True,
    tilt: float = 0.0,
) -> Placed | None:
    """Stand a piece before another, `distance` m between them, turned to it (`face`) or the same way."""
    half_y = bounds_of(furniture)[1, 1]
    xy = anchor.point(across, anchor.half[1] + distance + float(half_y))
    yaw = (turned(anchor.yaw) if face else anchor.yaw) + tilt
    return plan.put(furniture, xy, yaw)


def beside(plan: FloorPlan, furniture: Furniture, anchor: Placed, side: int, gap: float) -> Placed | None:
    """Stand a piece at the left (−1) or right (1) of another, backs in line, `gap` m between them."""
    half_x, half_y = bounds_of(furniture)[1, :2]
    x = side * (anchor.half[0] + gap + float(half_x))
    return plan.put(furniture, anchor.point(x, float(half_y) - anchor.half[1]), anchor.yaw)


def around(
    plan: FloorPlan, chairs: Sequence[Furniture], table: Placed, *, tuck: float, ends: bool = True
) -> list[Placed]:
    """Stand chairs around a table, facing it, their fronts `tuck` m under its edge. Returns those that fitted.

    ends: whether the short sides get chairs too.
    """
    half_x, half_y = table.half
    width = float(np.ptp(bounds_of(chairs[0])[:, 0])) + 0.1
    along = max(1, int(2 * half_x / width))
    along = min(along, max(1, (len(chairs) - 2 * (ends and len(chairs) > 4)) // 2))
    seats: list[tuple[float, float, float, float]] = []  # direction from the table, place on its edge
    spread = 2 * half_x / along
    for k in range(along):
        x = (k + 0.5) * spread - half_x
        seats += [(0.0, 1.0, x, half_y), (0.0, -1.0, x, half_y)]
    if ends:
        seats += [(1.0, 0.0, 0.0, half_x), (-1.0, 0.0, 0.0, half_x)]
    placed = []
    for chair, (dx, dy, shift, edge) in zip(chairs, seats, strict=False):
        reach = edge + float(bounds_of(chair)[1, 1])
        own_yaw = facing_yaw((-dx, -dy))
        for pushed in (tuck, tuck / 2, 0.0, -0.06):
            out = reach - pushed + float(plan.rng.uniform(0.0, 0.05))
            x, y = (dx * out, shift) if dx else (shift, dy * out)
            yaw = table.yaw + own_yaw + float(plan.rng.normal(0.0, 0.06))
            seat = plan.put(chair, table.point(x, y), yaw)
            if seat is not None:
                placed.append(seat)
                break
    return placed


def in_corner(
    plan: FloorPlan, furniture: Furniture, *, tries: int = TRIES, room: float = 0.12
) -> Placed | None:
    """Stand a piece in a corner of the room, `room` m or so away from both walls, its front to the middle."""
    half = float(np.abs(bounds_of(furniture)[:, :2]).max())
    walls = plan.shell.walls

    def attempt() -> Placed | None:
        wall = walls[int(plan.rng.integers(len(walls)))]
        if wall.reflex[0]:
            return None
        away = half + plan.shell.skirting_depth + float(plan.rng.uniform(0.02, room))
        x, y = wall.point(away, away)
        toward = wall.along + wall.inward
        return plan.put(furniture, (x, y), facing_yaw(toward))

    return first(tries, attempt)


def free_spot(
    plan: FloorPlan, furniture: Furniture, *, around: float, tries: int = TRIES
) -> tuple[tuple[float, float], float] | None:
    """A place (x, y) and yaw for a piece that stands freely, parallel to the walls, `around` m free about it."""
    half_x, half_y = (float(v) for v in bounds_of(furniture)[1, :2])
    low, high = plan.shell.footprint.min(0), plan.shell.footprint.max(0)
    for _ in range(tries):
        x, y = (float(v) for v in plan.rng.uniform(low, high))
        yaw = int(plan.rng.integers(4)) * math.pi / 2
        if not plan.blocked(rectangle(x, y, half_x + around, half_y + around, yaw, 0.03, 1.6)):
            return (x, y), yaw
    return None


def on_top(
    plan: FloorPlan,
    furniture: Furniture,
    carrier: Placed,
    *,
    at: tuple[float, float] | None = None,
    support: int | None = None,
    yaw: float | None = None,
    tries: int = 8,
) -> Placed | None:
    """Stand a small piece on a support of another.

    at: where on the support, from −1 to 1 along its x and y; drawn if None. support: index; drawn by area if
    None. yaw: in the carrier's frame; drawn if None.
    """
    supports = carrier.furniture.supports
    if not supports:
        return None
    tall = float(bounds_of(furniture)[1, 2])
    weights = np.array([support_area(s) for s in supports])

    def attempt() -> Placed | None:
        which = int(plan.rng.choice(len(supports), p=weights / weights.sum())) if support is None else support
        top = supports[which]
        if tall + 2 * LIFT > top.clearance:
            return None
        own_yaw = float(plan.rng.uniform(-math.pi, math.pi)) if yaw is None else yaw
        # The turned outline must lie inside the rectangle.
        cos, sin = abs(math.cos(own_yaw)), abs(math.sin(own_yaw))
        extent = np.abs(bounds_of(furniture)[:, :2]).max(0)
        need_x = cos * extent[0] + sin * extent[1] + CLOSE
        need_y = sin * extent[0] + cos * extent[1] + CLOSE
        free_x, free_y = (top.x1 - top.x0) / 2 - need_x, (top.y1 - top.y0) / 2 - need_y
        if free_x < 0 or free_y < 0:
            return None
        u, v = plan.rng.uniform(-1, 1, 2) if at is None else at
        x, y = (top.x0 + top.x1) / 2 + float(u) * free_x, (top.y0 + top.y1) / 2 + float(v) * free_y
        z = carrier.position[2] + top.z + LIFT
        return plan.put(
            furniture, carrier.point(x, y), carrier.yaw + own_yaw, z=z, margin=CLOSE / 2, on=carrier
        )

    return first(tries if at is None or yaw is None else 1, attempt)


def hang(
    plan: FloorPlan, furniture: Furniture, wall: Wall, s: float, z: float, *, away: float = WALL_GAP
) -> Placed | None:
    """Fix a piece to a wall, its middle at s along it and its lowest point at z; refused across openings."""
    low, high = bounds_of(furniture)
    half_x, height = float(high[0] - low[0]) / 2, float(high[2])
    if z + height > plan.shell.height - 0.03 or s - half_x < 0.03 or s + half_x > wall.length - 0.03:
        return None
    if furniture.family != "curtain":
        for o in plan.shell.openings:
            clear = s + half_x < o.s0 - FRAME or s - half_x > o.s1 + FRAME
            if o.wall == wall.index and not clear and o.z0 - FRAME < z + height and z < o.z1 + FRAME:
                return None
    return plan.put(furniture, wall.point(s, away - float(low[1])), wall.yaw, z=z)


def hang_free(
    plan: FloorPlan,
    furniture: Furniture,
    *,
    middle: float,
    walls: Sequence[int] | None = None,
    tries: int = TRIES,
) -> Placed | None:
    """Fix a piece to any free stretch of wall, its middle at height `middle` or above what stands there."""
    low, high = bounds_of(furniture)
    half_x, height = float(high[0] - low[0]) / 2, float(high[2])
    chosen = [plan.shell.walls[i] for i in (range(len(plan.shell.walls)) if walls is None else walls)]
    chosen = [w for w in chosen if w.length > 2 * half_x + 0.2]
    if not chosen:
        return None
    weights = np.array([w.length for w in chosen])

    def attempt() -> Placed | None:
        wall = chosen[int(plan.rng.choice(len(chosen), p=weights / weights.sum()))]
        s = float(plan.rng.uniform(half_x + 0.1, wall.length - half_x - 0.1))
        z = middle - height / 2
        thing = hang(plan, furniture, wall, s, z)
        return thing or hang(plan, furniture, wall, s, z + 0.25)

    return first(tries, attempt)


def wall_behind(plan: FloorPlan, thing: Placed) -> Wall | None:
    """The wall that a piece has its back to, if it is close."""
    for wall in plan.shell.walls:
        away = float(np.dot(np.subtract(thing.position[:2], wall.start), wall.inward))
        at_wall = 0 < away < thing.half[1] + 0.25 and 0 < along_wall(wall, thing) < wall.length
        if at_wall and math.cos(wall.yaw - thing.yaw) > 0.999:
            return wall
    return None


def along_wall(wall: Wall, thing: Placed) -> float:
    """Distance of the middle of a piece along its wall, metres."""
    return float(np.dot(np.subtract(thing.position[:2], wall.start), wall.along))


def above(plan: FloorPlan, furniture: Furniture, anchor: Placed, clear: float) -> Placed | None:
    """Fix a piece to the wall behind another, centred on it, `clear` m above its top."""
    wall = wall_behind(plan, anchor)
    if wall is None:
        return None
    return hang(plan, furniture, wall, along_wall(wall, anchor), anchor.top + clear)


def from_ceiling(
    plan: FloorPlan, furniture: Furniture, xy: Sequence[float], yaw: float = 0.0
) -> Placed | None:
    """Hang a piece from the ceiling."""
    return plan.put(furniture, xy, yaw, z=plan.shell.height - LIFT)


def lay_rug(plan: FloorPlan, rug: Furniture, xy: Sequence[float], yaw: float) -> Placed | None:
    """Lay a rug on the floor, where no furniture stands yet."""
    return plan.put(rug, xy, yaw, z=LIFT)


def across_from(
    plan: FloorPlan, furniture: Furniture, anchor: Placed, *, use: float = 0.0, use_but: Sequence[str] = ()
) -> Placed | None:
    """Stand a piece at the wall that another one looks at, opposite to it."""
    half_x, half_y = (float(v) for v in bounds_of(furniture)[1, :2])
    opposite = [w for w in plan.shell.walls if math.cos(w.yaw - anchor.yaw) < -0.999]
    for wall in sorted(opposite, key=lambda w: -w.length):
        s = along_wall(wall, anchor)
        away = half_y + plan.shell.skirting_depth + 0.02
        for shift in (0.0, 0.25, -0.25, 0.5, -0.5, 0.8, -0.8):
            at = s + shift
            if not half_x + 0.05 < at < wall.length - half_x - 0.05:
                continue
            zone = front_zone(wall.point(at, away + half_y), wall.yaw, half_x, use) if use else None
            thing = plan.put(furniture, wall.point(at, away), wall.yaw, zone=zone, zone_but=use_but)
            if thing is not None:
                return thing
    return None


def facing(
    plan: FloorPlan, furniture: Furniture, target: Placed, angle: float, distance: float, *, tilt: float = 0.0
) -> Placed | None:
    """Stand a piece around another, turned to it.

    angle: its direction from the target, from the target's front counter-clockwise. distance: between them, m.
    tilt: how far it is turned away from facing exactly.
    """
    direction = turn(np.array([0.0, 1.0]), angle)
    edge = min(h / max(abs(d), 1e-9) for h, d in zip(target.half, direction, strict=True))
    reach = edge + distance + float(bounds_of(furniture)[1, 1])
    xy = target.point(*(reach * direction))
    return plan.put(furniture, xy, target.yaw + facing_yaw(-direction) + tilt)
