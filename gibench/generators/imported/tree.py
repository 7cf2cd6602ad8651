"""Elements of scene files, which know where they stand and which Mitsuba they were written for."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree.ElementTree import Element

PLUGINS = frozenset(
    {"bsdf", "emitter", "film", "integrator", "medium", "phase", "rfilter", "sampler", "sensor", "shape"}
) | {"spectrum", "subsurface", "texture", "volume"}
"""Tags of elements that are plugins; their type names which."""


class Node(Element):
    """An element that knows where it stands. where: "scene.xml:12". legacy: whether its file is one of Mitsuba 0.x."""

    where = ""
    legacy = False

    @property
    def type(self) -> str:
        """Name of the plugin, empty where the element is none."""
        return self.get("type", "")

    def property(self, *names: str) -> Node | None:
        """The first child of one of these names."""
        return next((child for child in self.nodes() if child.get("name") in names), None)

    def value(self, name: str, default: str = "") -> str:
        """The value of the child of that name."""
        child = self.property(name)
        return default if child is None else child.get("value", default)

    def nodes(self, *tags: str) -> list[Node]:
        """Children with one of these tags, or all of them."""
        return [child for child in self if isinstance(child, Node) and (not tags or child.tag in tags)]

    def everything(self) -> Iterator[Node]:
        """This element and all below it, in the order of the file."""
        return (node for node in self.iter() if isinstance(node, Node))


def new(tag: str, like: Node, **attributes: str) -> Node:
    """An element that stands in the file where another does."""
    node = Node(tag, attributes)
    node.where, node.legacy = like.where, like.legacy
    return node


def copied(node: Node) -> Node:
    """A copy of an element and all below it."""
    copy = new(node.tag, node, **node.attrib)
    copy[:] = [copied(child) for child in node.nodes()]
    return copy


def wrapped(node: Node, inner: Node) -> None:
    """Make a material one that is as another, under its own id and name.

    It is a blend of the other with itself: a mask of opacity one would be transparent to Mitsuba, and could not stand
    in a `twosided`.
    """
    again = new("ref", inner, id=inner.get("id", "")) if inner.get("id") else copied(inner)
    for part in again.everything():
        if part.tag != "ref":
            part.attrib.pop("id", None)
    node.set("type", "blendbsdf")
    node[:] = [new("float", node, name="weight", value="0"), inner, again]


def parents_of(root: Node) -> dict[int, Node]:
    """The parent of each element, by the id() of the element."""
    return {id(child): node for node in root.everything() for child in node}


def replaced(parent: Node, child: Node, by: Node | None) -> None:
    """Put an element, or nothing, in the place of a child."""
    at = list(parent).index(child)
    parent[at : at + 1] = [] if by is None else [by]
