"""Shapes made fit for every method: each with a name of its own, none of them an instance."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from gibench.generators.imported.changes import Note
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.transforms import matrix_of
from gibench.generators.imported.tree import Node, copied, new, parents_of, replaced

MOST_SHAPES = 100_000
"""In a scene, with the copies that instances stand for: a few kilobytes of instances of groups can ask for millions."""


def expand_instances(root: Node, note: Note) -> None:
    """Every instance becomes copies of the shapes of its group, since lightmaps need a place for each.

    Raises SceneFileError for an instance of no group, and for more than MOST_SHAPES shapes.
    """
    for node in [node for node in root.everything() if node.type == "merge" and node.tag == "shape"]:
        # It makes one mesh of many, which is no one's concern but Mitsuba's.
        parent = parents_of(root)[id(node)]
        at = list(parent).index(node)
        parent[at : at + 1] = node.nodes("shape")
        note(node, "the shapes of a merge stand beside the others")
    groups = {node.get("id", ""): node for node in root.nodes("shape") if node.type == "shapegroup"}
    instances = [node for node in root.nodes("shape") if node.type == "instance"]
    group_of = {id(node): _group(node, groups) for node in instances}
    sizes = {key: len(group.nodes("shape")) for key, group in {id(g): g for g in group_of.values()}.items()}
    count = len(root.nodes("shape")) + sum(sizes[id(group_of[id(node)])] for node in instances)
    if count > MOST_SHAPES:
        raise SceneFileError(
            f"{instances[0].where}: with {len(instances)} instances the scene has {count} shapes; more than "
            f"{MOST_SHAPES} are not read: leave some out"
        )
    for group in {id(g): g for g in (*groups.values(), *group_of.values())}.values():
        _lift_materials(root, group)
    children: list[Node] = []
    for node in root.nodes():
        if node.tag != "shape" or node.type != "instance":
            if node.type != "shapegroup":
                children.append(node)
            continue
        placed = matrix_of(node.property("to_world"))
        for shape in group_of[id(node)].nodes("shape"):
            copy = copied(shape)
            copy.attrib.pop("id", None)
            transform = copy.property("to_world")
            if transform is None:
                transform = new("transform", copy, name="to_world")
                copy.append(transform)
            transform.append(new("matrix", node, value=" ".join(f"{v:.17g}" for v in placed.ravel())))
            children.append(copy)
        note(node, f"an instance is a copy of '{group_of[id(node)].get('id', 'its group')}'")
    root[:] = children


def _group(node: Node, groups: dict[str, Node]) -> Node:
    inside = next((c for c in node.nodes("shape") if c.type == "shapegroup"), None)
    ref = next((ref for ref in node.nodes("ref") if ref.get("id", "") in groups), None)
    group = inside if inside is not None else groups.get(ref.get("id", "") if ref is not None else "")
    if group is None:
        raise SceneFileError(f"{node.where}: the instance refers to no shapegroup")
    return group


def _lift_materials(root: Node, group: Node) -> None:
    """Put materials with an id, or with one inside, beside the shapes: a copy of them would have the same id."""
    for shape in group.nodes("shape"):
        for bsdf in shape.nodes("bsdf"):
            if not any(part.get("id") for part in bsdf.everything() if part.tag != "ref"):
                continue
            if not bsdf.get("id"):
                inner = next(
                    part.get("id") for part in bsdf.everything() if part.tag != "ref" and part.get("id")
                )
                bsdf.set("id", f"{inner}.material")
            replaced(shape, bsdf, new("ref", bsdf, id=bsdf.get("id", "")))
            bsdf.attrib.pop("name", None)
            root.insert(0, bsdf)
        for part in shape.everything():
            if part is not shape and part.tag != "ref":
                part.attrib.pop("id", None)


def share_emitters(root: Node, note: Note) -> None:
    """An area light that stands beside the shapes, and that they refer to, goes into each of them."""
    lights = {node.get("id", ""): node for node in root.nodes("emitter") if node.type == "area"}
    for shape in [node for node in root.everything() if node.tag == "shape"]:
        for ref in shape.nodes("ref"):
            light = lights.get(ref.get("id", ""))
            if light is not None:
                copy = copied(light)
                copy.attrib.pop("id", None)
                replaced(shape, ref, copy)
                note(ref, f"the light '{light.get('id')}' is one of the shape's own")
    for node in lights.values():
        root.remove(node)


def resolve_aliases(root: Node, note: Note) -> None:
    """`<alias id="wall" as="plaster"/>` makes plaster a name of wall: references to it become those to wall.

    Raises SceneFileError for an alias of what is not there, and for a name that is taken.
    """
    known = {
        node.get("id") for node in root.everything() if node.tag not in ("ref", "alias") and node.get("id")
    }
    names: dict[str, str] = {}
    for parent in list(root.everything()):
        for node in parent.nodes("alias"):
            parent.remove(node)
            target, name = node.get("id", ""), node.get("as", "")
            target = names.get(target, target)
            if target not in known or not name:
                raise SceneFileError(
                    f"{node.where}: nothing has the id '{target}' that <alias> gives another name"
                )
            if name in known or name in names:
                raise SceneFileError(
                    f"{node.where}: the id '{name}' that <alias> gives is taken: choose another"
                )
            names[name] = target
            note(node, f"'{name}' is '{target}'")
    for node in root.everything():
        if node.tag == "ref" and node.get("id", "") in names:
            node.set("id", names[node.get("id", "")])


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
    """Raises SceneFileError for an id that is given twice, and a reference to what is not there or goes in a circle."""
    known: dict[str, Node] = {}
    for node in root.everything():
        name = node.get("id")
        if node.tag in ("ref", "alias") or not name:
            continue
        if name in known:
            raise SceneFileError(
                f"{node.where}: the id '{name}' is taken by {known[name].where}: give one of them another"
            )
        known[name] = node
    for node in root.everything():
        if node.tag == "ref" and node.get("id") not in known:
            raise SceneFileError(f"{node.where}: nothing has the id '{node.get('id')}' that <ref> asks for")
    for node in root.everything():
        for ref in node.nodes("ref"):
            if known[ref.get("id", "")].type == "shapegroup" and node.type != "instance":
                raise SceneFileError(
                    f"{ref.where}: a {node.type or node.tag} refers to a shapegroup, which an instance alone may: make "
                    'it <shape type="instance">'
                )
    done: set[str] = set()
    for name in known:
        _check_circle(known, name, done)


def _check_circle(known: dict[str, Node], name: str, done: set[str]) -> None:
    way: list[tuple[str, list[str]]] = [(name, _asked(known[name]))] if name not in done else []
    while way:
        current, left = way[-1]
        if not left:
            done.add(current)
            way.pop()
            continue
        following = left.pop()
        if any(following == passed for passed, _ in way):
            raise SceneFileError(
                f"{known[following].where}: '{following}' refers to itself, by way of others or not"
            )
        if following not in done:
            way.append((following, _asked(known[following])))


def _asked(node: Node) -> list[str]:
    return [part.get("id", "") for part in node.everything() if part.tag == "ref"]
