"""The objects that a Mitsuba object was made from."""

from __future__ import annotations

from functools import cache
from typing import Any

import mitsuba as mi


@cache
def _collector() -> type[Any]:
    """A class that collects the objects right below an object.

    Made once, since Mitsuba has its base only when a variant is set, the same for all. Not at every use: a class is a
    reference cycle, and what it held would die whenever Python looks for cycles. Where that is while a kernel is
    traced, the process is aborted.
    """

    class Collector(mi.TraversalCallback):
        def __init__(self) -> None:
            super().__init__()
            self.found: list[Any] = []

        def put(self, name: str, value: Any, flags: Any, cpptype: Any = None) -> None:
            if isinstance(value, mi.Object):
                self.found.append(value)

    return Collector


def children_of(thing: Any) -> list[Any]:
    """The objects right below a Mitsuba object, in its own order. Shape groups of a scene are among them."""
    collector = _collector()()
    thing.traverse(collector)
    return list(collector.found)
