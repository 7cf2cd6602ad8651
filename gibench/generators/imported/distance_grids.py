"""Grids of signed distances as meshes: a lightmap needs triangles to lie on, and a copy of one shows nothing."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gibench.generators.imported.changes import Note
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.reading import SceneTree
from gibench.generators.imported.tree import new
from gibench.generators.parts import Mesh
from gibench.generators.scene_files import ply_bytes


def mesh_grids(tree: SceneTree, note: Note) -> None:
    """Turn every `sdfgrid` into the mesh of its surface, in place. Raises SceneFileError."""
    for node in tree.root.nodes("shape"):
        name = node.property("filename")
        if node.type != "sdfgrid" or name is None:
            continue
        path = tree.located(name.get("value", ""), name.where)
        grid = _read_grid(path, node.where)
        if not grid.min() < 0 < grid.max():
            raise SceneFileError(
                f"{node.where}: {path.name} has no surface: its distances are all of one sign"
            )
        made = tree.make(path.stem, ".ply", ply_bytes(surface(grid)))
        note(node, f"the distance grid {path.name} is a mesh", loss=True)
        node.set("type", "ply")
        for gone in [
            part for part in node.nodes() if part.get("name") in ("filename", "normals", "watertight")
        ]:
            node.remove(gone)
        node.insert(0, new("string", node, name="filename", value=made))


def surface(grid: NDArray[np.float32]) -> Mesh:
    """Surface on which distances (Z, Y, X), negative inside, are 0, in the unit cube that the grid spans."""
    from skimage.measure import marching_cubes

    spacing = 1 / (np.array(grid.shape) - 1)
    vertices, faces, normals, _ = marching_cubes(grid, 0.0, spacing=tuple(spacing))
    vertices, normals = (values[:, ::-1].astype(np.float64) for values in (vertices, normals))
    corners = vertices[faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if np.einsum("fc,fc->", corners.mean(axis=1), outward) < 0:  # six times the volume
        faces, outward = faces[:, ::-1], -outward
    # Normals come from differences of the grid, whose sign is that of the distances.
    if np.einsum("fc,fkc->", outward, normals[faces]) < 0:
        normals = -normals
    return Mesh(vertices, faces.astype(np.int32), normals, np.zeros((0, 2)))


def _read_grid(path: Path, where: str) -> NDArray[np.float32]:
    """(Z, Y, X) of a grid volume file of Mitsuba: version 3, float32."""
    content = path.read_bytes()
    damaged = SceneFileError(
        f"{where}: {path.name} is no grid volume of Mitsuba (VOL, version 3): get it again"
    )
    try:
        magic, version, kind, x, y, z, channels = struct.unpack_from("<3sBiiiii", content)
    except struct.error:
        raise damaged from None
    count = x * y * z * channels
    if magic != b"VOL" or version != 3 or kind != 1 or min(x, y, z) < 2 or channels != 1:
        raise damaged
    if len(content) != 48 + 4 * count:
        raise damaged
    grid = np.frombuffer(content, "<f4", count, 48).reshape(z, y, x).copy()
    if not np.isfinite(grid).all():
        raise SceneFileError(f"{where}: {path.name} has distances that are not finite: mend the file")
    return grid
