"""Solids made of the cells of an uneven grid: walls with holes, frames, panelled doors, slabs.

Closed by construction: neighbouring quads share their corners, and a quad lies on every border between a full
and an empty cell and nowhere else.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gibench.generators.parts import FloatArray, Mesh

# The two axes that span a face across axis 0, 1 and 2, ordered so that their cross product is that axis.
_SPAN = ((1, 2), (2, 0), (0, 1))
# Which world axes carry u and v on a face across each axis: v is up wherever up lies in the face.
_UV = ((1, 2), (0, 2), (0, 1))


def grid_solid(xs: ArrayLike, ys: ArrayLike, zs: ArrayLike, full: NDArray[np.bool_]) -> Mesh:
    """The surface of the full cells of a grid, with metric UVs and flat normals.

    Parameters
    ----------
    xs, ys, zs : increasing planes of the grid (nx+1,), (ny+1,), (nz+1,), metres.
    full : (nx, ny, nz) bool. Full cells that touch along an edge alone would leave the surface open to doubt,
        and do not occur in what this package builds.

    Returns
    -------
    Mesh with four vertices a quad; u and v are coordinates in the plane of the face, metres.
    """
    planes = [np.asarray(p, dtype=np.float64) for p in (xs, ys, zs)]
    padded = np.pad(full, 1)
    vertices, normals, uvs, faces = [], [], [], []
    count = 0
    for axis, (first, second) in enumerate(_SPAN):
        lower = np.moveaxis(padded, (axis, first, second), (0, 1, 2))[:, 1:-1, 1:-1]
        for sign in (1, -1):
            solid, beyond = (lower[:-1], lower[1:]) if sign > 0 else (lower[1:], lower[:-1])
            plane, i, j = np.nonzero(solid & ~beyond)
            corners = np.empty((len(plane), 4, 3))
            corners[:, :, axis] = planes[axis][plane][:, None]
            a, b = planes[first], planes[second]
            corners[:, :, first] = np.stack([a[i], a[i + 1], a[i + 1], a[i]], 1)
            corners[:, :, second] = np.stack([b[j], b[j], b[j + 1], b[j + 1]], 1)
            if sign < 0:
                corners = corners[:, ::-1]
            flat = corners.reshape(-1, 3)
            vertices.append(flat)
            normal = np.zeros(3)
            normal[axis] = sign
            normals.append(np.broadcast_to(normal, flat.shape))
            uvs.append(flat[:, _UV[axis]])
            quads = count + 4 * np.arange(len(plane))[:, None]
            faces.append((quads + np.array([[0, 1, 2, 0, 2, 3]])).reshape(-1, 3))
            count += len(flat)
    return Mesh(
        np.concatenate(vertices),
        np.concatenate(faces).astype(np.int32),
        np.concatenate(normals),
        np.concatenate(uvs),
    )


def box(low: Sequence[float] | FloatArray, high: Sequence[float] | FloatArray) -> Mesh:
    """A sharp box between two corners (3,), metres."""
    xs, ys, zs = ([a, b] for a, b in zip(low, high, strict=True))
    return grid_solid(xs, ys, zs, np.ones((1, 1, 1), dtype=bool))


def ring(xs: Sequence[float], y0: float, y1: float, zs: Sequence[float], bar: float) -> Mesh:
    """A flat lattice in the xz plane: bars of width `bar` along every plane in xs and zs, from y0 to y1.

    The first and last bars lie inside the outline, those between are centred on their planes: two planes each
    make a picture frame, more make the mullions of a window.
    """

    def cells(planes: Sequence[float]) -> tuple[list[float], list[bool]]:
        cuts, open_ = [planes[0], planes[0] + bar], [False]
        for plane in planes[1:-1]:
            cuts += [plane - bar / 2, plane + bar / 2]
            open_ += [True, False]
        return [*cuts, planes[-1] - bar, planes[-1]], [*open_, True, False]

    (x_cuts, x_open), (z_cuts, z_open) = cells(xs), cells(zs)
    full = ~np.logical_and.outer(x_open, z_open)[:, None, :]
    return grid_solid(x_cuts, [y0, y1], z_cuts, full)
