"""Shapes made fit for every method: each with a name of its own, none of them an instance."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.reading import Node, copied, new
from gibench.generators.imported.transforms import matrix_of
from gibench.generators.imported.upgrading.rules import Note


def expand_instances(root: Node, note: Note) -> None:
    """Every instance becomes copies of the shapes of its group, since lightmaps need a place for each.

    Raises SceneFileError for an instance of no group.
    """
    groups = {node.get("id", ""): node for node in root.nodes("shape") if node.type == "shapegroup"}
    for node in root.nodes("shape"):
        if node.type != "instance":
            continue
        inside = next((c for c in node.nodes("shape") if c.type == "shapegroup"), None)
        ref = next(iter(node.nodes("ref")), None)
        group = inside if inside is not None else groups.get(ref.get("id", "") if ref is not None else "")
        if group is None:
            raise SceneFileError(f"{node.where}: the instance refers to no shapegroup")
        at = list(root).index(node)
        root.remove(node)
        placed = matrix_of(node.property("to_world"))
        for number, shape in enumerate(group.nodes("shape")):
            copy = copied(shape)
            copy.attrib.pop("id", None)
            transform = copy.property("to_world")
            if transform is None:
                transform = new("transform", copy, name="to_world")
                copy.append(transform)
            transform.append(new("matrix", node, value=" ".join(f"{v:.17g}" for v in placed.ravel())))
            root.insert(at + number, copy)
        note(node, f"an instance is a copy of '{group.get('id', 'its group')}'")
    for group in groups.values():
        root.remove(group)


def name_everything(root: Node) -> None:
    """Give every shape and material an id, so that they stand in the same order in every run and channel."""
    taken = {node.get("id") for node in root.everything() if node.get("id") and node.tag != "ref"}
    counts: Counter[str] = Counter()

    def fresh(stem: str) -> str:
        while True:
            counts[stem] += 1
            name = stem if counts[stem] == 1 else f"{stem}.{counts[stem]}"
            if name not in taken:
                taken.add(name)
                return name

    for shape in root.nodes("shape"):
        if not shape.get("id"):
            file = shape.value("filename").replace("\\", "/")
            shape.set("id", fresh(Path(file).stem if file else shape.type))
        for bsdf in shape.nodes("bsdf"):
            if not bsdf.get("id"):
                bsdf.set("id", fresh(f"{shape.get('id')}.material"))
    for bsdf in root.nodes("bsdf"):
        if not bsdf.get("id"):
            bsdf.set("id", fresh(bsdf.type))


def check_references(root: Node) -> None:
    """Raises SceneFileError for a reference to what is not there."""
    known = {node.get("id") for node in root.everything() if node.tag != "ref"}
    for node in root.everything():
        if node.tag == "ref" and node.get("id") not in known:
            raise SceneFileError(f"{node.where}: nothing has the id '{node.get('id')}' that <ref> asks for")
