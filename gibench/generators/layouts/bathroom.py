"""Bathrooms: a tub, a toilet, a basin below a mirror, cupboards and shelves."""

from __future__ import annotations

from gibench.generators.layouts import dressing
from gibench.generators.layouts.placement import FloorPlan, required
from gibench.generators.layouts.relations import above, against_wall


def furnish(plan: FloorPlan) -> None:
    """Furnish an empty plan. Raises RejectedRoom where no tub or basin fits."""
    dressing.hang_curtains(plan, 0.2)
    piece = plan.sample("bathtub")
    # An oval tub has no wall side and stands in the room where there is space.
    free = piece.parameters["style"] == "oval" and plan.chance(0.7)
    tub = dressing.in_the_middle(plan, piece, around=0.75) if free else None
    if tub is None:
        tub = required(against_wall(plan, piece, corner=plan.chance(0.7), use=0.6), "a bathtub")
    against_wall(plan, plan.sample("toilet"), use=0.55)
    if plan.chance(0.45):
        against_wall(plan, plan.sample("shower"), corner=True, use=0.6)
    piece = plan.sample("washbasin")
    for number in range(1 + int(plan.chance(0.35))):
        basin = against_wall(plan, piece, use=0.6)
        if basin is None:
            if number == 0:
                required(None, "a washbasin")
            break
        clear = float(plan.rng.uniform(0.12, 0.25))
        mirror = above(plan, plan.sample("mirror"), basin, clear)
        if mirror is not None and plan.chance(0.6):
            dressing.wall_lamps_beside(plan, mirror, 1.6)
    if plan.chance(0.8):
        x, y = tub.point(0.0, tub.half[1] + 0.42)
        dressing.rug_under(plan, x, y, tub.yaw, width=0.95, depth=0.6, bare=True)
    furniture = {
        "shelf": 1.5,
        "dresser": 1.0,
        "bench": 0.8,
        "wardrobe": 0.5,
        "nightstand": 0.8,
        "side_table": 0.6,
    }
    dressing.fill_walls(plan, furniture, share=(0.15, 0.25))
    if plan.chance(0.6):
        against_wall(plan, plan.sample("stool"), use=0.3)
    if plan.chance(0.6):
        seat = plan.sample("ottoman" if plan.chance(0.6) else "bench")
        dressing.in_the_middle(plan, seat, around=0.7, rug=0.5)
    if plan.chance(0.3):
        dressing.reading_corner(plan)
    dressing.plants(plan, int(plan.rng.integers(1, 4)))
    if plan.chance(0.3):
        dressing.pendant_in_middle(plan)
    dressing.pictures(plan, int(plan.rng.integers(1, 3)))
    dressing.mirrors(plan, int(plan.chance(0.4)))
    dressing.dress_surfaces(plan, density=6.0)
