"""Living rooms: a sofa group that looks at a television, shelves, plants, pictures."""

from __future__ import annotations

import math

from gibench.generators.layouts import dressing
from gibench.generators.layouts.dining_kitchen import dining_group
from gibench.generators.layouts.placement import FloorPlan, Placed, required
from gibench.generators.layouts.relations import (
    across_from,
    against_wall,
    beside,
    facing,
    in_front,
    on_top,
)
from gibench.generators.layouts.solids import bounds_of

SEATED = ("coffee_table", "armchair", "ottoman", "floor_lamp")  # what may stand in the space before a sofa


def furnish(plan: FloorPlan) -> None:
    """Furnish an empty plan. Raises RejectedRoom where no sofa fits."""
    dressing.hang_curtains(plan, 0.75)
    sofa = required(_sofa(plan), "a sofa")
    table = _coffee_table(plan, sofa)
    _television(plan, sofa)
    if table is not None:
        for side in (-1, 1):
            if plan.chance(0.65):
                tilt = float(plan.rng.normal(0.0, 0.15))
                facing(plan, plan.sample("armchair"), table, side * math.pi / 2, 0.45, tilt=tilt)
        if plan.chance(0.3):
            facing(plan, plan.sample("ottoman"), table, float(plan.rng.normal(0.0, 0.4)), 0.3)
    for side in (-1, 1):
        draw = plan.rng.random()
        if draw < 0.4:
            stand = beside(plan, plan.sample("side_table"), sofa, side, 0.06)
            if stand is not None:
                dressing.table_lamp_on(plan, stand)
        elif draw < 0.7:
            beside(plan, plan.sample("floor_lamp"), sofa, side, 0.06)
    low, high = plan.shell.footprint.min(0), plan.shell.footprint.max(0)
    if plan.chance(0.25 if float((high - low).prod()) < 20.0 else 0.7):
        dining_group(plan)
    elif plan.chance(0.4):
        dressing.seating_group(plan)
    if plan.chance(0.5):
        dressing.reading_corner(plan)
    dresser = against_wall(plan, plan.sample("dresser"), use=0.45) if plan.chance(0.6) else None
    if dresser is not None:
        dressing.picture_above(plan, dresser)
        dressing.table_lamp_on(plan, dresser, (0.8, 0.0))
    dressing.fill_walls(plan, {"bookcase": 2.0, "shelf": 1.5, "bench": 0.7, "dresser": 0.7, "armchair": 0.5})
    dressing.picture_above(plan, sofa)
    if plan.chance(0.5):
        dressing.floor_lamps(plan, 1)
    dressing.plants(plan, int(plan.rng.integers(1, 4)))
    if table is not None and plan.shell.height > 2.55 and plan.chance(0.4):
        dressing.pendant_over(plan, table, 1.75)
    elif plan.chance(0.5):
        dressing.pendant_in_middle(plan)
    dressing.pictures(plan, int(plan.rng.integers(1, 5)))
    dressing.dress_surfaces(plan)


def _sofa(plan: FloorPlan) -> Placed | None:
    for widest in (3.2, 2.3, 1.8):
        piece = plan.sample("sofa")
        if bounds_of(piece)[1, 0] * 2 > widest:
            piece = plan.sample("sofa", width=widest)
        # Before the sofa there is room for legs and a table.
        sofa = against_wall(plan, piece, centred=plan.chance(0.5), use=0.85, use_but=SEATED)
        if sofa is not None:
            return sofa
    return None


def _coffee_table(plan: FloorPlan, sofa: Placed) -> Placed | None:
    distance = float(plan.rng.uniform(0.35, 0.5))
    if plan.chance(0.7):
        x, y = sofa.point(0.0, sofa.half[1] + 0.95)
        dressing.rug_under(plan, x, y, sofa.yaw, width=1.9 * sofa.half[0], depth=1.75)
    return in_front(plan, plan.sample("coffee_table"), sofa, distance)


def _television(plan: FloorPlan, sofa: Placed) -> None:
    stand = across_from(plan, plan.sample("tv_stand"), sofa, use=0.4, use_but=SEATED)
    if stand is None:
        return
    board = stand.furniture.supports[0]
    screen = plan.sample("tv")
    widest = board.x1 - board.x0 - 0.03
    if 2 * float(bounds_of(screen)[1, 0]) > widest:
        screen = plan.sample("tv", width=round(widest, 4))
    on_top(plan, screen, stand, support=0, at=(0.0, 0.0), yaw=0.0)
