"""Environments on cubemaps: six square faces, resampled from a lat-long panorama so that no light is lost.

Faces are in the order +x, −x, +y, −y, +z, −z of the world, whose z is up, and are seen from inside. On the four sides
row 0 is at the top and columns grow to the right; the top has its lower edge, and the bottom its upper edge, at the
face +x. A quarter turn of the environment about z moves the sides on by one and turns top and bottom about their
middle.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gibench.rendering.latlong import directions, resampled

FACES = ("+x", "-x", "+y", "-y", "+z", "-z")

_FORWARD = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=np.float64)
_RIGHT = np.array([[0, -1, 0], [0, 1, 0], [1, 0, 0], [-1, 0, 0], [0, -1, 0], [0, -1, 0]], dtype=np.float64)
_DOWN = np.array([[0, 0, -1], [0, 0, -1], [0, 0, -1], [0, 0, -1], [1, 0, 0], [-1, 0, 0]], dtype=np.float64)

FINENESS = 8
"""Rows of a panorama for each along a face, beyond which more change next to nothing."""

NODES = 8
"""Meridians (Gauss-Legendre) between two edges of columns, on which texels are measured."""


def cube_directions(size: int) -> NDArray[np.float64]:
    """(6, size, size, 3) unit vectors through the middles of the texels."""
    return _through(*np.meshgrid(*[(np.arange(size) + 0.5) * (2 / size) - 1] * 2))


def _through(right: NDArray[np.float64], down: NDArray[np.float64]) -> NDArray[np.float64]:
    """(6, …, 3) unit vectors through places on the faces, from −1 to 1 along either side."""
    rays = (
        _FORWARD.reshape(6, *[1] * right.ndim, 3)
        + right[..., None] * _RIGHT.reshape(6, *[1] * right.ndim, 3)
        + down[..., None] * _DOWN.reshape(6, *[1] * right.ndim, 3)
    )
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def texel_solid_angles(size: int) -> NDArray[np.float64]:
    """(size, size) solid angles of the texels of a face, steradians; over all six faces they sum to 4π."""
    edge = np.linspace(-1, 1, size + 1)
    u, v = np.meshgrid(edge, edge)
    # That of the rectangle from the middle of the face to (u, v).
    corner = np.arctan2(u * v, np.sqrt(u**2 + v**2 + 1))
    return np.asarray(np.diff(np.diff(corner, axis=0), axis=1))


def to_cubemap(panorama: NDArray[Any], size: int) -> NDArray[np.float32]:
    """(6, size, size, C) mean radiance over each texel of a cubemap, of a panorama (H, 2·H, C).

    A constant stays itself, and the integral over the sphere is that of the panorama to four digits or more, even of a
    single bright texel. Panoramas with more rows than `FINENESS` times the size are brought to that many first.
    """
    values = resampled(panorama, min(len(panorama), FINENESS * size)).astype(np.float64)
    overlap = _overlap(len(values), size)
    faces = (overlap @ values.reshape(-1, values.shape[-1])) / overlap.sum(axis=1)[:, None]
    return faces.reshape(6, size, size, -1).astype(np.float32)


def to_latlong(faces: NDArray[Any], height: int) -> NDArray[np.float32]:
    """(height, 2·height, C) mean radiance over each texel of a panorama, of a cubemap (6, size, size, C).

    A constant stays itself, and the integral over the sphere is that of the cubemap to four digits or more.
    """
    size = faces.shape[1]
    overlap = _overlap(height, size).T
    values = overlap @ faces.reshape(6 * size**2, -1).astype(np.float64)
    return (values / overlap.sum(axis=1)[:, None]).reshape(height, 2 * height, -1).astype(np.float32)


@lru_cache(maxsize=8)
def _overlap(height: int, size: int) -> sparse.csr_array:
    """(6·size², 2·height²) solid angles that texels of a cubemap and of a panorama share, steradians.

    Along a meridian the edges of both grids are known in closed form, so the solid angle between two of them is exact.
    Across, meridians are the nodes of a quadrature between all edges of columns of the panorama and of the sides.
    """
    edges = np.linspace(-1, 1, size + 1)
    around = np.concatenate([np.arctan(edges) + turn * np.pi / 2 for turn in range(4)])
    cuts = np.unique(
        np.concatenate([np.arange(2 * height + 1) * (np.pi / height), np.mod(around, 2 * np.pi)])
    )
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    middle, half = (cuts[1:] + cuts[:-1]) / 2, np.diff(cuts) / 2
    azimuth = (middle[:, None] + half[:, None] * nodes).ravel()
    width = (half[:, None] * weights).ravel()
    sine, cosine = np.abs(np.sin(azimuth))[:, None], np.abs(np.cos(azimuth))[:, None]
    sides = np.arctan2(1.0, -edges * np.maximum(sine, cosine))
    caps = [np.arctan2(edges[edges >= 0], across) for across in (sine, cosine)]
    rows = np.broadcast_to(np.linspace(0, np.pi, height + 1), (len(azimuth), height + 1))
    # An edge that a meridian does not meet there splits a texel in two, which changes nothing.
    polar = np.sort(np.concatenate([rows, sides, *caps, *(np.pi - cap for cap in caps)], axis=1), axis=1)
    angles = -np.diff(np.cos(polar), axis=1) * width[:, None]
    x = np.broadcast_to((azimuth * (height / np.pi))[:, None], angles.shape)
    y = (polar[:, 1:] + polar[:, :-1]) * (height / (2 * np.pi))
    texel = _cube_texel(directions(x, y, height), size)
    cell = np.minimum(y.astype(np.int64), height - 1) * (2 * height) + x.astype(np.int64)
    shape = (6 * size**2, 2 * height**2)
    return sparse.coo_array((angles.ravel(), (texel.ravel(), cell.ravel())), shape=shape).tocsr()


def _cube_texel(towards: NDArray[np.float64], size: int) -> NDArray[np.int64]:
    axis = np.abs(towards).argmax(axis=-1)
    along = np.take_along_axis(towards, axis[..., None], axis=-1)[..., 0]
    face = 2 * axis + (along < 0)
    depth = np.abs(along)
    right = np.einsum("...c,...c->...", towards, _RIGHT[face]) / depth
    down = np.einsum("...c,...c->...", towards, _DOWN[face]) / depth
    column, row = (
        np.clip(np.floor((place + 1) * (size / 2)).astype(np.int64), 0, size - 1) for place in (right, down)
    )
    return (face * size + row) * size + column
