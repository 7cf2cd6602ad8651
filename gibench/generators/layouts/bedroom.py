"""Bedrooms: a bed with nightstands, a wardrobe, a dresser, a place to sit."""

from __future__ import annotations

from gibench.generators.layouts import dressing
from gibench.generators.layouts.office import equip_desk
from gibench.generators.layouts.placement import FloorPlan, Placed, required
from gibench.generators.layouts.relations import against_wall, beside, in_front
from gibench.generators.layouts.solids import bounds_of, rectangle

BED_SIDE = 0.55  # floor that stays free along one side of a bed, m


def furnish(plan: FloorPlan) -> None:
    """Furnish an empty plan. Raises RejectedRoom where no bed fits."""
    dressing.hang_curtains(plan, 0.85)
    bed = required(_bed(plan), "a bed")
    stand, on_wall = plan.sample("nightstand"), plan.chance(0.25)
    for side in (-1, 1):
        if plan.chance(0.85):
            table = beside(plan, stand, bed, side, 0.06)
            if table is not None and not on_wall and plan.chance(0.85):
                dressing.table_lamp_on(plan, table)
    if on_wall:
        dressing.wall_lamps_beside(plan, bed, 1.15)
    _rug(plan, bed)
    for width in (2.0, 1.2):
        wardrobe = plan.sample("wardrobe")
        if bounds_of(wardrobe)[1, 0] * 2 > width:
            wardrobe = plan.sample("wardrobe", width=width)
        if against_wall(plan, wardrobe, corner=plan.chance(0.6), use=0.6) is not None:
            break
    dresser = against_wall(plan, plan.sample("dresser"), use=0.5)
    if dresser is not None:
        dressing.picture_above(plan, dresser)
        if plan.chance(0.5):
            dressing.table_lamp_on(plan, dresser, (0.8, 0.0))
    if plan.chance(0.45):
        desk = against_wall(plan, plan.sample("desk"), use=0.7, use_but=("chair",))
        if desk is not None:
            in_front(plan, plan.sample("chair"), desk, -0.25, tilt=float(plan.rng.normal(0.0, 0.2)))
            equip_desk(plan, desk)
    if plan.chance(0.4):
        in_front(plan, plan.sample("bench"), bed, 0.06)
    if plan.chance(0.3):
        dressing.seating_group(plan)
    elif plan.chance(0.5):
        dressing.in_the_middle(plan, plan.sample("ottoman"), around=0.7, rug=0.7)
    if plan.chance(0.5):
        dressing.reading_corner(plan)
    dressing.fill_walls(plan, {"bookcase": 1.0, "shelf": 1.0, "dresser": 0.7, "wardrobe": 0.7, "bench": 0.5})
    dressing.picture_above(plan, bed)
    if plan.chance(0.4):
        dressing.floor_lamps(plan, 1)
    dressing.plants(plan, int(plan.rng.integers(0, 3)))
    if plan.chance(0.6):
        dressing.pendant_in_middle(plan)
    dressing.pictures(plan, int(plan.rng.integers(1, 4)))
    if plan.chance(0.4):
        dressing.mirrors(plan, 1)
    dressing.dress_surfaces(plan)


def _bed(plan: FloorPlan) -> Placed | None:
    for width in (2.0, 1.4, 0.95):
        piece = plan.sample("bed")
        if bounds_of(piece)[1, 0] * 2 > width:
            piece = plan.sample("bed", width=width)
        bed = against_wall(plan, piece, centred=plan.chance(0.5), use=0.6)
        if bed is None:
            continue
        half_x, half_y = bed.half
        x, y = bed.point(half_x + BED_SIDE / 2, 0.3)
        for side in (1, -1):
            x, y = bed.point(side * (half_x + BED_SIDE / 2), 0.3)
            zone = rectangle(x, y, BED_SIDE / 2, half_y - 0.3, bed.yaw, 0.03, 1.6)
            plan.keep_free(zone, ("nightstand", "floor_lamp"))
        return bed
    return None


def _rug(plan: FloorPlan, bed: Placed) -> None:
    """A rug at the foot or at a side of the bed."""
    draw = plan.rng.random()
    half_x, half_y = bed.half
    if draw < 0.4:
        x, y = bed.point(0.0, half_y + 0.55)
        dressing.rug_under(plan, x, y, bed.yaw, width=2 * half_x + 0.4, depth=0.9, bare=True)
    elif draw < 0.8:
        side = 1 if plan.chance(0.5) else -1
        x, y = bed.point(side * (half_x + 0.45), 0.2)
        dressing.rug_under(plan, x, y, bed.yaw, width=0.75, depth=1.5, bare=True)
