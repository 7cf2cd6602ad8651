"""Closed cabinets: a body with doors and drawers, which dressers, wardrobes, kitchens and the like are made
of."""

from __future__ import annotations

from collections.abc import Sequence

from gibench.generators.furniture.joinery import HANDLES, Panel, fronts, handles
from gibench.generators.parts import Mesh, Part
from gibench.generators.shapes import boxes, merge

FRONT = 0.019
"""Thickness of a door or drawer front (m)."""

Front = tuple[Panel, str]
"""A panel and how it opens: "drawer", or a door hinged on the "left" or "right", seen from the front."""

_EDGE = 0.045  # from a door's free edge to its handle (m)


def cabinet(
    extents: tuple[float, float, float, float, float, float],
    opening: Sequence[Front],
    *,
    handle: str,
    finish: str,
    front_finish: str | None = None,
    grip: float = 0.5,
    metal: str = "metal",
) -> list[Part]:
    """A body with fronts before it and handles on them.

    extents: (x0, x1, y0, y1, z0, z1) m of all together, handles included, as far as y goes. handle: of
    `HANDLES`. finish, front_finish: slots of the body and of the fronts (as the body by default). grip: how
    high up a door its handle sits (0 to 1, within a margin). The fronts cover the front of the body but for
    gaps of 3 mm.
    """
    x0, x1, y0, y1, z0, z1 = extents
    face = y1 - HANDLES[handle]
    body = boxes([x0, x1, y0, face - FRONT, z0, z1], bevel=0.0015)
    # The fronts reach 1 mm into the body, so that no gap stays behind them.
    covers = fronts([panel for panel, _ in opening], face, thickness=FRONT + 0.001)
    parts = [Part(body, finish), Part(covers, front_finish or finish, "front")]
    if handle == "none":
        return parts
    drawers: list[tuple[float, float]] = []
    doors: list[tuple[float, float]] = []
    narrowest = 1.0
    for (a, b, c, d), way in opening:
        if way == "drawer":
            drawers.append(((a + b) / 2, (c + d) / 2))
            narrowest = min(narrowest, b - a)
        else:
            # Seen from the front, left is towards +x.
            x = a + _EDGE if way == "left" else b - _EDGE
            margin = min(0.13, 0.4 * (d - c))
            doors.append((x, c + margin + grip * (d - c - 2 * margin)))
    grips: list[Mesh] = []
    if drawers:
        grips.append(handles(handle, drawers, face, length=min(0.16, 0.5 * narrowest)))
    if doors:
        grips.append(handles(handle, doors, face, upright=True))
    return [*parts, Part(merge(grips), metal)]


def door_pair(panels: Sequence[Panel]) -> list[Front]:
    """Doors side by side, hinged in turn so that neighbours open from the middle; a last odd one on its
    right."""
    ways = ["right", "left"]
    return [(panel, ways[k % 2]) for k, panel in enumerate(panels)]
