"""Runs of kitchen base cabinets under one worktop, with a sink and tap, a hob over an oven, or both."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.cabinets import Front, cabinet, door_pair
from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import EMBED, HANDLES, grid_panels, handles
from gibench.generators.furniture.taps import tap
from gibench.generators.parts import Furniture, Part, Support
from gibench.generators.shapes import boxes, cylinder, extrude, loft, rectangle, rounded_rectangle

SIZES = {
    "width": Size(2.40, 0.45, 5.50, 0.2),
    "depth": Size(0.62, 0.56, 0.70, 0.03),
    "worktop": Size(0.91, 0.86, 0.95, 0.015),
}
CHOICES = {
    "style": ("plain", "sink", "hob", "sink_hob"),
    "finish": ("wood", "lacquer", "lacquer"),
    "top": ("stone", "stone", "wood"),
    "handle": tuple(HANDLES),
}
_MODULE = 0.6  # the usual width of kitchen cabinets (m)
_NEEDED = {"plain": 1, "sink": 1, "hob": 1, "sink_hob": 3}
_PLINTH = 0.1


def kitchen_counter(
    *, width: float, depth: float, worktop: float, style: str, finish: str, top: str, handle: str
) -> Furniture:
    """A run of base cabinets `width` m long, with its worktop `worktop` m above the floor; a tap stands
    higher.

    style: what is let into it (sink_hob needs 1.5 m, sink and hob 0.55 m; a narrower run stays plain).
    finish, top: slots of the fronts and of the worktop. Raises FurnitureError for a size out of SIZES or an
    option out of CHOICES.
    """
    parameters = checked("kitchen_counter", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    modules = max(1, round(width / _MODULE))
    edges = np.linspace(-w + 0.004, w - 0.004, modules + 1)
    sink, hob = _places(style, modules, width)
    thick = 0.038
    under = worktop - thick
    face = d - 0.03  # the worktop reaches as far as the handles
    front = face + HANDLES[handle]
    parts: list[Part] = []
    supports = []
    holes = []
    for k in range(modules):
        x0, x1 = float(edges[k]), float(edges[k + 1])
        middle = (x0 + x1) / 2
        if k == hob:
            parts += _oven(x0, x1, -d + 0.03, face, under, finish)
            plate = [middle - 0.275, middle + 0.275, -0.25, 0.24, worktop - 0.002, worktop + 0.006]
            plate[0], plate[1] = max(plate[0], x0 + 0.01), min(plate[1], x1 - 0.01)
            parts.append(Part(boxes(plate, bevel=0.002), "screen", "hob"))
            continue
        opening = _fronts(x0, x1, under, k, sink == k)
        body_top = worktop - 0.24 if k == sink else under + EMBED
        extents = (x0 + 0.0006, x1 - 0.0006, -d + 0.03, front, _PLINTH, body_top)
        parts += cabinet(extents, opening, handle=handle, finish=finish, grip=1.0)
        if k == sink:
            hole_x = min(0.25, (x1 - x0) / 2 - 0.04)
            holes.append(rounded_rectangle(middle - hole_x, middle + hole_x, -0.2, 0.17, 0.04))
            parts += _sink(middle, hole_x, worktop)
            side = [
                [a, a + 0.016, -d + 0.0315, face - 0.021, body_top - 0.01, under + EMBED]
                for a in (x0 + 0.002, x1 - 0.018)
            ]
            side.append([x0 + 0.01, x1 - 0.01, -d + 0.034, -d + 0.045, body_top - 0.012, under + EMBED / 2])
            parts.append(Part(boxes(side, bevel=0.001), finish))
        else:
            supports.append(Support(x0 + 0.03, x1 - 0.03, -d + 0.05, d - 0.1, worktop, 0.45))
    slab = extrude(rectangle(-w, w, -d, d), under, worktop, holes=tuple(holes), bevel=0.003)
    parts.append(Part(slab, top, "worktop"))
    plinth = [-w + 0.006, w - 0.006, -d + 0.04, d - 0.1, 0, _PLINTH + EMBED]
    parts.append(Part(boxes(plinth, bevel=0.001), finish, "plinth"))
    return Furniture("kitchen_counter", parameters, tuple(parts), tuple(supports))


def _places(style: str, modules: int, width: float) -> tuple[int, int]:
    """The modules that hold the sink and the hob, -1 for none."""
    if width / modules < 0.52 or modules < _NEEDED[style]:
        return -1, -1
    if style == "sink_hob":
        return modules // 4, modules - 1 - modules // 4
    return {"plain": (-1, -1), "sink": (modules // 2, -1), "hob": (-1, modules // 2)}[style]


def _fronts(x0: float, x1: float, under: float, number: int, sink: bool) -> list[Front]:
    top = under - 0.004
    if sink:
        return door_pair(grid_panels(x0, x1, _PLINTH, top, 2, 1))
    if number % 3 == 0:
        return [(p, "drawer") for p in grid_panels(x0, x1, _PLINTH, top, 1, (1.6, 1.6, 1.0))]
    split = top - 0.16
    door = grid_panels(x0, x1, _PLINTH, split, 1, 1)[0]
    drawer = grid_panels(x0, x1, split, top, 1, 1)[0]
    return [(door, "left" if number % 2 else "right"), (drawer, "drawer")]


def _oven(x0: float, x1: float, back: float, face: float, under: float, finish: str) -> list[Part]:
    body = [x0 + 0.001, x1 - 0.001, back, face - 0.02, _PLINTH, under + EMBED]
    low, high = under - 0.6, under - 0.006
    drawer = [x0 + 0.0015, x1 - 0.0015, face - 0.021, face, _PLINTH + 0.002, low - 0.003]
    panel = [x0 + 0.003, x1 - 0.003, face - 0.021, face, high - 0.1, high]
    glass = [x0 + 0.003, x1 - 0.003, face - 0.0215, face - 0.001, low, high - 0.104]
    middle = (x0 + x1) / 2
    bar = handles("bar", [(middle, high - 0.15)], face - 0.002, length=0.75 * (x1 - x0))
    knobs = handles("knob", [(middle + k * 0.09, high - 0.05) for k in (-2, -1, 1, 2)], face - 0.001)
    return [
        Part(boxes(body, bevel=0.0015), finish),
        Part(boxes(drawer, bevel=0.0015), finish, "front"),
        Part(boxes(panel, bevel=0.0015), "metal", "oven"),
        Part(boxes(glass, bevel=0.002), "screen", "oven"),
        Part(bar, "metal", "oven"),
        Part(knobs, "metal", "oven"),
    ]


def _sink(x: float, half: float, worktop: float) -> list[Part]:
    middle, half_y = -0.015, 0.185
    outline = rounded_rectangle(-half, half, -half_y, half_y, 0.04)
    steel = 0.0035
    rows = []
    for inset, z in (
        (1.0, -0.19),
        (0.045, -0.19),
        (0.02, -0.17),
        (steel, -0.01),
        (steel, 0.0005),
        (-0.014, 0.0005),
        (-0.014, 0.0025),
        (steel + 0.004, 0.003),
        (steel + 0.008, -0.006),
        (0.026, -0.165),
        (0.05, -0.183),
        (1.0, -0.186),
    ):
        scale = (0.0, 0.0) if inset == 1.0 else ((half - inset) / half, (half_y - inset) / half_y)
        rows.append([*scale, x, middle, worktop + z])
    drain = cylinder(0.035, worktop - 0.187, worktop - 0.183, bevel=0.001, centre=(x, middle))
    spout = tap(0.3, 0.17, at=(x, -0.245, worktop), gooseneck=True)
    return [Part(loft(outline, rows), "metal", "sink"), Part(drain, "chrome"), Part(spout, "chrome")]


def sample_kitchen_counter(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A kitchen counter with the parameters that are not fixed drawn at random."""
    return kitchen_counter(**(draw(rng, SIZES, CHOICES) | fixed))
