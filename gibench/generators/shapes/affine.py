"""Moving, joining and repeating meshes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from gibench.generators.parts import FloatArray, IntArray, Mesh
from gibench.generators.shapes.errors import ShapeError

Points = Sequence[Sequence[float]] | FloatArray
"""Rows of coordinates, as an array or as nested sequences of numbers."""


def transform(mesh: Mesh, matrix: Points) -> Mesh:
    """The mesh under a (4, 4) affine matrix that acts on column vectors.

    Normals go with the inverse transpose, a mirroring matrix turns the winding round. UVs are scaled by the
    cube root of the determinant, so that they stay metric under even scaling. Raises ShapeError if the
    matrix is singular.
    """
    matrix = np.asarray(matrix, float)
    linear = matrix[:3, :3]
    determinant = np.linalg.det(linear)
    if abs(determinant) < 1e-12:
        raise ShapeError("transform: the matrix is singular; give one with non-zero scales")
    normals = mesh.normals @ np.linalg.inv(linear)
    normals /= length(normals)[:, None]
    faces = mesh.faces if determinant > 0 else np.ascontiguousarray(mesh.faces[:, ::-1])
    uvs = mesh.uvs * np.cbrt(abs(determinant))
    return Mesh(mesh.vertices @ linear.T + matrix[:3, 3], faces, normals, uvs)


def translate(mesh: Mesh, offset: ArrayLike) -> Mesh:
    """The mesh moved by offset (3,) m."""
    return Mesh(mesh.vertices + np.asarray(offset, float), mesh.faces, mesh.normals, mesh.uvs)


def rotation(axis: str, angle: float) -> FloatArray:
    """(4, 4) matrix that turns by `angle` radians, counter-clockwise seen against axis "x", "y" or "z"."""
    first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(4)
    cosine, sine = np.cos(angle), np.sin(angle)
    matrix[first, first] = matrix[second, second] = cosine
    matrix[first, second], matrix[second, first] = -sine, sine
    return matrix


def translation(offset: ArrayLike) -> FloatArray:
    """(4, 4) matrix that moves by offset (3,) m."""
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def rotate_x(mesh: Mesh, angle: float) -> Mesh:
    """The mesh turned by `angle` radians about the x axis."""
    return transform(mesh, rotation("x", angle))


def rotate_y(mesh: Mesh, angle: float) -> Mesh:
    """The mesh turned by `angle` radians about the y axis."""
    return transform(mesh, rotation("y", angle))


def rotate_z(mesh: Mesh, angle: float) -> Mesh:
    """The mesh turned by `angle` radians about the z axis."""
    return transform(mesh, rotation("z", angle))


def mirror_x(mesh: Mesh) -> Mesh:
    """The mesh reflected in the plane x = 0."""
    return transform(mesh, np.diag([-1.0, 1.0, 1.0, 1.0]))


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh that holds all the given ones. Raises ShapeError if there is none."""
    if not meshes:
        raise ShapeError("merge: no mesh was given; give at least one")
    if len(meshes) == 1:
        return meshes[0]
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes[:-1])])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + np.int32(s) for m, s in zip(meshes, starts, strict=True)]),
        np.concatenate([m.normals for m in meshes]),
        np.concatenate([m.uvs for m in meshes]),
    )


def repeat(mesh: Mesh, matrices: ArrayLike) -> Mesh:
    """One mesh with a copy of the given one under each of the matrices (N, 4, 4), none of them mirroring.

    UVs are scaled as by `transform`. Raises ShapeError if a matrix is singular or mirrors.
    """
    matrices = np.asarray(matrices, float)
    linear = matrices[:, :3, :3]
    determinants = np.linalg.det(linear)
    if matrices.ndim != 3 or not np.all(determinants > 1e-12):
        raise ShapeError("repeat: every matrix must have a positive determinant; use transform to mirror")
    count = len(matrices)
    vertices = np.einsum("nij,vj->nvi", linear, mesh.vertices) + matrices[:, None, :3, 3]
    normals = np.einsum("nji,vj->nvi", np.linalg.inv(linear), mesh.normals)
    normals /= length(normals)[..., None]
    faces = (
        mesh.faces[None] + (np.arange(count, dtype=np.int32) * np.int32(len(mesh.vertices)))[:, None, None]
    )
    uvs = np.cbrt(determinants)[:, None, None] * mesh.uvs
    return Mesh(vertices.reshape(-1, 3), faces.reshape(-1, 3), normals.reshape(-1, 3), uvs.reshape(-1, 2))


def repeat_at(mesh: Mesh, offsets: ArrayLike) -> Mesh:
    """One mesh with a copy of the given one moved to each of the offsets (N, 3) m."""
    offsets = np.asarray(offsets, float)
    matrices = np.tile(np.eye(4), (len(offsets), 1, 1))
    matrices[:, :3, 3] = offsets
    return repeat(mesh, matrices)


def fit(mesh: Mesh, low: ArrayLike, high: ArrayLike) -> Mesh:
    """The mesh scaled and moved, axis by axis, so that its bounding box spans low (3,) to high (3,) m."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    bottom, top = mesh.vertices.min(0), mesh.vertices.max(0)
    scale = (high - low) / (top - bottom)
    matrix = np.diag([*scale, 1.0])
    matrix[:3, 3] = low - bottom * scale
    return transform(mesh, matrix)


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """The cross product along the last axis; several times faster than NumPy's on small arrays."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], -1)


def length(vectors: FloatArray) -> FloatArray:
    """Euclidean lengths along the last axis."""
    lengths: FloatArray = np.sqrt(np.einsum("...k,...k->...", vectors, vectors))
    return lengths


def smooth_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """(V, 3) unit vertex normals: the area-weighted mean of the faces (F, 3) around each vertex (V, 3).

    A vertex that no face uses gets a zero vector.
    """
    corners = vertices[faces]
    areas = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = faces.ravel()
    normals: FloatArray = np.stack(
        [np.bincount(flat, np.repeat(areas[:, k], 3), minlength=len(vertices)) for k in range(3)], 1
    )
    sizes = length(normals)[:, None]
    return normals / np.where(sizes > 0, sizes, 1)
