"""An even mesh of what training frames see of a scene: triangles of nearly equal sides.

Every part is remeshed by itself (pymeshlab's isotropic explicit remeshing, after Hoppe et al. 1993), so that no two
things grow together; open edges stay where they are. A part that remeshing would destroy stays as it is, with its edges
split. One of more triangles than `MOST_TRIANGLES` is clustered first, and where all would have more vertices than
`MOST_VERTICES` edges become longer, so memory is bounded.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray

from gibench.baselines.relighting.surfaces import Box
from gibench.errors import GibenchError

MOST_VERTICES = 1 << 20
"""Of the whole mesh, as its area and the length of an edge say; there may be some more."""

MOST_TRIANGLES = 200_000
"""Of a part that is remeshed as it is."""

ITERATIONS = 10
"""Of remeshing, each of which halves edges that are too long."""

SMALLEST = 1e-9
"""Square metres: a triangle, or a part, that is smaller has no surface."""

FARTHEST = 0.5
"""Of an edge, that a remeshed part may be away from what it was."""


class RemeshingError(GibenchError):
    """A scene that has no surface to put anything on, or a tool that is not there."""


class Mesh(NamedTuple):
    """vertices: (V, 3) float32, metres. triangles: (F, 3) int64."""

    vertices: NDArray[np.float32]
    triangles: NDArray[np.int64]


def meshes_of(folder: Path) -> list[trimesh.Trimesh]:
    """The meshes of a room's folder, in world space, from its room.glb. Raises RemeshingError."""
    try:
        scene = trimesh.load_scene(folder / "room.glb", process=False)
    except (OSError, ValueError, KeyError) as problem:
        raise RemeshingError(
            f"{folder / 'room.glb'} cannot be read ({problem}): make the scene anew"
        ) from problem
    found = []
    for mesh in scene.dump():
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            x, y, z = mesh.vertices.T
            found.append(trimesh.Trimesh(np.stack([x, -z, y], axis=1), mesh.faces, process=False))
    return found


def even_mesh(parts: Iterable[trimesh.Trimesh], box: Box, edge: float, *, most: int | None = None) -> Mesh:
    """One mesh of all parts, as far as they lie in the box. edge: metres along a side of its triangles.

    most: vertices, as the area and the length of an edge say; MOST_VERTICES by default. Raises RemeshingError where
    there is no surface.
    """
    inside = [cut for part in parts if (cut := _cut(part, box)) is not None]
    area = sum(float(part.area) for part in inside)
    if not inside or area <= SMALLEST:
        raise RemeshingError("nothing of the scene's meshes lies in what the training frames see")
    # An even mesh has one vertex for each √3/2 of a squared edge.
    edge = max(edge, math.sqrt(2 * area / (math.sqrt(3) * min(most or MOST_VERTICES, MOST_VERTICES))))
    vertices, triangles, count = [], [], 0
    for mesh in (_remeshed(part, edge) for part in inside):
        vertices.append(mesh.vertices)
        triangles.append(mesh.triangles + count)
        count += len(mesh.vertices)
    return Mesh(np.concatenate(vertices), np.concatenate(triangles))


def _cut(part: trimesh.Trimesh, box: Box) -> trimesh.Trimesh | None:
    """What of a part lies in a box; None for nothing that has a surface."""
    part = _plain(np.asarray(part.vertices), np.asarray(part.faces))
    low = np.array(box.lowest)
    high = low + np.array(box.size)
    if len(part.faces) and ((part.vertices < low).any() or (part.vertices > high).any()):
        axes = np.eye(3)
        part = part.slice_plane(
            np.concatenate([np.tile(low, (3, 1)), np.tile(high, (3, 1))]), [*axes, *-axes]
        )
        part = _plain(np.asarray(part.vertices), np.asarray(part.faces))
    return part if len(part.faces) and part.area > SMALLEST else None


def _plain(vertices: NDArray[Any], faces: NDArray[Any]) -> trimesh.Trimesh:
    """Without triangles that have no surface, and with one vertex where several lie at one place."""
    corners = vertices[faces] if len(faces) else np.zeros((0, 3, 3))
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    mesh = trimesh.Trimesh(vertices, faces[np.isfinite(area) & (area > SMALLEST * 1e-3)], process=False)
    mesh.remove_unreferenced_vertices()
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    return mesh


def _remeshed(part: trimesh.Trimesh, edge: float) -> Mesh:
    try:
        import pymeshlab
    except ImportError as problem:
        raise RemeshingError(
            f"pymeshlab does not load ({problem}): pip install 'gibench[bench]' brings it, and on a machine without a "
            "desktop `apt install libopengl0 libgl1` what it links to"
        ) from problem
    tool = pymeshlab.MeshSet()
    tool.add_mesh(pymeshlab.Mesh(part.vertices.astype(np.float64), part.faces.astype(np.int32)))
    length = pymeshlab.PureValue(edge)
    try:
        if len(part.faces) > MOST_TRIANGLES:
            tool.meshing_decimation_clustering(threshold=pymeshlab.PureValue(edge / 2))
        tool.meshing_isotropic_explicit_remeshing(
            iterations=ITERATIONS,
            targetlen=length,
            checksurfdist=True,
            maxsurfdist=pymeshlab.PureValue(FARTHEST * edge),
        )
        made = tool.current_mesh()
        found = _plain(made.vertex_matrix(), made.face_matrix())
    except pymeshlab.PyMeshLabException:
        found = None
    if found is None or not 0.5 * part.area < found.area < 2 * part.area:
        found = _split(part, edge)
    return Mesh(np.asarray(found.vertices, np.float32), np.asarray(found.faces, np.int64))


def _split(part: trimesh.Trimesh, edge: float) -> trimesh.Trimesh:
    vertices, faces = trimesh.remesh.subdivide_to_size(part.vertices, part.faces, edge, max_iter=20)
    return _plain(vertices, faces)
