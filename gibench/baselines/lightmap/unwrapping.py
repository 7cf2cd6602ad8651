"""One atlas for all meshes of a scene: where on the lightmap each corner of each triangle lies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
import xatlas
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gibench.errors import GibenchError
from gibench.rendering.scene import Scene

NONE = 0xFFFFFFFF
"""Offset of a shape that has no place in the atlas."""

SMALLEST_SIDE = 8.0
"""A shape gets at least as many texels as a square of this side: a tap or a handle has shadows of its own."""

LARGEST_SIDE = 8.0
"""Metres. A shape of a greater area than the square of this side gets no more texels than such a square: the
ground before a window reaches to the horizon."""

MOST_TEXELS = 1 << 24
"""Of all charts together; beyond, everything is made coarser."""

MAX_COST = 8.0
"""Of a chart, in xatlas' units (its default is 2): half as many charts on furniture, and fewer seams."""


class LightmapError(GibenchError):
    """A scene that no lightmap can be made for, or a damaged one."""


@dataclass(frozen=True, eq=False)
class Unwrapping:
    """Texture coordinates of all triangles.

    size: (width, height) of the atlas in texels. corners: (F, 3, 2) float32, in texels, texel i covering [i, i + 1).
    charts: (F,) int32, number of the connected piece of the atlas that a triangle lies in; −1 where
    a whole mesh has no area and so no place. shapes: (F,) int32, index
    into Mitsuba's list of shapes; triangles: (F,) int32, number within the shape. offsets: (ids,) uint32, by shape id
    of the scene (0 is a miss): row of the shape's first triangle, or NONE.
    """

    size: tuple[int, int]
    corners: NDArray[np.float32]
    charts: NDArray[np.int32]
    shapes: NDArray[np.int32]
    triangles: NDArray[np.int32]
    offsets: NDArray[np.uint32]


def _is_diffuse(shape: Any) -> bool:
    return bool(mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.DiffuseReflection))


def densities(areas: NDArray[np.float64], texels_per_metre: float) -> NDArray[np.float64]:
    """Texels a metre for shapes of these areas (m², > 0)."""
    sides = np.sqrt(areas)
    fitting = np.minimum(
        np.maximum(texels_per_metre, SMALLEST_SIDE / sides), LARGEST_SIDE * texels_per_metre / sides
    )
    return fitting * min(1.0, np.sqrt(MOST_TEXELS / np.sum(areas * fitting**2)))


def unwrap(scene: Scene, texels_per_metre: float) -> Unwrapping:
    """Cut the meshes into charts and lay them out, with room around each for bilinear lookups.

    Shapes without a diffuse lobe are left out. So is a lamp's sphere or disk, which has no triangles to carry
    coordinates: its light outshines by far what it reflects. LightmapError for any other diffuse shape that is no mesh.
    """
    numbers: list[int] = []
    meshes: list[tuple[NDArray[np.float32], NDArray[np.uint32]]] = []
    offsets = np.full(len(scene.shapes) + 1, NONE, dtype=np.uint32)
    first = 0
    for number, shape in enumerate(scene.mi_scene.shapes()):
        if not _is_diffuse(shape):
            continue
        if not shape.is_mesh():
            if not shape.is_emitter():
                raise LightmapError(
                    f"shape '{shape.id()}' is diffuse and no mesh, so it cannot be unwrapped: make it a mesh"
                )
            continue
        vertices = np.array(shape.vertex_positions_buffer(), dtype=np.float32).reshape(-1, 3)
        faces = np.array(shape.faces_buffer(), dtype=np.uint32).reshape(-1, 3)
        if len(faces) == 0:
            continue
        offsets[int(scene.shape_ids(mi.ShapePtr(shape), mi.Bool(True))[0])] = first
        first += len(faces)
        numbers.append(number)
        meshes.append((vertices, faces))
    if not meshes:
        nothing = np.zeros(0, dtype=np.int32)
        return Unwrapping((1, 1), np.zeros((0, 3, 2), dtype=np.float32), nothing, nothing, nothing, offsets)
    areas = np.array([_areas(vertices[faces]).sum() for vertices, faces in meshes])
    scales = np.zeros(len(meshes))
    scales[areas > 0] = densities(areas[areas > 0], texels_per_metre)

    atlas = xatlas.Atlas()
    for (vertices, faces), scale in zip(meshes, scales, strict=True):
        # Moved to the origin: xatlas merges vertices and measures areas in float32.
        atlas.add_mesh(((vertices - vertices.mean(axis=0)) * scale).astype(np.float32), faces)
    charting, packing = xatlas.ChartOptions(), xatlas.PackOptions()
    charting.max_cost = MAX_COST
    packing.texels_per_unit = 1.0
    packing.padding = 1
    packing.bilinear = True
    packing.create_image = False
    atlas.generate(charting, packing)
    size = (max(int(atlas.width), 1), max(int(atlas.height), 1))

    corners, charts, count = [], [], 0
    for number, (vertices, faces) in enumerate(meshes):
        _, indices, uvs = atlas.get_mesh(number)
        of_corners = np.asarray(uvs, dtype=np.float32)[np.asarray(indices, dtype=np.int64)]
        of_faces = _charts(atlas, number, len(faces))
        _place_the_rest(vertices[faces], of_corners, of_faces)
        corners.append(of_corners)
        charts.append(np.where(of_faces >= 0, of_faces + count, -1))
        count += int(atlas.get_mesh_chart_count(number))
    return Unwrapping(
        size,
        (np.concatenate(corners) * np.array(size)).astype(np.float32),
        np.concatenate(charts).astype(np.int32),
        np.repeat(numbers, [len(faces) for _, faces in meshes]).astype(np.int32),
        np.concatenate([np.arange(len(faces)) for _, faces in meshes]).astype(np.int32),
        offsets,
    )


def _areas(triangles: NDArray[Any]) -> NDArray[np.float64]:
    """Areas of triangles (F, 3, 3)."""
    a, b, c = np.moveaxis(triangles.astype(np.float64), 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=-1)


def _charts(atlas: Any, mesh: int, faces: int) -> NDArray[np.int64]:
    """Chart of the mesh that each triangle is in, (F,); −1 for those that xatlas left out as degenerate."""
    charts = np.full(faces, -1, dtype=np.int64)
    for number in range(atlas.get_mesh_chart_count(mesh)):
        charts[np.asarray(atlas.get_mesh_chart(mesh, number).faces, dtype=np.int64)] = number
    return charts


def _place_the_rest(
    triangles: NDArray[np.float32], corners: NDArray[np.float32], charts: NDArray[np.int64]
) -> None:
    """Give triangles without a chart, slivers all, the middle of the nearest one that has a place."""
    left, placed = np.flatnonzero(charts < 0), np.flatnonzero(charts >= 0)
    if len(left) == 0 or len(placed) == 0:
        return
    middles = triangles.mean(axis=1)
    nearest = placed[cKDTree(middles[placed]).query(middles[left])[1]]
    corners[left] = corners[nearest].mean(axis=1, keepdims=True)
    charts[left] = charts[nearest]
