"""An even mesh of what training frames see of a scene: triangles of nearly equal sides.

Every part is remeshed by itself (pymeshlab's isotropic explicit remeshing, after Hoppe et al. 1993), so that no two
things grow together; open edges stay where they are. A part that remeshing would destroy stays as it is, with its edges
split. One of more triangles than `MOST_TRIANGLES` is clustered first (Rossignac and Borrel 1993), some triangles after
others, and where all would have more vertices than `MOST_VERTICES` edges become longer: beside the parts themselves,
memory is bounded.
"""

from __future__ import annotations

import gc
import math
from collections.abc import Iterable, Iterator
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
"""Of what of a part is remeshed as it is, and of a larger one that are looked at at once."""

CLUSTER = 0.5
"""Of an edge, at most: sides of the cells in which the vertices of a larger part become one."""

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
    inside = [(part, kept, own) for part in parts for kept, own in [_inside(part, box)] if own > SMALLEST]
    area = sum(own for *_, own in inside)
    # An even mesh has one vertex for each √3/2 of a squared edge.
    edge = max(edge, math.sqrt(2 * area / (math.sqrt(3) * min(most or MOST_VERTICES, MOST_VERTICES))))
    vertices, triangles, count = [], [], 0
    for part, kept, own in inside:
        if kept is None:
            # A small part keeps as many triangles as one may have.
            side = min(CLUSTER * edge, math.sqrt(2 * own / MOST_TRIANGLES))
            kept = _clustered(_pieces(part, box), box, side)
        # Of dust whose triangles are all smaller than a cell nothing is left: it has the vertices of what is around it.
        if not len(kept.faces):
            continue
        mesh = _remeshed(kept, edge)
        vertices.append(mesh.vertices)
        triangles.append(mesh.triangles + count)
        count += len(mesh.vertices)
    if not count:
        raise RemeshingError("nothing of the scene's meshes lies in what the training frames see")
    return Mesh(np.concatenate(vertices), np.concatenate(triangles))


def _inside(part: trimesh.Trimesh, box: Box) -> tuple[trimesh.Trimesh | None, float]:
    """What of a part lies in a box, and its area, m²; None for nothing, and for more than MOST_TRIANGLES."""
    kept: list[_Piece] = []
    area, count = 0.0, 0
    for piece in _pieces(part, box):
        area, count = area + piece.area, count + len(piece.faces)
        kept = [*kept, piece] if count <= MOST_TRIANGLES else []
    if count > MOST_TRIANGLES or not kept:
        return None, area
    first = np.cumsum([0, *(len(piece.vertices) for piece in kept[:-1])])
    faces = np.concatenate([piece.faces + begin for piece, begin in zip(kept, first, strict=True)])
    return _plain(np.concatenate([piece.vertices for piece in kept]), faces), area


class _Piece(NamedTuple):
    """Of a part: vertices (V, 3), faces (F, 3), area in m². Meshes of trimesh hold themselves, and would stay."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    area: float


def _pieces(part: trimesh.Trimesh, box: Box) -> Iterator[_Piece]:
    """What of a part lies in a box, of MOST_TRIANGLES at once."""
    vertices, faces = np.asarray(part.vertices), np.asarray(part.faces)
    for first in range(0, len(faces), MOST_TRIANGLES):
        used, some = np.unique(faces[first : first + MOST_TRIANGLES], return_inverse=True)
        cut = _cut(trimesh.Trimesh(vertices[used], some.reshape(-1, 3), process=False), box)
        found = _Piece(np.array(cut.vertices), np.array(cut.faces), float(cut.area))
        del cut
        gc.collect(0)
        yield found


def _clustered(pieces: Iterable[_Piece], box: Box, side: float) -> trimesh.Trimesh:
    """One mesh of pieces whose vertices in a cell of a grid become one, in their mean. side: of a cell, metres."""
    cells, triangles = np.zeros((0, 3), np.int64), np.zeros((0, 3), np.int64)
    sums: NDArray[np.float64] = np.zeros((0, 3))
    numbers: NDArray[Any] = np.zeros(0)
    for piece in pieces:
        own = np.floor((piece.vertices - np.array(box.lowest)) / side).astype(np.int64)
        before = len(cells)
        cells, place = np.unique(np.concatenate([cells, own]), axis=0, return_inverse=True)
        place = place.ravel()
        points = np.concatenate([sums, piece.vertices])
        sums = np.stack([np.bincount(place, axis, len(cells)) for axis in points.T], axis=1)
        numbers = np.bincount(place, np.concatenate([numbers, np.ones(len(own))]), len(cells))
        found = np.concatenate([place[triangles], place[before:][piece.faces]])
        a, b, c = found.T
        found = found[(a != b) & (b != c) & (c != a)]
        # The smallest corner first, which leaves the side that a triangle faces.
        turn = (found.argmin(axis=1)[:, None] + np.arange(3)) % 3
        triangles = np.unique(np.take_along_axis(found, turn, axis=1), axis=0)
    return _plain(sums / numbers[:, None], triangles)


def _cut(part: trimesh.Trimesh, box: Box) -> trimesh.Trimesh:
    """What of a part lies in a box."""
    part = _plain(np.asarray(part.vertices), np.asarray(part.faces))
    low = np.array(box.lowest)
    high = low + np.array(box.size)
    if len(part.faces) and ((part.vertices < low).any() or (part.vertices > high).any()):
        axes = np.eye(3)
        part = part.slice_plane(
            np.concatenate([np.tile(low, (3, 1)), np.tile(high, (3, 1))]), [*axes, *-axes]
        )
        part = _plain(np.asarray(part.vertices), np.asarray(part.faces))
    return part


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
