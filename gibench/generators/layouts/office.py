"""Offices: desks with screens, shelves of books, a corner to sit in."""

from __future__ import annotations

import math

from gibench.generators.layouts import dressing
from gibench.generators.layouts.dining_kitchen import dining_group
from gibench.generators.layouts.placement import FloorPlan, Placed, required
from gibench.generators.layouts.relations import against_wall, facing, free_spot, in_corner, in_front, on_top


def furnish(plan: FloorPlan) -> None:
    """Furnish an empty plan. Raises RejectedRoom where no desk fits."""
    dressing.hang_curtains(plan, 0.4)
    required(_work_place(plan, free_standing=plan.chance(0.35)), "a desk")
    for _ in range(int(plan.rng.integers(0, 3))):
        _work_place(plan, free_standing=False)
    if plan.chance(0.35):
        dining_group(plan)
    elif plan.chance(0.4):
        dressing.seating_group(plan)
    elif plan.chance(0.5):
        seat = in_corner(plan, plan.sample("armchair"), room=0.3)
        if seat is not None:
            table = in_front(plan, plan.sample("coffee_table", width=0.8), seat, 0.3)
            if table is not None:
                facing(plan, plan.sample("armchair"), table, math.pi, 0.35)
    dressing.fill_walls(
        plan, {"bookcase": 2.5, "shelf": 1.5, "dresser": 1.0, "wardrobe": 0.4, "armchair": 0.5}
    )
    if plan.chance(0.4):
        dressing.floor_lamps(plan, 1)
    dressing.plants(plan, int(plan.rng.integers(1, 4)))
    if plan.chance(0.3):
        dressing.pendant_in_middle(plan)
    dressing.pictures(plan, int(plan.rng.integers(1, 4)))
    dressing.dress_surfaces(plan)


def _work_place(plan: FloorPlan, *, free_standing: bool) -> Placed | None:
    piece = plan.sample("desk")
    desk = None
    if free_standing and (spot := free_spot(plan, piece, around=0.7)) is not None:
        desk = plan.put(piece, *spot)
    if desk is None:
        desk = against_wall(plan, piece, use=0.75, use_but=("office_chair",))
    if desk is None:
        return None
    in_front(plan, plan.sample("office_chair"), desk, -0.22, tilt=float(plan.rng.normal(0.0, 0.25)))
    equip_desk(plan, desk)
    return desk


def equip_desk(plan: FloorPlan, desk: Placed) -> None:
    """A laptop, or one or two monitors with a keyboard, and a lamp."""
    if plan.chance(0.25):
        on_top(plan, plan.sample("laptop"), desk, at=(0.0, 0.2), yaw=0.0)
    else:
        screen = plan.sample("monitor")
        places = (-0.6, 0.6) if desk.half[0] > 0.78 and plan.chance(0.4) else (0.0,)
        for place in places:
            on_top(plan, screen, desk, at=(place, -0.7), yaw=0.0)
        on_top(plan, plan.sample("keyboard"), desk, at=(0.0, 0.7), yaw=0.0)
    if plan.chance(0.6):
        lamp = plan.sample("desk_lamp" if plan.chance(0.7) else "table_lamp")
        on_top(plan, lamp, desk, at=(1.0 if plan.chance(0.5) else -1.0, -0.8), yaw=0.0)
