"""Rooms that several tests look at, built once, and geometry that shares nothing with the code that made them."""

from functools import cache

import numpy as np

from gibench.generators.parts import Mesh, Room
from gibench.generators.rooms import KINDS, sample_room

SEED = 11
INDICES = range(10)


@cache
def room(index: int) -> Room:
    return sample_room(SEED, index, kind=KINDS[index % len(KINDS)])


def joined(thing) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of all shapes of an object."""
    vertices, faces, count = [], [], 0
    for mesh, _ in thing.shapes:
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + count)
        count += len(mesh.vertices)
    return np.concatenate(vertices), np.concatenate(faces)


def directed_edges_cancel(mesh: Mesh) -> bool:
    """A surface is closed and consistently wound if every edge runs as often one way as the other."""
    places = np.unique(np.round(mesh.vertices, 6) + 0.0, axis=0, return_inverse=True)[1].ravel()
    corners = places[mesh.faces].astype(np.int64)
    corners = corners[
        (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    ]
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    count = int(places.max()) + 1
    forward = np.sort(edges[:, 0] * count + edges[:, 1])
    backward = np.sort(edges[:, 1] * count + edges[:, 0])
    return bool(np.array_equal(forward, backward))


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Enclosed volume, from the divergence theorem."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def inside(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(N,) whether points lie in a union of closed surfaces: signed crossings of a slanted ray.

    Counting with sign rather than parity, since the solids of one piece of furniture run into each other.
    """
    direction = np.array([0.0213, 0.0157, 1.0])
    # Sheared along the ray, the test becomes one of points in flat triangles.
    flat_points = points[:, :2] - points[:, 2:] * direction[:2]
    flat = vertices[:, :2] - vertices[:, 2:] * direction[:2]
    low, high = flat_points.min(0), flat_points.max(0)
    corners = flat[faces]
    near = (corners.max(1) >= low).all(1) & (corners.min(1) <= high).all(1)
    near &= vertices[faces][:, :, 2].max(1) >= points[:, 2].min()
    if not near.any():
        return np.zeros(len(points), dtype=bool)
    corners, height = corners[near], vertices[faces[near]][:, :, 2]
    ab, ac = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    solid = np.abs(area) > 1e-14
    corners, height, ab, ac, area = corners[solid], height[solid], ab[solid], ac[solid], area[solid]
    winding = np.zeros(len(points), dtype=int)
    for chunk in np.array_split(np.arange(len(points)), max(1, len(points) * len(area) // 2_000_000)):
        ap = flat_points[chunk, None] - corners[None, :, 0]
        v = (ap[..., 0] * ac[:, 1] - ap[..., 1] * ac[:, 0]) / area
        w = (ab[:, 0] * ap[..., 1] - ab[:, 1] * ap[..., 0]) / area
        z = height[:, 0] + v * (height[:, 1] - height[:, 0]) + w * (height[:, 2] - height[:, 0])
        crossed = (v > 0) & (w > 0) & (v + w < 1) & (z > points[chunk, 2:])
        winding[chunk] = (crossed * np.sign(area)).sum(1)
    return winding > 0


def surface_points(
    rng: np.random.Generator, vertices: np.ndarray, faces: np.ndarray, count: int, depth: float
) -> np.ndarray:
    """Points spread over a surface by area, and one a triangle, moved `depth` m to the inside."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    keep = area > 1e-12
    a, b, c, normal, area = a[keep], b[keep], c[keep], normal[keep], area[keep]
    chosen = np.concatenate([rng.choice(len(area), count, p=area / area.sum()), np.arange(len(area))])
    u, v = rng.random((2, len(chosen)))
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    places = a[chosen] + u[:, None] * (b - a)[chosen] + v[:, None] * (c - a)[chosen]
    return places - depth * normal[chosen] / area[chosen, None]
