"""A grid of cells that hold intensity, and how it spreads from each of them to its neighbours.

A cell is a small light whose intensity (W/sr) in the direction ω is a + v · ω, the first two bands of spherical
harmonics without their constants. A clamped cosine of flux Φ around n, a diffuse surface, has a = Φ/4π and v = Φ/2π n.

A step takes the light of each cell to its six neighbours (Kaplanyan & Dachsbacher 2010, section 4.2). What the source
sends through each of the five far faces of a neighbour, intensity towards the face times its solid angle, becomes a
clamped cosine in the neighbour that sends as much through that face. The thirty faces fill the sphere of the source:
what goes out evenly is lost nowhere.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

AXES = tuple(
    tuple(float(side) if a == axis else 0.0 for a in range(3)) for axis in range(3) for side in (-1, 1)
)
"""The six directions, and the outward normals of a cell's faces: −x, +x, −y, +y, −z, +z."""

AHEAD = 4 * math.atan(0.25 / (1.5 * math.sqrt(1.5**2 + 0.5)))
"""Solid angle of the far face of the cell ahead, seen from the middle of a cell: a unit square 1.5 away, 0.4007 sr."""

ASIDE = (2 * math.pi / 3 - AHEAD) / 4
"""Of each of its four other faces, 0.4234 sr: together they are what the shared face takes in."""

EVEN = 2 * math.pi / 3
"""Irradiance is EVEN · I(−n) / s², with s the side of a cell: the one calibrated factor. Where radiance L comes from
all sides, every face of a cell lets out π L s², whose six cosines add up to the intensity 3/2 L s², and a surface
receives π L."""

BITS = 40
"""Light is added up in whole numbers of 2⁻⁴⁰ of what is emitted, whose sum is the same in every order."""

COMPONENTS = 12
"""Numbers of a cell: a, v_x, v_y, v_z for red, then for green, then for blue."""


@dataclass(frozen=True)
class Grid:
    """Where the cells are. low: corner (3,), m. side: of a cell, m. counts: along x, y, z; x runs fastest."""

    low: tuple[float, float, float]
    side: float
    counts: tuple[int, int, int]

    @staticmethod
    def around(low: NDArray[Any], high: NDArray[Any], cells: int) -> Grid:
        """The grid over a box with `cells` along its longest side, or up to an eighth fewer.

        Of these numbers, the one by whose cells the other two sides are divided best, since what lies between faces is
        blocked too early or too late.
        """
        low = np.asarray(low, dtype=float)
        extent = np.maximum(np.asarray(high, dtype=float) - low, 1e-3)
        numbers = np.arange(cells, cells - cells // 8 - 1, -1)
        parts = extent / extent.max() * numbers[:, None]
        misfit = np.abs(parts - np.maximum(np.rint(parts), 1)).max(axis=1)
        chosen = int(np.argmin(np.round(misfit, 3)))
        side = float(extent.max()) / int(numbers[chosen])
        counts = np.maximum(np.rint(parts[chosen]), 1).astype(int)
        corner = low + 0.5 * (extent - side * counts)
        return Grid(tuple(corner.tolist()), side, tuple(counts.tolist()))

    def reaching(self, low: NDArray[Any], high: NDArray[Any]) -> Grid:
        """The grid with as many cells more on each side as the other box goes beyond it."""
        corner, counts = np.array(self.low), np.array(self.counts)
        before = np.maximum(np.rint((corner - low) / self.side), 0).astype(int)
        after = np.maximum(np.rint((high - corner) / self.side - counts), 0).astype(int)
        corner, counts = corner - self.side * before, counts + before + after
        return Grid(tuple(corner.tolist()), self.side, tuple(counts.tolist()))

    @property
    def size(self) -> int:
        """Number of cells."""
        return math.prod(self.counts)

    @property
    def arrays(self) -> dict[str, Any]:
        """As kernels read it, which are the same for all grids."""
        arrays = {
            "low": mi.Point3f(*self.low),
            "side": mi.Float(self.side),
            "counts": mi.Vector3i(*self.counts),
        }
        dr.make_opaque(arrays)
        return arrays


def index_of(grid: dict[str, Any], cell: Any) -> tuple[Any, Any]:
    """Number of a cell, mi.UInt32, and whether there is one. cell: mi.Vector3i. grid: `Grid.arrays`."""
    counts = grid["counts"]
    inside = dr.all((cell >= 0) & (cell < counts))
    number = cell.x + counts.x * (cell.y + counts.y * cell.z)
    return dr.select(inside, mi.UInt32(number), 0), inside


def cell_of(grid: dict[str, Any], number: Any) -> Any:
    """The inverse, mi.Vector3i."""
    counts = mi.Vector3u(grid["counts"])
    row = number // counts.x
    layer = row // counts.y
    return mi.Vector3i(mi.Int32(number - row * counts.x), mi.Int32(row - layer * counts.y), mi.Int32(layer))


def injected(grid: dict[str, Any], sums: list[Any], point: Any, normal: Any, flux: Any, active: Any) -> None:
    """Add clamped cosines to the cells half a cell before their surfaces, which keeps light from its own surface.

    sums: COMPONENTS arrays, mi.Int64. flux: mi.Color3f, in units of what is emitted, at most 1.
    """
    at = (point - grid["low"]) / grid["side"] + 0.5 * normal
    # Of what is far away, whole numbers overflow.
    near = active & dr.all((at >= 0) & (at < mi.Vector3f(grid["counts"])))
    number, inside = index_of(grid, mi.Vector3i(dr.floor(dr.select(near, at, 0))))
    near &= inside & (dr.max(flux) > 0)
    for color in range(3):
        parts = [flux[color] * (0.25 / dr.pi), *(flux[color] * (0.5 / dr.pi) * n for n in normal)]
        for k, part in enumerate(parts):
            dr.scatter_reduce(
                dr.ReduceOp.Add, sums[4 * color + k], mi.Int64(dr.round(part * 2.0**BITS)), number, near
            )


def emptied(cells: int) -> list[Any]:
    """Sums for `injected`."""
    return [dr.zeros(mi.Int64, cells) for _ in range(COMPONENTS)]


def as_intensity(sums: list[Any]) -> list[Any]:
    """Sums as intensities, mi.Float, per emitted light."""
    return [mi.Float(total) * 2.0**-BITS for total in sums]


def propagated(grid: dict[str, Any], state: list[Any], passing: list[Any] | None, cells: int) -> list[Any]:
    """One step: what each cell has of its neighbours' light.

    state: COMPONENTS arrays, mi.Float. passing: shares that are let through, one array for each direction of travel;
    None where nothing is in the way. cells: `Grid.size`.
    """
    here = cell_of(grid, dr.arange(mi.UInt32, cells))
    through = [[mi.Float(0)] * len(AXES) for _ in range(3)]  # flux by colour and face
    for number, travel in enumerate(AXES):
        source, inside = index_of(grid, here - mi.Vector3i(*(int(c) for c in travel)))
        sent = [dr.gather(mi.Float, part, source, inside) for part in state]
        if passing is not None:
            sent = [part * passing[number] for part in sent]
        for face, ray in _faces(travel):
            share = AHEAD if face == travel else ASIDE
            for color in range(3):
                a, *v = sent[4 * color : 4 * color + 4]
                intensity = a + sum(part * along for part, along in zip(v, ray, strict=True) if along)
                through[color][AXES.index(face)] = (
                    through[color][AXES.index(face)] + dr.maximum(intensity, 0) * share
                )
    result = []
    for fluxes in through:
        result.append(sum(fluxes[1:], fluxes[0]) * (0.25 / dr.pi))
        result += [(fluxes[2 * axis + 1] - fluxes[2 * axis]) * (0.5 / dr.pi) for axis in range(3)]
    return result


def _faces(travel: tuple[float, ...]) -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
    """Far faces of the cell in that direction, and unit directions towards their middles, from the source's."""
    found = []
    for face in AXES:
        if any(f == -t != 0 for f, t in zip(face, travel, strict=True)):
            continue  # the shared face
        towards = np.add(travel, np.multiply(face, 0.5))
        found.append((face, tuple((towards / np.linalg.norm(towards)).tolist())))
    return found


def rays_of_a_step() -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
    """Direction of travel and direction towards a face, for all thirty, in the order of `propagated`."""
    return [(travel, ray) for travel in AXES for _, ray in _faces(travel)]


def looked_up(grid: dict[str, Any], state: list[Any], point: Any, direction: Any, active: Any) -> Any:
    """Intensity towards a direction at points, interpolated between the middles of cells: mi.Color3f ≥ 0, W/sr.

    Half a cell around the volume it is that of the outermost cells; beyond, such as behind a window, there is none.
    """
    at = (mi.Point3f(point) - grid["low"]) / grid["side"] - 0.5
    last = mi.Vector3f(grid["counts"]) - 1
    active = active & dr.all((at >= -1) & (at <= last + 1))
    at = dr.clip(dr.select(active, at, 0), 0, last)
    corner = dr.minimum(dr.floor(at), dr.maximum(last - 1, 0))
    share = at - corner
    cell = mi.Vector3i(corner)
    total = mi.Color3f(0)
    for number in range(8):
        bits = [(number >> axis) & 1 for axis in range(3)]
        weight = mi.Float(1)
        for axis, bit in enumerate(bits):
            weight *= share[axis] if bit else 1 - share[axis]
        index, inside = index_of(grid, cell + mi.Vector3i(*bits))
        parts = [dr.gather(mi.Float, part, index, inside & active) for part in state]
        for color in range(3):
            a, x, y, z = parts[4 * color : 4 * color + 4]
            total[color] += weight * (a + x * direction.x + y * direction.y + z * direction.z)
    return dr.maximum(total, 0)
