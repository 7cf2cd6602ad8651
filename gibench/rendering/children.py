"""What a Mitsuba object was made from."""

from __future__ import annotations

from typing import Any

import mitsuba as mi


class _Children(mi.TraversalCallback):
    """Collects the objects right below an object.

    Not defined where it is used: a class is a reference cycle, and what it held would die whenever Python looks for
    cycles. Where that is while a kernel is traced, the process is aborted.
    """

    def __init__(self) -> None:
        """Nothing is found yet."""
        super().__init__()
        self.found: list[Any] = []

    def put(self, name: str, value: Any, flags: Any, cpptype: Any = None) -> None:
        """Called by Mitsuba for each thing that an object is made of."""
        if isinstance(value, mi.Object):
            self.found.append(value)


def children_of(thing: Any) -> list[Any]:
    """The objects right below a Mitsuba object, in its own order. Shape groups of a scene are among them."""
    collector = _Children()
    thing.traverse(collector)
    return collector.found
