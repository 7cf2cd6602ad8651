"""Numbers that no image comes of, and that Mitsuba takes in silence: not a number, infinite, light below zero."""

from __future__ import annotations

import math
import re

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.shipped import OURS
from gibench.generators.imported.tree import Node

NUMBERS = ("float", "rgb", "spectrum", "point", "vector", "matrix", "translate", "scale", "rotate", "lookat")
"""Tags of elements that hold numbers."""

LIGHT = ("radiance", "intensity", "irradiance", "scale")
"""Properties of emitters that light is proportional to."""


def check_numbers(root: Node) -> None:
    """Raises SceneFileError, with the place in the scene, for the first number that is not finite or is dark light."""
    for node in root.nodes():
        if node.tag not in OURS:
            _check(node, None)


def _check(node: Node, parent: Node | None) -> None:
    if node.tag in NUMBERS:
        is_light = parent is not None and parent.tag == "emitter" and node.get("name") in LIGHT
        for key, text in node.attrib.items():
            if key in ("name", "id", "type", "filename"):
                continue
            for word in re.split(r"[\s,:]+", text.strip()):
                _check_word(node, word, is_light=is_light)
    for child in node.nodes():
        _check(child, node)


def _check_word(node: Node, word: str, *, is_light: bool) -> None:
    try:
        value = float(word)
    except ValueError:
        return  # whoever reads it says what it should be
    if not math.isfinite(value):
        raise SceneFileError(f"{node.where}: '{word}' is no finite number: give one that is")
    if is_light and value < 0:
        raise SceneFileError(f"{node.where}: a {node.get('name')} of {word}: light is not negative")
