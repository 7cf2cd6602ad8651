"""Figures of animals: limbs that run into each other, with smooth surfaces all over."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gibench.generators.parts import FloatArray, Mesh

Limb = tuple[Sequence[float], Sequence[float], float, float]
"""Two ends (x, y, z) and the radius at each: a cone with round ends."""

CELLS = 60
"""Along the longest side of a figure."""


def figure(limbs: Sequence[Limb], height: float, blend: float) -> Mesh:
    """The limbs as one closed surface that is `height` m high and stands on z = 0.

    limbs: in any unit. blend: over which distance they run into each other, in that unit. UVs are x and y, metres.
    """
    from skimage.measure import marching_cubes  # not needed by those who build rooms

    ends = np.array([[a, b] for a, b, _, _ in limbs], dtype=np.float64)
    radii = np.array([[ra, rb] for _, _, ra, rb in limbs])
    low = (ends - radii[..., None]).min(axis=(0, 1)) - blend
    high = (ends + radii[..., None]).max(axis=(0, 1)) + blend
    cell = float((high - low).max()) / CELLS
    axes = [np.arange(lo, hi + cell, cell) for lo, hi in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    value = np.zeros(points.shape[:-1])
    for (start, end), (first, last) in zip(ends, radii, strict=True):
        along = end - start
        share = np.clip((points - start) @ along / max(float(along @ along), 1e-12), 0, 1)
        nearest = start + share[..., None] * along
        away = np.linalg.norm(points - nearest, axis=-1) - (first + share * (last - first))
        value += np.exp(-away / (blend / 4))  # a smooth minimum of the distances
    distance = -np.log(np.maximum(value, 1e-300)) * (blend / 4)
    vertices, faces, normals, _ = marching_cubes(
        distance, 0.0, spacing=(cell,) * 3, gradient_direction="ascent"
    )
    vertices = vertices.astype(np.float64) - vertices.min(axis=0)
    scale = height / float(vertices[:, 2].max())
    vertices = (vertices - [*vertices[:, :2].max(axis=0) / 2, 0]) * scale
    normals = normals.astype(np.float64) / np.linalg.norm(normals, axis=1, keepdims=True)
    corners = vertices[faces]
    turned = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # Both are meant to point outwards; which way round depends on the sign of the field.
    if (normals[faces[:, 0]] * turned).sum() < 0:
        faces = faces[:, ::-1]
    if _volume(vertices, faces) < 0:
        faces, normals = faces[:, ::-1], -normals
    return Mesh(vertices, np.ascontiguousarray(faces, dtype=np.int32), normals, vertices[:, :2].copy())


def _volume(vertices: FloatArray, faces: FloatArray) -> float:
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return float((a * np.cross(b, c)).sum())


def _both(x: float, y: float, z: float) -> list[tuple[float, float, float]]:
    return [(-x, y, z), (x, y, z)]


def _dog(rng: np.random.Generator) -> list[Limb]:
    length, leg, neck = rng.uniform(0.7, 1.1), rng.uniform(0.45, 0.75), rng.uniform(0.25, 0.5)
    chest, rear, head = (0.0, length / 2, leg + 0.2), (0.0, -length / 2, leg + 0.18), rng.uniform(0.17, 0.23)
    face = (0.0, length / 2 + 0.2, leg + 0.2 + neck)
    limbs: list[Limb] = [(chest, rear, 0.24, 0.2), (chest, face, 0.15, 0.13), (face, face, head, head)]
    limbs.append((face, (0.0, face[1] + 0.27, face[2] - 0.06), 0.12, 0.075))
    for x, y, z in [*_both(0.15, length / 2, leg + 0.1), *_both(0.14, -length / 2, leg + 0.1)]:
        limbs += [((x, y, z), (x, y, 0.07), 0.1, 0.07), ((x, y, 0.06), (x, y + 0.07, 0.05), 0.07, 0.06)]
    for x, y, z in _both(0.12, face[1] - 0.05, face[2] + 0.12):
        limbs.append(((x, y, z), (1.4 * x, y - 0.03, z + rng.uniform(0.08, 0.2)), 0.06, 0.025))
    tail = (0.0, rear[1] - 0.35, rear[2] + rng.uniform(-0.1, 0.35))
    return [*limbs, ((0.0, rear[1] - 0.1, rear[2] + 0.08), tail, 0.06, 0.03)]


def _bear(rng: np.random.Generator) -> list[Limb]:
    girth, head = rng.uniform(0.3, 0.38), rng.uniform(0.24, 0.3)
    face = (0.0, 0.06, 0.95)
    limbs: list[Limb] = [((0, 0, 0.34), (0, 0.02, 0.6), girth, girth * 0.8), (face, face, head, head)]
    limbs.append(((0, 0.18, 0.92), (0, 0.3, 0.89), 0.13, 0.09))
    for x, y, z in _both(0.2, 0.02, 0.95 + 0.75 * head):
        limbs.append(((x, y, z), (x, y, z), 0.09, 0.09))
    for x, y, z in _both(0.3, 0.12, 0.6):
        limbs.append(((x, y, z), (1.1 * x, y + 0.22, z - rng.uniform(0.1, 0.25)), 0.12, 0.1))
    for x, y, z in _both(0.22, 0.15, 0.14):
        limbs.append(((x, y, z), (1.35 * x, y + 0.34, z), 0.15, 0.13))
    return limbs


def _bird(rng: np.random.Generator) -> list[Limb]:
    lift, head = rng.uniform(0.45, 0.75), rng.uniform(0.15, 0.2)
    face = (0.0, 0.36, 0.3 + lift)
    limbs: list[Limb] = [((0, 0.12, 0.3), (0, -0.25, 0.3), 0.3, 0.22), (face, face, head, head)]
    limbs += [((0, 0.25, 0.4), face, 0.16, 0.12), (face, (0, 0.36 + head + 0.16, face[2] - 0.04), 0.07, 0.03)]
    limbs.append(((0, -0.4, 0.36), (0, -0.72, 0.5 + rng.uniform(-0.05, 0.15)), 0.13, 0.05))
    for x, y, z in _both(0.24, 0.08, 0.36):
        limbs.append(((x, y, z), (1.05 * x, y - 0.42, z + 0.06), 0.12, 0.05))
    return limbs


def _rabbit(rng: np.random.Generator) -> list[Limb]:
    ear, face = rng.uniform(0.35, 0.6), (0.0, 0.3, 0.62)
    limbs: list[Limb] = [((0, -0.12, 0.32), (0, 0.12, 0.36), 0.31, 0.22), (face, face, 0.2, 0.2)]
    limbs += [(face, (0, 0.45, 0.57), 0.12, 0.08), ((0, -0.42, 0.24), (0, -0.44, 0.26), 0.1, 0.1)]
    for x, y, z in _both(0.07, 0.24, 0.76):
        limbs.append(((x, y, z), (2.2 * x, y - 0.15, z + ear), 0.055, 0.05))
    for x, y, z in _both(0.2, -0.12, 0.16):
        limbs += [((x, y, z), (x, y + 0.3, 0.08), 0.16, 0.08)]
    for x, y, z in _both(0.1, 0.22, 0.26):
        limbs.append(((x, y, z), (x, y + 0.1, 0.07), 0.09, 0.06))
    return limbs


ANIMALS: dict[str, Callable[[np.random.Generator], list[Limb]]] = {
    "bear": _bear,
    "bird": _bird,
    "dog": _dog,
    "rabbit": _rabbit,
}


def sample_animal(rng: np.random.Generator, species: str) -> Mesh:
    """A figure of a species in `ANIMALS`, 0.16 to 0.3 m high, that looks along +y."""
    limbs = ANIMALS[species](rng)
    return figure(limbs, float(rng.uniform(0.16, 0.3)), blend=0.12)
