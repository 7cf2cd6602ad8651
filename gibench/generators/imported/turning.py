"""Meshes written anew: turned round in their files rather than by a flag, or without some of their faces.

Mitsuba merges meshes of one material when it loads a scene, and refuses to where they differ in `flip_normals`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.generators.imported.files import destinations
from gibench.generators.imported.scene import ImportedScene
from gibench.generators.imported.tree import Node, copied, new
from gibench.generators.opened import without_faces
from gibench.generators.parts import FloatArray, Mesh
from gibench.generators.scene_files import ply_bytes


def without_flips(scene: ImportedScene) -> ImportedScene:
    """The scene without a mesh whose normals are flipped; it looks the same."""
    flipped = [node.get("id", "") for node in scene.tree.root.nodes("shape") if _is_flipped(node)]
    return _baked(scene, dict.fromkeys(flipped, np.zeros(1, dtype=bool))) if flipped else scene


def with_meshes_turned(scene: ImportedScene, turned: Mapping[str, NDArray[np.bool_]]) -> ImportedScene:
    """The scene with faces of shapes turned round.

    turned: by shape id, (faces,) which of them; (1,) for all or none, as of shapes that are no meshes.
    """
    return _baked(scene, turned)


def with_faces_removed(scene: ImportedScene, gone: Mapping[str, NDArray[np.bool_]]) -> ImportedScene:
    """The scene without faces of shapes; a shape without any left is gone.

    gone: by shape id, (faces,) which of them; (1,) for a shape that is no mesh.
    """
    return _baked(scene, {name: np.zeros(1, dtype=bool) for name in gone}, gone)


def _is_flipped(node: Node) -> bool:
    return node.value("flip_normals") == "true"


def _baked(
    scene: ImportedScene,
    turned: Mapping[str, NDArray[np.bool_]],
    removed: Mapping[str, NDArray[np.bool_]] | None = None,
) -> ImportedScene:
    root = copied(scene.tree.root)
    tree = replace(scene.tree, root=root, made=dict(scene.tree.made))
    nodes = {node.get("id", ""): node for node in root.nodes("shape")}
    shapes = {shape.id(): shape for shape in scene.loaded.mi_scene.shapes()}
    for name, faces in turned.items():
        node, shape = nodes[name], shapes[name]
        without = (removed or {}).get(name, np.zeros(1, dtype=bool))
        if without.all():
            root.remove(node)
            continue
        flipped = faces != _is_flipped(node)
        for gone in [part for part in node.nodes() if part.get("name") == "flip_normals"]:
            node.remove(gone)
        if not shape.is_mesh():  # which is never merged
            if flipped.all():
                node.append(new("boolean", node, name="flip_normals", value="true"))
            continue
        mesh, rows = _mesh(shape, flipped)
        of_vertices, of_faces = _attributes(shape)
        of_vertices = {kind: values[rows] for kind, values in of_vertices.items()}
        if without.any():
            kept_vertices = np.unique(mesh.faces[~without])
            of_vertices = {kind: values[kept_vertices] for kind, values in of_vertices.items()}
            of_faces = {kind: values[~without] for kind, values in of_faces.items()}
            mesh = without_faces(mesh, without)
        content = ply_bytes(mesh, vertex_attributes=of_vertices, face_attributes=of_faces)
        file = tree.make(name, ".turned.ply", content)
        # What is left of it: its materials, its light, and whether its faces are flat.
        kept = [part for part in node.nodes() if part.tag in ("ref", "bsdf", "emitter")]
        flat = node.property("face_normals")
        node[:] = [
            new("string", node, name="filename", value=file),
            *([flat] if flat is not None else []),
            *kept,
        ]
        node.set("type", "ply")
    return replace(scene, tree=tree, files=destinations(tree))


def _attributes(shape: Any) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Attributes of the vertices, and of the faces, of a loaded mesh by name, (N, C)."""
    own = ("vertex_positions", "vertex_normals", "vertex_texcoords")
    found: dict[str, dict[str, FloatArray]] = {"vertex_": {}, "face_": {}}
    counts = {"vertex_": shape.vertex_count(), "face_": shape.face_count()}
    for name in sorted(key for key, _ in mi.traverse(shape)):
        kind = next((kind for kind in found if name.startswith(kind)), None)
        if kind is not None and name not in own and "." not in name:
            values = np.array(shape.attribute_buffer(name), dtype=np.float64)
            found[kind][name.removeprefix(kind)] = values.reshape(counts[kind], -1)
    return found["vertex_"], found["face_"]


def _mesh(shape: Any, flipped: NDArray[np.bool_]) -> tuple[Mesh, NDArray[np.int64]]:
    """A loaded mesh in world space with the faces of its file, those reversed that are said to be, (F,) or (1,).

    And which vertex of the loaded mesh each of its vertices is.
    """

    def buffer(values: Any, width: int) -> Any:
        return np.array(values, dtype=np.float64).reshape(-1, width)

    vertices = buffer(shape.vertex_positions_buffer(), 3)
    faces = np.array(shape.faces_buffer(), dtype=np.int32).reshape(-1, 3)
    flipped = np.broadcast_to(flipped, len(faces))
    uvs = buffer(shape.vertex_texcoords_buffer(), 2) if shape.has_vertex_texcoords() else np.zeros((0, 2))
    if not shape.has_vertex_normals():
        turned = Mesh(vertices, np.where(flipped[:, None], faces[:, ::-1], faces), np.zeros((0, 3)), uvs)
        return turned, np.arange(len(vertices))
    normals = buffer(shape.vertex_normals_buffer(), 3)
    corners = vertices[faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # Whichever way the flag has turned them: they lie on the side of the faces.
    side = np.einsum("fc,fkc->", outward, normals[faces])
    normals = normals if side >= 0 else -normals
    # A vertex between faces that are reversed and others becomes two.
    kept, reverse = np.unique(faces[~flipped]), np.unique(faces[flipped])
    rows = np.concatenate([kept, reverse])
    kept_row, reverse_row = np.zeros((2, len(vertices)), dtype=np.int32)
    kept_row[kept], reverse_row[reverse] = np.arange(len(kept)), len(kept) + np.arange(len(reverse))
    turned = Mesh(
        vertices[rows],
        np.where(flipped[:, None], reverse_row[faces[:, ::-1]], kept_row[faces]),
        np.concatenate([normals[kept], -normals[reverse]]),
        uvs[rows] if len(uvs) else uvs,
    )
    return turned, rows
