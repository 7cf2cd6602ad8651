"""Kitchens to eat in: counters along a wall, a table with chairs, a sideboard."""

from __future__ import annotations

import numpy as np

from gibench.generators.fixtures import splashback
from gibench.generators.layouts import dressing
from gibench.generators.layouts.placement import FloorPlan, Placed, required
from gibench.generators.layouts.relations import above, against_wall, around, beside, free_spot, on_top
from gibench.generators.layouts.solids import bounds_of

SEAT = 0.55  # floor around a table for its chairs, m
TUCK = 0.22  # how far chairs are pushed under a table, m
CUPBOARD = 0.55  # between a worktop and the cupboards above it, m


def furnish(plan: FloorPlan) -> None:
    """Furnish an empty plan. Raises RejectedRoom where neither counter nor table fits."""
    dressing.hang_curtains(plan, 0.5)
    counter = required(_counter(plan, "sink_hob"), "a kitchen counter")
    side = 1 if plan.chance(0.5) else -1
    fridge = plan.sample("fridge")
    if (
        beside(plan, fridge, counter, side, 0.015) is None
        and beside(plan, fridge, counter, -side, 0.015) is None
    ):
        against_wall(plan, fridge, corner=True, use=0.6)
    _above_worktop(plan, counter)
    if plan.chance(0.4) and (second := _counter(plan, "plain")) is not None:
        _above_worktop(plan, second)
    table = required(dining_group(plan), "a dining table")
    if plan.chance(0.5):
        _island(plan)
    sideboard = against_wall(plan, plan.sample("dresser"), use=0.5)
    if sideboard is not None:
        dressing.picture_above(plan, sideboard)
        if plan.chance(0.5):
            dressing.table_lamp_on(plan, sideboard, (-0.8, 0.0))
    dressing.fill_walls(
        plan, {"shelf": 1.5, "bench": 0.6, "bookcase": 0.5, "dresser": 0.8, "kitchen_counter": 0.8}
    )
    if plan.shell.height > 2.45 and plan.chance(0.75):
        dressing.pendant_over(plan, table, 1.55)
    if plan.chance(0.3):
        dressing.floor_lamps(plan, 1)
    dressing.plants(plan, int(plan.rng.integers(1, 3)))
    dressing.pictures(plan, int(plan.rng.integers(1, 4)))
    dressing.dress_surfaces(plan, density=4.0)


def _counter(plan: FloorPlan, style: str) -> Placed | None:
    for width in (float(plan.rng.uniform(2.4, 3.6)), 2.4, 1.8):
        piece = plan.sample("kitchen_counter", width=round(width, 4), style=style)
        counter = against_wall(plan, piece, corner=plan.chance(0.6), use=0.8, use_but=("chair",))
        if counter is not None:
            return counter
    return None


def _above_worktop(plan: FloorPlan, counter: Placed) -> None:
    """Tiles on the wall and cupboards, as wide as the counter where no window is in the way."""
    worktop = float(counter.furniture.parameters["worktop"])
    width = round(2 * counter.half[0], 4)
    base = counter.position[2] + worktop
    rise = base - counter.top
    # What the worktop leaves of the wall: tiles at least as high as a hand, up to the cupboards.
    for height in (CUPBOARD, 0.15):
        if above(plan, splashback(width=width, height=height - 0.01), counter, rise + 0.002) is not None:
            break
    for share in (1.0, 0.66, 0.5):
        cupboard = plan.sample("wall_cupboard", width=round(float(np.clip(share * width, 0.4, 3.6)), 4))
        if above(plan, cupboard, counter, rise + CUPBOARD) is not None:
            break


def _island(plan: FloorPlan) -> None:
    """A counter in open floor with stools along its back."""
    width = round(float(plan.rng.uniform(1.2, 1.9)), 4)
    style = "sink" if plan.chance(0.4) else "plain"
    island = dressing.in_the_middle(
        plan, plan.sample("kitchen_counter", width=width, style=style), around=0.85
    )
    if island is None:
        return
    stool = plan.sample("stool", height=0.66)
    half = float(bounds_of(stool)[1, 1])
    for x in np.arange(-width / 2 + 0.3, width / 2 - 0.2, 0.55):
        at = island.point(float(x), -island.half[1] - half - float(plan.rng.uniform(0.02, 0.2)))
        plan.put(stool, at, island.yaw)


def dining_group(plan: FloorPlan) -> Placed | None:
    """A table in free space with chairs around it, perhaps on a rug."""
    for width in (2.2, 1.5, 1.2, 1.0):
        piece = plan.sample("dining_table")
        if bounds_of(piece)[1, 0] * 2 > width:
            piece = plan.sample("dining_table", width=width)
        spot = free_spot(plan, piece, around=SEAT, tries=24)
        if spot is None:
            continue
        (x, y), yaw = spot
        half_x, half_y = (float(v) for v in bounds_of(piece)[1, :2])
        if plan.chance(0.5):
            dressing.rug_under(plan, x, y, yaw, width=2 * half_x + 1.3, depth=2 * half_y + 1.3)
        table = plan.put(piece, (x, y), yaw)
        if table is None:
            continue
        chair = plan.sample("chair")
        seats = 2 * max(1, int(2 * half_x / 0.62)) + 2 * int(plan.chance(0.5))
        around(plan, [chair] * min(8, seats), table, tuck=TUCK, ends=seats > 4)
        on_top(plan, plan.sample("bowl" if plan.chance(0.5) else "vase"), table, at=(0.0, 0.0))
        return table
    return None
