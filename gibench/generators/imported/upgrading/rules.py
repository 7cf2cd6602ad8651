"""Rules, and the helpers that they are written with."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator

from gibench.generators.imported.changes import Note
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.tree import Node, new

Rule = Callable[[Node, Note], None]
"""Rewrites the tree below a `<scene>` in place."""


def plugins(root: Node, tag: str, *types: str) -> list[Node]:
    """All plugins of a tag in files of Mitsuba 0.x, or those of some types."""
    return [n for n in old(root) if n.tag == tag and (not types or n.type in types)]


def old(root: Node) -> Iterator[Node]:
    """The elements that stand in files of Mitsuba 0.x: one file may include one of another version."""
    return (node for node in root.everything() if node.legacy)


def become(node: Node, type: str, *children: Node) -> None:
    """Make a plugin another one with these children alone; it keeps its id and name."""
    node.set("type", type)
    node[:] = children


def setting(like: Node, tag: str, name: str, value: object) -> Node:
    """A property, such as `<float name=… value=…/>`."""
    return new(tag, like, name=name, value=str(value))


def number(node: Node, text: str) -> float:
    """The finite number that a text is. Raises SceneFileError."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SceneFileError(f"{node.where}: '{text}' is no number")
    return value


def constant_color(node: Node | None, default: float) -> tuple[float, float, float] | None:
    """A constant colour; None for a texture."""
    if node is None:
        return default, default, default
    words = re.split(r"[\s,]+", node.get("value", "").strip())
    if node.tag not in ("rgb", "float", "spectrum") or len(words) not in (1, 3) or ":" in words[0]:
        return None
    numbers = [number(node, word) for word in words]
    return (numbers[0], numbers[0], numbers[0]) if len(numbers) == 1 else (numbers[0], numbers[1], numbers[2])


def rgb(like: Node, name: str, color: tuple[float, ...]) -> Node:
    """A linear colour as a property."""
    return new("rgb", like, name=name, value=" ".join(repr(round(c, 9)) for c in color))
