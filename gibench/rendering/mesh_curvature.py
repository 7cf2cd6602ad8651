"""Curvature of triangle meshes: how fast the shading normal turns, which is what bends reflections.

Within a triangle the interpolated normals turn evenly; the symmetric part of that gradient is the triangle's curvature
tensor (Rusinkiewicz 2004, "Estimating curvatures and their derivatives on triangle meshes"). It needs no ring of
neighbours, so it is defined at boundaries, on two triangles or on a non-manifold mesh, and it is exact where a large
plane ends in a rounded edge. Estimates from the angles around a vertex (Meyer et al. 2003, which Rodriguez et al. 2020,
section 4.3, take) must tessellate there first. As there, the tensors are then averaged with those of neighbours that
deviate by less than 40°, area by area, and are to be interpolated between the corners.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ALIKE = 0.5
"""Of the sum of two tensors' norms: tensors that are further apart, such as those of a rounded edge and of the plane
beside it, are not averaged."""

LEAST_COSINE = float(np.cos(np.radians(40.0)))
"""Between the normals of triangles that are averaged (Rodriguez et al. 2020, section 4.3)."""

MOST_AROUND = 256
"""Triangles around a vertex; where there are more, as at the tip of a fan, each keeps its own tensor."""

COMPONENTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Of a symmetric tensor, in the order in which tables hold them."""


def corner_tensors(
    vertices: NDArray[np.floating], normals: NDArray[np.floating], faces: NDArray[np.integer]
) -> NDArray[np.float64]:
    """Curvature at the corners of triangles, (F, 3, 6): symmetric 3 × 3 tensors by COMPONENTS, 1/m, world space.

    vertices: (V, 3) metres. normals: (V, 3) unit, those that are shaded with. faces: (F, 3). Along a unit tangent t the
    curvature is t·T·t, positive where the surface bends towards its normal; along the normal it is the mean curvature,
    so that a plane that is tilted a little sees nearly the same. Finite; 0 for triangles without area or normals.
    """
    if not len(faces):
        return np.zeros((0, 3, 6))
    corners = vertices.astype(np.float64)[faces]
    shading = normals.astype(np.float64)[faces]
    tensor, normal, area = _of_faces(corners, shading)
    size = np.linalg.norm(tensor, axis=(1, 2))

    # Vertices that were split for their texture coordinates alone are one again.
    alike = np.concatenate([vertices, normals], axis=1).astype(np.float32) + 0.0
    joined = np.unique(alike, axis=0, return_inverse=True)[1].ravel()
    vertex = joined[faces].ravel()  # of corner 3 f + k
    face = np.repeat(np.arange(len(faces)), 3)
    order = np.argsort(vertex, kind="stable")
    start = np.searchsorted(vertex[order], vertex)
    around = np.searchsorted(vertex[order], vertex, side="right") - start
    around = np.where(around > MOST_AROUND, 0, around)
    corner = np.repeat(np.arange(len(vertex)), around)
    within = np.arange(len(corner)) - np.repeat(np.cumsum(around) - around, around)
    mine, other = face[corner], face[order[start[corner] + within]]
    near = np.sum(normal[mine] * normal[other], axis=1) >= LEAST_COSINE
    near &= np.linalg.norm(tensor[mine] - tensor[other], axis=(1, 2)) <= ALIKE * (size[mine] + size[other])
    near &= mine != other
    corner, other = corner[near], other[near]

    # Each tensor lies in the plane of its triangle, and is turned into that of the vertex.
    at = shading.reshape(-1, 3)
    weight = np.concatenate([area[face], area[other]])
    where = np.concatenate([np.arange(len(face)), corner])
    turned = _turned(tensor[np.concatenate([face, other])], normal[np.concatenate([face, other])], at[where])
    total = np.bincount(where, weight, len(face))
    sums = [np.bincount(where, weight * turned[:, i, j], len(face)) for i, j in COMPONENTS]
    result = np.stack(sums, axis=-1) / np.where(total > 0, total, 1)[:, None]
    mean = 0.5 * result[:, :3].sum(axis=1)
    result += mean[:, None] * np.stack([at[:, i] * at[:, j] for i, j in COMPONENTS], axis=-1)
    return np.where(np.isfinite(result), result, 0).reshape(-1, 3, 6)


def _of_faces(corners: NDArray[np.float64], shading: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Tensors (F, 3, 3) in the planes of triangles, their unit normals on the shaded side, and their areas."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    cross = np.cross(u, v)
    double = np.linalg.norm(cross, axis=1)
    longest = np.maximum((u * u).sum(axis=1), (v * v).sum(axis=1))
    usable = double > 1e-7 * np.where(longest > 0, longest, 1)
    usable &= (longest > 0) & np.isfinite(double) & np.isfinite(shading).all(axis=(1, 2))
    normal = cross / np.where(usable, double, 1)[:, None]
    normal *= np.where((normal[:, None] * shading).sum(axis=(1, 2)) < 0, -1, 1)[:, None]
    # The gradient of what is linear on a triangle: gradients of the two barycentric coordinates.
    squared = np.where(usable, double**2, 1)[:, None]
    towards_u, towards_v = np.cross(v, cross) / squared, np.cross(cross, u) / squared
    turn_u, turn_v = shading[:, 1] - shading[:, 0], shading[:, 2] - shading[:, 0]
    gradient = -(turn_u[:, :, None] * towards_u[:, None, :] + turn_v[:, :, None] * towards_v[:, None, :])
    tangent = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    gradient = tangent @ gradient
    tensor = 0.5 * (gradient + np.swapaxes(gradient, 1, 2))
    tensor = np.where(usable[:, None, None], tensor, 0)
    return tensor, np.where(usable[:, None], normal, 0), np.where(usable, 0.5 * double, 0)


def _turned(
    tensor: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Tensors after the smallest rotation that takes one unit vector to another; as they are where there is none."""
    axis, cosine = np.cross(start, end), (start * end).sum(axis=1)
    zero = np.zeros(len(axis))
    x, y, z = axis.T
    skew = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
    usable = cosine > 0
    scale = np.where(usable, 1 / (1 + np.where(usable, cosine, 0)), 0)[:, None, None]
    rotation = np.eye(3) + np.where(usable[:, None, None], skew + scale * (skew @ skew), 0)
    return rotation @ tensor @ np.swapaxes(rotation, 1, 2)
