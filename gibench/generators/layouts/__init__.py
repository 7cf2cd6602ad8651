"""Furnishing rules, one file a room kind: a new kind is a new file with `furnish(plan)` and a line here."""

from __future__ import annotations

from collections.abc import Callable

from gibench.generators.layouts import bathroom, bedroom, dining_kitchen, living, office
from gibench.generators.layouts.placement import FloorPlan

__all__ = ["FURNISH"]

FURNISH: dict[str, Callable[[FloorPlan], None]] = {
    "living": living.furnish,
    "bedroom": bedroom.furnish,
    "dining-kitchen": dining_kitchen.furnish,
    "office": office.furnish,
    "bathroom": bathroom.furnish,
}
