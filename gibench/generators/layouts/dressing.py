"""Things that all rooms get at the end: curtains, pictures, mirrors, plants, lamps, and things on surfaces."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gibench.generators.layouts.placement import FloorPlan, Placed, support_area
from gibench.generators.layouts.relations import (
    above,
    against_wall,
    along_wall,
    beside,
    facing,
    free_spot,
    from_ceiling,
    hang,
    hang_free,
    in_corner,
    lay_rug,
    on_top,
    wall_behind,
)
from gibench.generators.layouts.solids import bounds_of
from gibench.generators.openings import SILL_REACH
from gibench.generators.parts import Furniture

CURTAIN_AWAY = SILL_REACH + 0.01  # a curtain hangs clear of the sill and the skirting, m
CURTAIN_REACH = 0.18  # how far its rod stands out over the window's sides, m
RUG = ((0.6, 4.0), (0.45, 3.0))  # widths and depths of rugs, m
EYE_LEVEL = 1.55  # middle of pictures on a free wall, m

# What stands on what, with weights. "" is for all carriers that are not listed.
SMALL_THINGS: dict[str, dict[str, float]] = {
    "coffee_table": {"books": 1.5, "bowl": 1.2, "mug": 1.2, "vase": 0.8, "small_plant": 0.6, "box": 0.3},
    "dining_table": {"mug": 2.0, "bowl": 1.5, "bottle": 1.0, "vase": 0.8},
    "desk": {"mug": 1.0, "books": 1.5, "box": 0.8, "small_plant": 0.6},
    "kitchen_counter": {"bottle": 2.0, "bowl": 1.5, "mug": 1.5, "box": 0.4, "small_plant": 0.5},
    "wall_cupboard": {"bowl": 1.5, "mug": 2.0, "bottle": 0.5},
    "fridge": {"box": 1.0, "bowl": 0.5},
    "washbasin": {"bottle": 2.0, "mug": 1.0},
    "nightstand": {"mug": 1.0, "books": 1.2, "vase": 0.3},
    "side_table": {"mug": 1.0, "books": 1.0, "small_plant": 0.7},
    "wardrobe": {"box": 1.0},
    "": {"books": 1.5, "vase": 1.2, "box": 1.2, "bowl": 0.8, "small_plant": 1.0, "bottle": 0.3},
}


def hang_curtains(plan: FloorPlan, share: float) -> None:
    """Hang curtains at that share of the windows, down to the floor or to the sill."""
    for window in plan.shell.windows:
        if not plan.chance(share):
            continue
        wall = plan.shell.walls[window.wall]
        width = window.s1 - window.s0 + 2 * CURTAIN_REACH
        top = min(plan.shell.height - 0.06, window.z1 + 0.15)
        long = plan.chance(0.7)
        bottom = 0.02 if long else max(0.02, min(window.z0 - 0.12, top - 1.0))
        if not 0.05 < window.s0 - CURTAIN_REACH < window.s1 + CURTAIN_REACH < wall.length - 0.05:
            continue
        size = {"width": round(width, 4), "height": round(top - bottom, 4)}
        # Mostly drawn to the sides, so that the window is seen; shut now and then.
        closed = float(plan.rng.uniform(0.25, 0.5)) if plan.chance(0.9) else 0.95
        curtain = plan.sample("curtain", closed=round(closed, 4), **size)
        hang(plan, curtain, wall, (window.s0 + window.s1) / 2, bottom, away=CURTAIN_AWAY)


def rug_under(
    plan: FloorPlan, x: float, y: float, yaw: float, *, width: float, depth: float, bare: bool = False
) -> Placed | None:
    """Lay a rug at a place, smaller and smaller until it fits. bare: nothing is to stand on it."""
    style = str(plan.rng.choice(["bordered", "plain", "oval"])) if bare else "plain"
    for shrink in (1.0, 0.85, 0.7):
        size = [
            round(float(np.clip(v * shrink, low, high)), 4)
            for v, (low, high) in zip((width, depth), RUG, strict=True)
        ]
        rug = lay_rug(plan, plan.sample("rug", style=style, width=size[0], depth=size[1]), (x, y), yaw)
        if rug is not None:
            return rug
    return None


def picture_above(plan: FloorPlan, anchor: Placed) -> Placed | None:
    """A picture, or a mirror now and then, over a piece that stands at a wall."""
    clear = float(plan.rng.uniform(0.15, 0.35))
    widest = 2 * anchor.half[0]
    for _ in range(3):
        family = "mirror" if plan.chance(0.2) else "picture"
        thing = plan.sample(family)
        if float(np.ptp(bounds_of(thing)[:, 0])) < widest + 0.1 and (
            hung := above(plan, thing, anchor, clear)
        ):
            return hung
    return None


def fill_walls(
    plan: FloorPlan, weights: Mapping[str, float], *, share: tuple[float, float] = (0.2, 0.3)
) -> None:
    """Stand more furniture at the walls until it covers enough of the floor, or nothing fits any more.

    weights: family → how often. share: bounds of the part of the floor that all furniture is to cover.
    """
    low, high = plan.shell.footprint.min(0), plan.shell.footprint.max(0)
    wanted = float(plan.rng.uniform(*share)) * float(np.prod(high - low))
    failures = 0
    while failures < 4 and _covered(plan) < wanted:
        family = _pick(plan, weights)
        piece = against_wall(plan, plan.sample(family), use=0.45, tries=8)
        if piece is None:
            failures += 1
        elif family in ("dresser", "bench", "armchair") and plan.chance(0.6):
            picture_above(plan, piece)


def _covered(plan: FloorPlan) -> float:
    """Floor under furniture, m²."""
    return sum(
        4 * p.half[0] * p.half[1]
        for p in plan.placed
        if p.furniture.mount == "floor" and p not in plan.of("rug")
    )


def reading_corner(plan: FloorPlan) -> None:
    """An armchair across a corner, with a small table and a lamp."""
    seat = in_corner(plan, plan.sample("armchair"), room=0.25)
    if seat is None:
        return
    side = 1 if plan.chance(0.5) else -1
    beside(plan, plan.sample("side_table"), seat, side, 0.05)
    beside(plan, plan.sample("floor_lamp"), seat, -side, 0.02)


def in_the_middle(plan: FloorPlan, furniture: Furniture, *, around: float, rug: float = 0.0) -> Placed | None:
    """Stand a piece in open floor, `around` m free about it, on a rug that reaches `rug` m beyond it if > 0."""
    spot = free_spot(plan, furniture, around=around)
    if spot is None:
        return None
    (x, y), yaw = spot
    if rug > 0:
        width, depth = (float(v) + 2 * rug for v in np.ptp(bounds_of(furniture), axis=0)[:2])
        rug_under(plan, x, y, yaw, width=width, depth=depth)
    return plan.put(furniture, (x, y), yaw)


def seating_group(plan: FloorPlan) -> None:
    """Two to four seats around a low table in open floor."""
    table = in_the_middle(plan, plan.sample("coffee_table", width=0.8), around=1.15, rug=0.9)
    if table is None:
        return
    seat = plan.sample("armchair" if plan.chance(0.7) else "ottoman")
    for angle in plan.rng.permutation([0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi])[: int(plan.rng.integers(2, 5))]:
        facing(plan, seat, table, float(angle), 0.25, tilt=float(plan.rng.normal(0.0, 0.1)))


def pictures(plan: FloorPlan, count: int) -> None:
    """Pictures on free stretches of wall."""
    for _ in range(count):
        hang_free(plan, plan.sample("picture"), middle=EYE_LEVEL + float(plan.rng.normal(0.0, 0.06)))


def plants(plan: FloorPlan, count: int) -> None:
    """Plants on the floor, in corners or at walls."""
    for _ in range(count):
        plant = plan.sample("plant")
        if in_corner(plan, plant) is None:
            against_wall(plan, plant, tries=6)


def floor_lamps(plan: FloorPlan, count: int) -> None:
    """Lamps in corners that nothing else has taken."""
    for _ in range(count):
        in_corner(plan, plan.sample("floor_lamp"))


def pendant_over(plan: FloorPlan, thing: Placed, lowest: float) -> Placed | None:
    """A pendant over the middle of a piece, its lower end at about that height (m)."""
    drop = plan.shell.height - lowest - float(plan.rng.uniform(0.0, 0.15))
    lamp = plan.sample("pendant", height=round(float(np.clip(drop, 0.45, 1.4)), 4))
    return from_ceiling(plan, lamp, thing.position[:2], thing.yaw)


def pendant_in_middle(plan: FloorPlan) -> Placed | None:
    """A short pendant near the middle of the free floor, high enough to walk under."""
    free = plan.free_floor()
    if free.is_empty:
        return None
    x, y = plan.shell.footprint.mean(0) * 0.7 + np.array(free.centroid.coords[0]) * 0.3
    headroom = plan.shell.height - 1.95
    if headroom < 0.45:
        return None
    lamp = plan.sample("pendant", height=round(min(1.4, headroom, 0.45 + 0.5 * float(plan.rng.random())), 4))
    return from_ceiling(plan, lamp, (float(x), float(y)))


def table_lamp_on(plan: FloorPlan, carrier: Placed, at: tuple[float, float] | None = None) -> Placed | None:
    """A table lamp on a piece of furniture."""
    return on_top(plan, plan.sample("table_lamp"), carrier, at=at, yaw=0.0)


def dress_surfaces(plan: FloorPlan, *, density: float = 5.0, most: int = 22) -> None:
    """Put small things on whatever has room for them.

    density: things per square metre of support on average. most: of them in the room.
    """
    count = 0
    carriers = [p for p in plan.placed if p.furniture.supports and p.furniture.mount != "surface"]
    for number in plan.rng.permutation(len(carriers)):
        carrier = carriers[int(number)]
        kinds = SMALL_THINGS.get(carrier.furniture.family, SMALL_THINGS[""])
        for which, support in enumerate(carrier.furniture.supports):
            expected = min(3.0, density * support_area(support))
            for _ in range(min(4, int(plan.rng.poisson(expected)))):
                if count >= most:
                    return
                thing = plan.sample(_pick(plan, kinds))
                if on_top(plan, thing, carrier, support=which, tries=4) is not None:
                    count += 1


def _pick(plan: FloorPlan, weights: Mapping[str, float]) -> str:
    share = np.array(list(weights.values()))
    return str(plan.rng.choice(list(weights), p=share / share.sum()))


def mirrors(plan: FloorPlan, count: int) -> None:
    """Mirrors on free stretches of wall."""
    for _ in range(count):
        hang_free(plan, plan.sample("mirror"), middle=EYE_LEVEL)


def wall_lamps_beside(plan: FloorPlan, anchor: Placed, height: float) -> None:
    """A pair of wall lamps, or one, at the sides of something that stands or hangs at a wall."""
    lamp = plan.sample("wall_lamp")
    reach = anchor.half[0] + float(bounds_of(lamp)[1, 0]) + 0.08
    wall = wall_behind(plan, anchor)
    if wall is None:
        return
    s = along_wall(wall, anchor)
    for side in (-1, 1):
        hang(plan, lamp, wall, s + side * reach, height)
