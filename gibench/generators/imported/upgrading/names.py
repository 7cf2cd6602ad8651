"""Names, transformations and settings that are called otherwise today, or that are gone."""

from __future__ import annotations

import re

import numpy as np

from gibench.generators.imported.changes import Note
from gibench.generators.imported.transforms import triple
from gibench.generators.imported.tree import Node
from gibench.generators.imported.upgrading.rules import number, old


def property_names(root: Node, note: Note) -> None:
    """camelCase names of properties become snake_case; the diffuseReflectance of `diffuse` is its reflectance."""
    for parent in old(root):
        for node in parent.nodes():
            name = node.get("name")
            # The name of a material inside a mesh is that of a group in its file.
            if name is None or name == name.lower() or node.tag in ("default", "bsdf"):
                continue
            if parent.tag == "shape" and node.tag == "ref":
                continue
            # IOR first, or its letters would be parted.
            better = re.sub(r"(?<=[a-z0-9])([A-Z])", r"_\1", name.replace("IOR", "Ior")).lower()
            if parent.type == "diffuse" and better == "diffuse_reflectance":
                better = "reflectance"
            node.set("name", better)
            note(node, f"{name} is {better}")


def transform_tags(root: Node, note: Note) -> None:
    """`<lookAt>` becomes `<lookat>`."""
    for node in old(root):
        if node.tag == "lookAt":
            node.tag = "lookat"
            note(node, "<lookAt> is <lookat>")


def rotation_axes(root: Node, note: Note) -> None:
    """Axes of rotations become unit vectors, which they were taken for."""
    for node in old(root):
        if node.tag != "rotate":
            continue
        axis = triple(node, 0.0)
        length = float(np.linalg.norm(axis))
        if length > 0 and abs(length - 1) > 1e-6:
            node.attrib.pop("value", None)
            node.attrib.update(zip("xyz", map(repr, (axis / length).tolist()), strict=True))
            note(node, "the axis of a rotation is a unit vector")


def empty_rotations(root: Node, note: Note) -> None:
    """A rotation about no axis, which exporters write for none, is left out; Mitsuba 3 refuses it."""
    for transform in list(root.everything()):
        for node in transform.nodes("rotate"):
            if np.any(triple(node, 0.0)):
                continue
            angle = number(node, node.get("angle", "0"))
            transform.remove(node)
            note(node, f"a rotation by {angle:g} degrees about no axis is left out", loss=angle != 0)


def animations(root: Node, note: Note) -> None:
    """Of an `<animation>` the first transformation stays: nothing moves here."""
    for node in old(root):
        if node.tag == "animation":
            first = node.nodes("transform")[:1]
            name = node.get("name", "to_world")
            node.tag = "transform"
            node.attrib = {"name": name}
            node[:] = list(first[0]) if first else []
            note(node, "an animation stands still at its first transformation", loss=True)


GONE = ("max_smooth_angle", "srgb", "collapse", "fast_fresnel", "kd_intersection_cost", "kd_traversal_cost")
"""Settings without a counterpart: of smoothing meshes, of speed."""


def gone_settings(root: Node, note: Note) -> None:
    """Settings of shapes and materials that Mitsuba 3 does not know are left out."""
    for node in old(root):
        for child in node.nodes("float", "integer", "boolean", "string"):
            if node.tag in ("shape", "bsdf") and child.get("name") in GONE:
                node.remove(child)
                note(child, f"{child.get('name')} is left out", loss=child.get("name") == "max_smooth_angle")
