"""Finding in the probes what a pixel reflects: a search around the place that path perturbation points at.

Rodriguez et al. 2020, section 5.2: two grids of samples, the second finer and around the best of the first; the energy
of equation 1 says which sample fits the pixel best, and equation 2 blends those of several probes.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.baselines.glossy_probe_reprojection.perturbation import Mirror, displacement
from gibench.baselines.probes.mappings import Octahedral
from gibench.baselines.probes.maps import Probes

STEPS = (4.0, 2.0)
"""Texels between the samples of the coarse grid and of the fine one (section 5.2)."""

FINE = 3
"""Samples along a side of the fine grid (section 5.2)."""

OTHER_SURFACE = 10.0
"""Factor of the energy where what is reflected is of another material, s_a (section 5.2)."""

FALLOFF = 8.0
"""Of a probe's weight with its energy, φ (section 5.2)."""

NOTHING = 1e3
"""Energy where a probe has no sample of the surface at all; the largest of any sample is 30."""

STAND_IN = 0.02
"""Weight of probes outside of the cell around the camera, over that of its corners: they count where one of those was
dropped, or none of them shows the surface."""

SMALLEST_STRETCH, LARGEST_STRETCH = 0.25, 4.0
"""Of the map, that the search makes up for."""

RECORD = 6
"""Words of 32 bits a texel in the table that the search reads."""

OCTAHEDRON = Octahedral(65535, 65535)
"""Storage of directions: 16 bits along each side, errors below 1e-4."""

MAPS = (
    "radiance",
    "distance",
    "normal",
    "material_id",
    "reflected_position",
    "reflected_material_id",
)


@dataclass
class Wanted:
    """Target of a pixel's search in the probes; a lane a pixel.

    mirror: the point of the surface. material: mi.UInt32, of the surface. target: what it mirrors, mi.Point3f (m), or
    the unit direction where that is infinitely far. far: mi.Bool. reflected: mi.UInt32, material of what is mirrored,
    0 where it is infinitely far.
    """

    mirror: Mirror
    material: Any
    target: Any
    far: Any
    reflected: Any

    @property
    def direction(self) -> Any:
        """Unit mi.Vector3f towards what is mirrored."""
        return dr.select(
            self.far, mi.Vector3f(self.target), dr.normalize(mi.Vector3f(self.target - self.mirror.point))
        )


def _packed(direction: Any) -> Any:
    """A vector's direction in 32 bits, mi.UInt32: its place on the unfolded octahedron."""
    x, y = (mi.UInt32(dr.round(c)) for c in OCTAHEDRON.coordinates(direction))
    return x | (y << 16)


def _unpacked(bits: Any) -> Any:
    return OCTAHEDRON.direction(mi.Point2f(mi.Float(bits & 0xFFFF), mi.Float(bits >> 16)))


class TexelTable:
    """All that the search reads of a texel, side by side: one place of the memory a sample rather than nine.

    probes: with MAPS. arrays: what a `Replay` must hold, those of the probes included.
    """

    def __init__(self, probes: Probes) -> None:
        """Under the current variant. The table takes 24 bytes a texel, as the paper's maps do (section 7.3.4)."""
        self.probes = probes
        width, height = probes.mapping.width, probes.mapping.height
        texels = width * height
        local = dr.arange(mi.UInt32, texels)
        row = local // dr.opaque(mi.UInt32, width)
        centre = mi.Point2f(mi.Float(local - row * dr.opaque(mi.UInt32, width)) + 0.5, mi.Float(row) + 0.5)
        table = dr.empty(mi.UInt32, RECORD * texels * probes.count)
        for number in range(probes.count):  # one kernel for all of them
            texel = local + dr.opaque(mi.UInt32, number * texels)
            for k, value in enumerate(self._texels(dr.opaque(mi.UInt32, number), texel, centre)):
                dr.scatter(table, value, texel * RECORD + k)
            dr.eval(table)
        self.arrays = {**probes.arrays, "table": table}
        dr.make_opaque(self.arrays)

    def _texels(self, probe: Any, texel: Any, centre: Any) -> list[Any]:
        """The record of texels as mi.UInt32: what is mirrored, both materials, the mirror ray, the normal."""
        probes = self.probes
        towards = probes.direction(probe, centre)
        normal = mi.Vector3f(probes.fetch("normal", texel))
        mirrored = mi.Point3f(probes.fetch("reflected_position", texel))
        reflected = probes.fetch("reflected_material_id", texel)
        point = probes.position(probe) + probes.fetch("distance", texel) * towards
        ray = dr.select(
            reflected == 0, towards - 2 * dr.dot(towards, normal) * normal, mi.Vector3f(mirrored - point)
        )
        bits = [dr.reinterpret_array(mi.UInt32, value) for value in mirrored]
        return [
            *bits,
            probes.fetch("material_id", texel) | (reflected << 16),
            _packed(ray),
            _packed(normal),
        ]

    def materials(self, texel: Any, active: Any) -> tuple[Any, Any]:
        """Materials of the surfaces at texels and of what they mirror, mi.UInt32 each."""
        both = dr.gather(mi.UInt32, self.arrays["table"], texel * RECORD + 3, active)
        return both & 0xFFFF, both >> 16

    def mirrored(self, texel: Any, active: Any) -> Any:
        """Points that texels mirror, mi.Point3f, m; 0 where they mirror nothing."""
        table = self.arrays["table"]
        return mi.Point3f(
            [
                dr.reinterpret_array(mi.Float, dr.gather(mi.UInt32, table, texel * RECORD + k, active))
                for k in range(3)
            ]
        )

    def energy(self, texel: Any, wanted: Wanted, towards: Any, unit: Any, active: Any) -> Any:
        """Equation 1 of texels, mi.Float: 0 for a perfect sample, ≥ NOTHING for one of another surface.

        towards: of `wanted`. unit: mi.Float, metres that count as one.
        """
        table = self.arrays["table"]
        material, reflected = self.materials(texel, active)
        active = active & (material == wanted.material)
        # Two surfaces that mirror what is infinitely far: how far apart that is, one unit away.
        ray = _unpacked(dr.gather(mi.UInt32, table, texel * RECORD + 4, active))
        normal = _unpacked(dr.gather(mi.UInt32, table, texel * RECORD + 5, active))
        apart = dr.norm(self.mirrored(texel, active) - wanted.target) / unit
        nowhere = reflected == 0
        apart = dr.select(nowhere & wanted.far, dr.norm(ray - towards), apart)
        apart = dr.select(nowhere == wanted.far, dr.minimum(apart, 1), 1)
        turned = dr.minimum(dr.maximum(1 - dr.dot(normal, wanted.mirror.normal), 0), 1)
        aside = dr.minimum(dr.maximum(1 - dr.dot(ray, towards), 0), 1)
        sum_ = apart + turned + aside
        value = dr.select(reflected == wanted.reflected, sum_, OTHER_SURFACE * sum_)
        return dr.select(active, value, NOTHING)

    @dr.syntax
    def refined(
        self, probe: Any, wanted: Wanted, towards: Any, centre: Any, step: Any, side: Any, unit: Any, best, at
    ):
        """The best sample of a grid around a place of the map, or the one before where none is better.

        centre: mi.Point2f, texel coordinates. step: mi.Float, between samples. side: mi.UInt32, samples along a side,
        odd, or 0. best, at: energy and place so far.
        """
        best, at = mi.Float(best), mi.Point2f(at)
        k = mi.UInt32(0)
        half = 0.5 * (mi.Float(side) - 1)
        while k < side * side:
            row = k // side
            offset = mi.Point2f(mi.Float(k - row * side) - half, mi.Float(row) - half)
            place = centre + step * offset
            value = self.energy(self.probes.texel_at(probe, place), wanted, towards, unit, True)
            closer = value < best
            best = dr.select(closer, value, best)
            at = dr.select(closer, place, at)
            k += 1
        return best, at

    def color(self, probe: Any, at: Any, material: Any, active: Any) -> Any:
        """Radiance at a place of the map, of the corners around it that show the material: mi.Color3f."""
        result, total = mi.Color3f(0), mi.Float(0)
        for texel, weight in self.probes.corners_at(probe, at):
            same = active & (self.materials(texel, active)[0] == material)
            share = dr.select(same, weight, 0)
            result += share * mi.Color3f(self.probes.fetch("radiance", texel, same))
            total += share
        return result * dr.select(total > 0, dr.rcp(total), 0)


@dataclass
class Search:
    """Options of a search, each of one lane.

    order: mi.UInt32, of the perturbation. window: mi.UInt32, samples along a side of the coarse grid.
    levels: mi.UInt32, 1 without the fine grid. unit: mi.Float, metres of equation 1.
    """

    order: Any
    window: Any
    levels: Any
    unit: Any


def best_sample(table: TexelTable, probe: Any, wanted: Wanted, eye: Any, search: Search, active: Any):
    """The sample of probes (mi.UInt32) that fits best: its energy, mi.Float, and its place on the map, mi.Point2f.

    eye: mi.Point3f. The energy is NOTHING where the probe does not show the surface near to where it should.
    """
    probes = table.probes
    centre = probes.position(probe)
    move = centre - eye
    step = displacement(wanted.mirror, eye, wanted.target, wanted.far, move, search.order)
    start = probes.coordinates(probe, wanted.mirror.point + step - centre)
    towards = wanted.direction
    best, at = mi.Float(NOTHING), mi.Point2f(start)
    coarse = dr.select(active, search.window, 0)
    spread = dr.rcp(dr.clip(probes.stretch(probe, start), SMALLEST_STRETCH, LARGEST_STRETCH))
    best, at = table.refined(probe, wanted, towards, start, STEPS[0] * spread, coarse, search.unit, best, at)
    fine = dr.select(active & (search.levels > 1), mi.UInt32(FINE), 0)
    spread = dr.rcp(dr.clip(probes.stretch(probe, at), SMALLEST_STRETCH, LARGEST_STRETCH))
    best, at = table.refined(probe, wanted, towards, at, STEPS[1] * spread, fine, search.unit, best, at)
    return best, at


@dr.syntax
def gathered(
    table: TexelTable,
    chosen: Any,
    shares: Any,
    number: Any,
    wanted: Wanted,
    eye: Any,
    search: Search,
    active: Any,
):
    """Glossy radiance from several probes (equation 2), mi.Color3f, and the least energy among them, mi.Float.

    chosen: mi.UInt32, of which the first `number` (mi.UInt32 of one lane) are searched; shares: their weights. Where no
    probe shows the surface, the radiance is 0 and the energy NOTHING.
    """
    color, total = mi.Color3f(0), mi.Float(0)
    least = mi.Float(NOTHING)
    index = mi.UInt32(0)
    while index < number:
        probe = dr.gather(mi.UInt32, chosen, index)
        share = dr.gather(mi.Float, shares, index)
        value, at = best_sample(table, probe, wanted, eye, search, active)
        found = active & (value < NOTHING)
        radiance = table.color(probe, at, wanted.material, found)
        # Relative to the best so far: all exponentials may underflow but its own.
        lowest = dr.minimum(least, value)
        kept = dr.exp(FALLOFF * (lowest - least))
        added = dr.select(found, share * dr.exp(FALLOFF * (lowest - value)), 0)
        color = color * kept + radiance * added
        total = total * kept + added
        least = lowest
        index += 1
    return dr.select(total > 0, color / dr.select(total > 0, total, 1), 0), least


def trilinear(
    positions: NDArray[np.float32], eye: tuple[float, float, float], count: int
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """The probes to look into, and their weights, which sum to 1.

    positions: (N, 3) of a regular grid with gaps. count: at most the number of probes. Outside of the grid the weights
    are those at its hull.
    """
    points = np.asarray(positions, dtype=np.float64)
    low, high = points.min(axis=0), points.max(axis=0)
    offset = np.abs(points - np.clip(eye, low, high))
    step = np.empty(3)
    for axis in range(3):
        gaps = np.diff(np.unique(points[:, axis]))
        gaps = gaps[gaps > 1e-3 * (high - low).max()]
        step[axis] = gaps.min() if len(gaps) else 1.0

    def tent(width: float) -> NDArray[np.float64]:
        return np.asarray(np.maximum(1 - offset / (width * step), 0).prod(axis=1))

    weights = tent(1) + STAND_IN * tent(2)
    # Far from all that stand: by distance alone.
    weights += STAND_IN**2 / (1 + (offset / step).max(axis=1)) ** 2
    chosen = np.argsort(-weights, kind="stable")[:count]
    shares = weights[chosen] / weights[chosen].sum()
    return chosen.astype(np.uint32), shares.astype(np.float32)
