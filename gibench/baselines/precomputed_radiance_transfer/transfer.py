"""The transfer of indirect light: for every vertex, a matrix from the light of the environment to what arrives there.

Sloan, Kautz and Snyder 2002, section 6, for indirect light alone: entry (i, j) is the coefficient of harmonic i of the
radiance that other surfaces send to the vertex while the environment is harmonic j. It is the mean over paths of
throughput · Y_i(first direction) · Y_j(last direction) / density, unbiased for all entries at once.

An entry is a mean over the surface around a vertex, weighted as the vertex is when a place is interpolated (Kavan,
Bargteil and Sloan 2011, "Least Squares Vertex Baking", compare such means with samples at vertices). Points that are
buried in something, or covered, do not count: the floor does not get dark along a wall.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import torch
import trimesh
from numpy.typing import NDArray
from torch import Tensor

from gibench.baselines.precomputed_radiance_transfer.environment import DEGREE, count
from gibench.baselines.precomputed_radiance_transfer.light_paths import on_surface, paths_out
from gibench.baselines.precomputed_radiance_transfer.vertices import PointsAround, Sides, sides_of, spread
from gibench.baselines.relighting.surfaces import Box
from gibench.baselines.training.encodings.spherical_harmonics import spherical_harmonics
from gibench.baselines.vertex_features.closest import ClosestTriangles, Facing
from gibench.baselines.vertex_features.remeshing import FARTHEST, Mesh, even_mesh
from gibench.rendering.backend import torch_device
from gibench.rendering.replay import Replay
from gibench.rendering.sampling import permutations
from gibench.rendering.scene import Scene

SEED = 0
"""The transfer is part of the scene to all seeds."""

MOST_BYTES = 1 << 30
"""Of all matrices. Edges become longer where there would be more."""

RAYS = 16
"""Paths from a point, by which it is known whether it is buried or covered."""

PROBED, PROBED_DEPTH = 4, 3
"""Points around a vertex, and scattering events of paths from there, by which it is known whether light arrives."""

BURIED, COVERED = 0.25, 7 / 8
"""Shares of the first rays from a point that end at the back of a mesh, or near by. Above the one, and where no path
leaves, the point is inside of something: closed things are dark inside, while a wall that has only a back, in a scene
of somebody's, is not. From the other on, it lies in a gap that no camera looks into."""

LIT = 0.5
"""Share of the points around a vertex that are neither, from which on it has a matrix. A front behind the fronts of
drawers shows in the gaps between them alone."""

LANES = 1 << 18
"""Paths at a time: their harmonics take 350 MB."""

TURN = 2.0
"""Edges that a normal at right angles is as bad as, over √2, when the closest vertex is looked for."""

LONGER = 1.1
"""What edges grow by beyond need where there are too many vertices."""


@dataclass(frozen=True, eq=False)
class Transfer:
    """Matrices of the vertices of a mesh where light arrives.

    sides: of the mesh. edge: metres. row: (2·V,) of each vertex; that of its closest neighbour where none arrives at
    it. matrices: (R, count of `reflected`, 3, 81) float16, by what arrives, colour and light; `reflected` ≤ 8. Where no
    light arrives anywhere there is one, of zeros.
    """

    sides: Sides
    edge: float
    row: NDArray[np.int64]
    matrices: NDArray[np.float16]

    def closest(self) -> ClosestTriangles:
        """Where on the mesh places lie, told apart by the side that they are on."""
        return ClosestTriangles(self.sides.mesh, Facing(self.sides.normals, TURN * self.edge))


def made(
    scene: Scene,
    parts: list[trimesh.Trimesh],
    box: Box,
    *,
    edge: float,
    reflected: int,
    paths: int,
    max_depth: int,
) -> Transfer:
    """Compute it.

    parts: of the scene, in world space. box: what matters of them. edge: metres, longer where memory asks for it.
    reflected: degree of what arrives. paths: from a vertex, 4^n ≥ RAYS · PROBED. max_depth: scattering events, that at
    the vertex included. Raises RemeshingError where there is no surface.
    """
    most = MOST_BYTES // (2 * 3 * count(reflected) * count(DEGREE))
    while True:
        sides = sides_of(even_mesh(parts, box, edge, most=most))
        tracer = _Tracer(scene, sides, edge, max_depth)
        vertices = tracer.lit(np.flatnonzero(spread(sides, edge)))
        if len(vertices) <= most:
            break
        edge *= LONGER * math.sqrt(len(vertices) / most)
    matrices = np.zeros((max(len(vertices), 1), count(reflected), 3, count(DEGREE)), np.float16)
    step = max(LANES // paths, 1)
    for first in range(0, len(vertices), step):
        matrices[first : first + step] = tracer.matrices(vertices[first : first + step], paths, reflected)
    return Transfer(sides, edge, _rows(sides, vertices, edge), matrices)


def _rows(sides: Sides, vertices: NDArray[np.int64], edge: float) -> NDArray[np.int64]:
    """The row of each vertex: its own of those that have one, else that of the closest that faces the same way."""
    from scipy.spatial import cKDTree

    if not len(vertices):
        return np.zeros(len(sides.normals), np.int64)
    places = Facing(sides.normals, TURN * edge).beside(sides.mesh.vertices, sides.normals)
    row = cKDTree(places[vertices]).query(places)[1]
    row[vertices] = np.arange(len(vertices))
    return np.asarray(row, np.int64)


class _Tracer:
    def __init__(self, scene: Scene, sides: Sides, edge: float, max_depth: int) -> None:
        self._around = PointsAround(sides.mesh)
        self._reach, self._max_depth = FARTHEST * edge, max_depth
        self._place = Replay(scene, partial(on_surface, scene))
        self._trace = Replay(scene, partial(paths_out, scene), permutations(str(mi.variant())))

    def _paths(
        self, vertices: NDArray[np.int64], points: int, samples: int, max_depth: int
    ) -> dict[str, Tensor]:
        """`paths_out` of vertices (N,) as tensors (N, samples, …)."""
        key = (points, max_depth, int(vertices[0]))
        random = np.random.default_rng(np.random.SeedSequence(SEED, spawn_key=key))
        at, facing = (part.reshape(-1, 3).T for part in self._around.draw(vertices, points, random))
        place, normal = self._place(
            mi.Point3f(np.ascontiguousarray(at)),
            mi.Vector3f(np.ascontiguousarray(facing)),
            dr.opaque(mi.Float, self._reach),
            len(vertices) * points,
        )
        levels = (samples.bit_length() - 1) // 2
        seed, depth = (dr.opaque(mi.UInt32, number) for number in (int(random.integers(2**32)), max_depth))
        found = self._trace(place, normal, seed, depth, len(vertices), points, samples, levels)
        shape = (len(vertices), samples)
        return {name: _tensor(values).reshape(*shape, -1) for name, values in found.items()}

    def lit(self, vertices: NDArray[np.int64]) -> NDArray[np.int64]:
        """Those of vertices (N,) that a path leaves from and LIT of whose points are neither buried nor covered."""
        step = 4 * LANES // (PROBED * RAYS)
        parts = [vertices[first : first + step] for first in range(0, len(vertices), step)]
        found = [vertices[:0]]
        for part in parts:
            paths = self._paths(part, PROBED, PROBED * RAYS, PROBED_DEPTH)
            some = _open(paths, PROBED).float().mean(dim=1) >= LIT
            found.append(part[(some & paths["left"].any(dim=1)[:, 0]).cpu().numpy()])
        return np.concatenate(found)

    def matrices(self, vertices: NDArray[np.int64], paths: int, reflected: int) -> NDArray[np.float16]:
        """(N, count of `reflected`, 3, 81) of vertices (N,)."""
        points = paths // RAYS
        found = self._paths(vertices, points, paths, self._max_depth)
        is_open = _open(found, points)
        weight = found["throughput"] / (RAYS * is_open.sum(dim=1).clamp(min=1))[:, None, None]
        arriving = spherical_harmonics(found["arriving"], reflected)
        light = spherical_harmonics(found["towards"], DEGREE)
        light = (weight[..., None] * light[..., None, :]).flatten(2)
        product = torch.bmm(arriving.mT, light)
        return product.reshape(*product.shape[:2], 3, -1).half().cpu().numpy()


def _open(paths: dict[str, Tensor], points: int) -> Tensor:
    """(N, points) whether a point is neither buried nor covered."""
    left, back, near = (
        paths[name].reshape(len(paths[name]), -1, points).mean(dim=1) for name in ("left", "back", "near")
    )
    return ((left > 0) | (back <= BURIED)) & (near < COVERED)


def _tensor(values: Any) -> Tensor:
    """(lanes, C) of a Dr.Jit array, on the renderer's device."""
    parts = list(values) if dr.depth_v(values) > 1 else [values]
    return torch.stack([mi.Float(part).torch().to(torch_device()) for part in parts], dim=-1)


MESH, MATRICES = "mesh.npz", "transfer.npy"
"""Names in a bake."""


def write(folder: Path, transfer: Transfer) -> None:
    """Leave a transfer in a folder."""
    vertices, triangles = transfer.sides.mesh
    np.savez(
        folder / MESH,
        vertices=vertices,
        triangles=triangles,
        normals=transfer.sides.normals,
        row=transfer.row,
        edge=transfer.edge,
    )
    np.save(folder / MATRICES, transfer.matrices, allow_pickle=False)


def read(folder: Path, reflected: int) -> Transfer:
    """Read it again; its matrices stay on the disk until they are used. Raises OSError, ValueError, KeyError."""
    with np.load(folder / MESH, allow_pickle=False) as file:
        mesh = Mesh(file["vertices"], file["triangles"])
        sides, row, edge = Sides(mesh, file["normals"]), file["row"], float(file["edge"])
    matrices = np.load(folder / MATRICES, mmap_mode="c", allow_pickle=False)
    if matrices.shape[1:] != (count(reflected), 3, count(DEGREE)) or matrices.dtype != np.float16:
        raise ValueError(f"{MATRICES} has the shape {matrices.shape}")
    if len(row) != len(mesh.vertices) or not 0 <= row.min() <= row.max() < len(matrices):
        raise ValueError(f"{MESH} is of another mesh")
    return Transfer(sides, edge, row, matrices)
