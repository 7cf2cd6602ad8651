"""Plugins that gibench has none of, or decides itself: media, integrators, films."""

from __future__ import annotations

from gibench.generators.imported.changes import Note
from gibench.generators.imported.films import CROP, SIDES
from gibench.generators.imported.tree import Node
from gibench.generators.imported.upgrading.rules import become


def media(root: Node, note: Note) -> None:
    """Media and subsurface scattering are left out."""
    for node in list(root.everything()):
        for child in node.nodes():
            inside = child.tag in ("medium", "subsurface") or (
                child.tag == "ref" and child.get("name") in ("interior", "exterior")
            )
            if inside:
                node.remove(child)
                note(child, f"<{child.tag}> is left out: gibench has no media", loss=True)


def integrators(root: Node, note: Note) -> None:
    """Every integrator becomes a path tracer of the same depth."""
    for node in root.nodes("integrator"):
        for part in node.everything():
            if part.value("hide_emitters") == "true":
                note(part, "hide_emitters is left out: lamps and the environment are seen", loss=True)
        depth = next((d for part in node.everything() if (d := part.property("max_depth")) is not None), None)
        if node.type == "path":
            become(node, "path", *([depth] if depth is not None else []))
            continue
        note(node, f"integrator {node.type} is path", loss=node.type in ("direct", "ao", "depth"))
        become(node, "path", *([depth] if depth is not None else []))


def films(root: Node, note: Note) -> None:
    """Films and samplers are those of whoever renders the scene: of a film the size and the window of it stay."""
    for sensor in root.nodes("sensor"):
        for part in sensor.nodes("film", "sampler"):
            if part.tag == "sampler":
                sensor.remove(part)
                continue
            if part.type != "hdrfilm":
                note(part, f"{part.type} is hdrfilm")
            if part.property("high_quality_edges") is not None:
                note(part, "high_quality_edges is left out")
            part[:] = [p for p in map(part.property, (*SIDES, *CROP)) if p is not None]
            part.set("type", "hdrfilm")
