"""Meshes turned round in their files rather than by a flag.

Mitsuba merges meshes of one material when it loads a scene, and refuses to where they differ in `flip_normals`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gibench.generators.imported.files import destinations
from gibench.generators.imported.reading import Node, copied, new
from gibench.generators.imported.scene import ImportedScene
from gibench.generators.parts import Mesh
from gibench.generators.scene_files import ply_bytes


def without_flips(scene: ImportedScene) -> ImportedScene:
    """The scene without a mesh whose normals are flipped; it looks the same."""
    flipped = [node.get("id", "") for node in scene.tree.root.nodes("shape") if _is_flipped(node)]
    return _baked(scene, flipped, turn=False) if flipped else scene


def with_meshes_turned(scene: ImportedScene, names: Sequence[str]) -> ImportedScene:
    """The scene with these shapes turned round."""
    return _baked(scene, names, turn=True)


def _is_flipped(node: Node) -> bool:
    return node.value("flip_normals") == "true"


def _baked(scene: ImportedScene, names: Sequence[str], *, turn: bool) -> ImportedScene:
    root, made = copied(scene.tree.root), dict(scene.tree.made)
    nodes = {node.get("id", ""): node for node in root.nodes("shape")}
    shapes = {shape.id(): shape for shape in scene.loaded.mi_scene.shapes()}
    for name in names:
        node, shape = nodes[name], shapes[name]
        flipped = _is_flipped(node) != turn
        for gone in [part for part in node.nodes() if part.get("name") == "flip_normals"]:
            node.remove(gone)
        if not shape.is_mesh():  # which is never merged
            if flipped:
                node.append(new("boolean", node, name="flip_normals", value="true"))
            continue
        file = f"{re.sub(r'[^A-Za-z0-9_.-]', '_', name)}.turned.ply"
        made[file] = ply_bytes(_mesh(shape, flipped))
        # What is left of it: its materials, its light, and whether its faces are flat.
        kept = [part for part in node.nodes() if part.tag in ("ref", "bsdf", "emitter")]
        flat = node.property("face_normals")
        node[:] = [
            new("string", node, name="filename", value=file),
            *([flat] if flat is not None else []),
            *kept,
        ]
        node.set("type", "ply")
    tree = replace(scene.tree, root=root, made=made)
    return replace(scene, tree=tree, files=destinations(tree))


def _mesh(shape: Any, flipped: bool) -> Mesh:
    """A loaded mesh in world space with the faces of its file, or with these reversed."""

    def buffer(values: Any, width: int) -> Any:
        return np.array(values, dtype=np.float64).reshape(-1, width)

    vertices = buffer(shape.vertex_positions_buffer(), 3)
    faces = np.array(shape.faces_buffer(), dtype=np.int32).reshape(-1, 3)
    faces = faces[:, ::-1] if flipped else faces
    uvs = buffer(shape.vertex_texcoords_buffer(), 2) if shape.has_vertex_texcoords() else np.zeros((0, 2))
    if not shape.has_vertex_normals():
        return Mesh(vertices, faces, np.zeros((0, 3)), uvs)
    normals = buffer(shape.vertex_normals_buffer(), 3)
    corners = vertices[faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # Whichever way the flag has turned them: they lie on the side of the faces.
    side = np.einsum("fc,fkc->", outward, normals[faces])
    return Mesh(vertices, faces, normals if side >= 0 else -normals, uvs)
