"""What is measured on meshes by several tests, independently of how they are made."""

from collections import defaultdict

import numpy as np

from gibench.generators.parts import Mesh


def face_vectors(mesh: Mesh) -> np.ndarray:
    """(F, 3) area vectors: the outward normal of each face times its area."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return np.cross(b - a, c - a) / 2


def area(mesh: Mesh) -> float:
    return float(np.linalg.norm(face_vectors(mesh), axis=1).sum())


def volume(mesh: Mesh) -> float:
    """By the divergence theorem."""
    return float(np.sum(mesh.vertices[mesh.faces].mean(1) * face_vectors(mesh)) / 3)


def welded(mesh: Mesh) -> np.ndarray:
    """(F, 3) faces over vertices that are merged where they coincide to a nanometre."""
    _, index = np.unique(np.round(mesh.vertices, 9) + 0.0, axis=0, return_inverse=True)
    return index.ravel()[mesh.faces]


def uv_areas(mesh: Mesh) -> np.ndarray:
    """(F,) area of each face in the texture plane."""
    a, b, c = np.moveaxis(mesh.uvs[mesh.faces], 1, 0)
    ab, ac = b - a, c - a
    return np.abs(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]) / 2


def assert_sound(mesh: Mesh, *, agreement: float = 0.1) -> None:
    """The contract of `Mesh`: finite, closed, wound one way, of positive volume, unit normals that face outward.

    agreement: the least cosine between a vertex normal and the face that it belongs to.
    """
    for values in (mesh.vertices, mesh.normals, mesh.uvs):
        assert np.isfinite(values).all()
    assert mesh.faces.dtype == np.int32
    assert mesh.vertices.shape == mesh.normals.shape == (len(mesh.uvs), 3)
    assert mesh.faces.min() >= 0
    assert mesh.faces.max() < len(mesh.vertices)
    faces = welded(mesh)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    assert np.all(edges[:, 0] != edges[:, 1]), "a triangle has lost a side"
    count = faces.max() + 1
    there, back = edges @ [count, 1], edges @ [1, count]
    assert len(np.unique(there)) == len(there), "an edge is used twice in one direction"
    assert np.array_equal(np.sort(there), np.sort(back)), "an edge has no counterpart"
    vectors = face_vectors(mesh)
    sizes = np.linalg.norm(vectors, axis=1)
    assert sizes.min() > 0
    assert volume(mesh) > 0
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1)[np.unique(mesh.faces)], 1, atol=1e-9)
    cosines = np.einsum("fk,fvk->fv", vectors / sizes[:, None], mesh.normals[mesh.faces])
    assert cosines.min() > agreement


def pieces(mesh: Mesh) -> list[np.ndarray]:
    """The faces (indices) of each connected piece."""
    faces = welded(mesh)
    parent = np.arange(faces.max() + 1)
    while True:
        least = parent[faces].min(1)
        lower = parent.copy()
        np.minimum.at(lower, faces.ravel(), np.repeat(least, 3))
        lower = lower[lower]
        if np.array_equal(lower, parent):
            break
        parent = lower
    groups = defaultdict(list)
    for face, root in enumerate(parent[faces[:, 0]].tolist()):
        groups[root].append(face)
    return [np.array(g) for g in groups.values()]
