"""The plugins that Mitsuba ships, so that an unknown one is named with its place before anything is loaded."""

from __future__ import annotations

import difflib
import importlib.metadata
from functools import cache
from pathlib import Path

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.tree import PLUGINS, Node

OURS = ("sensor", "film", "sampler", "rfilter", "integrator")
"""Plugins that never reach Mitsuba: gibench has its own, and cameras that it cannot use are left out."""


LATER = ("heightfield", "hair")
"""Shapes of Mitsuba 0.x that become others once their files are read (`old_shapes`)."""


@cache
def shipped() -> frozenset[str]:
    """Names of all plugins, whatever they are for. Mitsuba itself is not loaded."""
    files = importlib.metadata.files("mitsuba") or []
    return frozenset(Path(file).stem.removeprefix("lib") for file in files if "plugins" in file.parts)


def check_plugins(root: Node) -> None:
    """Raises SceneFileError for the first plugin that Mitsuba does not have."""
    for node in root.everything():
        if node.tag in OURS or (node.legacy and node.tag == "shape" and node.type in LATER):
            continue
        if node.tag in PLUGINS and node.get("type") is not None and node.type not in shipped():
            near = difflib.get_close_matches(node.type, shipped(), n=3)
            hint = f"did you mean {' or '.join(near)}?" if near else "it has no counterpart in Mitsuba 3"
            raise SceneFileError(f"{node.where}: there is no {node.tag} '{node.type}': {hint}")
        if node.tag in PLUGINS - {"spectrum"} and not node.type:
            raise SceneFileError(f"{node.where}: <{node.tag}> has no type")
