"""Meshes of a closed cube of 2 m, whole and broken: (V, 3) vertices in metres, (F, 3) faces that look inside."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Vertices = NDArray[np.float64]
Faces = NDArray[np.int32]


def cube(ticks: NDArray[np.float64] | None = None) -> tuple[Vertices, Faces]:
    """Six sides, each a grid of two triangles a cell.

    ticks: ascending, from −1 to 1: where the lines of the grid are, the two ends alone by default.
    """
    at = np.array([-1.0, 1.0]) if ticks is None else ticks
    count = len(at)
    across, along = (grid.ravel() for grid in np.meshgrid(at, at, indexing="ij"))
    row, column = (grid.ravel() for grid in np.meshgrid(*[np.arange(count - 1)] * 2, indexing="ij"))
    a = row * count + column
    b, c, d = a + count, a + count + 1, a + 1
    front = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    vertices: list[Vertices] = []
    faces: list[Faces] = []
    for axis in range(3):
        for side in (-1, 1):
            # The first grid axis, the second and this one are right-handed, so the front looks along +axis.
            place = np.empty((count * count, 3))
            place[:, axis], place[:, (axis + 1) % 3], place[:, (axis + 2) % 3] = side, across, along
            faces.append((front if side < 0 else front[:, ::-1]) + len(vertices) * count * count)
            vertices.append(place)
    return np.concatenate(vertices), np.concatenate(faces).astype(np.int32)


def needles() -> tuple[Vertices, Faces]:
    """Every fourth strip of the grid is a micrometre wide, so that its triangles are 500,000 times as long as wide."""
    wide = np.linspace(-1, 1, 5)
    return cube(np.sort(np.concatenate([wide, wide[:-1] + 1e-6])))


def with_degenerate() -> tuple[Vertices, Faces]:
    """As many triangles again without area: some have two equal corners, some three on a line."""
    vertices, faces = cube(np.linspace(-1, 1, 5))
    flat = np.concatenate([faces[:, [0, 0, 1]], faces[:, [0, 1, 0]], np.tile([[0, 1, 2]], (50, 1))])
    return vertices, np.concatenate([flat, faces]).astype(np.int32)


def doubled() -> tuple[Vertices, Faces]:
    """Every face twice, in the same place."""
    vertices, faces = cube(np.linspace(-1, 1, 5))
    return vertices, np.concatenate([faces, faces])


def coplanar() -> tuple[Vertices, Faces]:
    """Two cubes in the same place, cut into different triangles."""
    first, faces = cube(np.linspace(-1, 1, 5))
    second, others = cube(np.linspace(-1, 1, 8))
    return np.concatenate([first, second]), np.concatenate([faces, others + len(first)])


def non_manifold() -> tuple[Vertices, Faces]:
    """A fin outside along one edge, and sides whose vertices do not meet those of their neighbours."""
    vertices, faces = cube(np.linspace(-1, 1, 4))
    coarse, few = cube()
    # Two sides in the coarse grid: the edges of the fine ones end in the middle of theirs.
    per_side = len(faces) // 6
    kept = np.concatenate([few[: 2 * len(few) // 6] + len(vertices), faces[2 * per_side :]])
    fin = np.array([[1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [1.5, 1.5, 0.0]])
    start = len(vertices) + len(coarse)
    return np.concatenate([vertices, coarse, fin]), np.concatenate([kept, [[start, start + 1, start + 2]]])


def open_cube() -> tuple[Vertices, Faces]:
    """Without the side at +x."""
    vertices, faces = cube(np.linspace(-1, 1, 5))
    sides = faces.reshape(6, -1, 3)
    return vertices, np.concatenate([sides[0], *sides[2:]])


BROKEN = {
    "needle triangles": needles,
    "zero-area triangles": with_degenerate,
    "non-manifold mesh": non_manifold,
    "open mesh": open_cube,
}

DOUBLED = {"duplicated faces": doubled, "coplanar faces": coplanar}
