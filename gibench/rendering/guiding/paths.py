"""Paths that start all over a room, and what each of their vertices finds."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.rendering.backend import tracing
from gibench.rendering.guiding.directions import bin_of
from gibench.rendering.guiding.grid import Grid, facing
from gibench.rendering.guiding.guide import Guide
from gibench.rendering.integrator import follow_paths
from gibench.rendering.sampling import IndependentSampler

SEED = 0
"""A guide is part of the scene to all frames, workers and methods."""

DEPTH = 8
"""Scattering events of the paths."""

NONE = 0xFFFFFFFF


@dataclass(frozen=True)
class Starts:
    """Where paths start. points: mi.Float, count × 3, metres; count: of them, mi.UInt32. Both opaque."""

    points: Any
    count: Any

    @staticmethod
    def of(points: NDArray[np.float64]) -> Starts:
        """points: (N, 3), N > 0."""
        flat, count = mi.Float(points.astype(np.float32).ravel()), mi.UInt32(len(points))
        dr.make_opaque(flat, count)
        return Starts(flat, count)

    def ray(self, sampler):
        """Rays in all directions, each from one of the points."""
        start = dr.minimum(mi.UInt32(sampler.next_1d() * mi.Float(self.count)), self.count - 1)
        direction = mi.warp.square_to_uniform_sphere(sampler.next_2d())
        return mi.Ray3f(dr.gather(mi.Point3f, self.points, start), direction)


def sampler_of(lanes: int, *key: int) -> IndependentSampler:
    """Random numbers of a launch. key: its number among those of a scene."""
    sampler = IndependentSampler()
    seed = np.random.SeedSequence(SEED, spawn_key=key).generate_state(1)[0]
    sampler.independent.seed(dr.opaque(mi.UInt32, int(seed)), lanes)
    return sampler


class Recorder:
    """Takes down the vertices of a launch of paths, one slot for each depth of a lane."""

    def __init__(self, grid: Grid, guide: Guide, lanes: int) -> None:
        """lanes: paths that are launched."""
        self._grid, self._guide, self._lanes = grid, guide, lanes
        self._lane = dr.arange(mi.UInt32, lanes)
        size = lanes * DEPTH
        self.place = dr.full(mi.UInt32, NONE, size)
        self.direction, self.light = dr.full(mi.UInt32, NONE, size), dr.full(mi.UInt32, NONE, size)
        self.density, self.plain, self.throughput, self.before, self.lit, self.given = (
            dr.zeros(mi.Float, size) for _ in range(6)
        )
        self.arrays = [self.place, self.direction, self.light]
        self.arrays += [self.density, self.plain, self.throughput, self.before, self.lit, self.given]
        dr.eval(self.arrays)

    def met(self, emitter, emitted, depth, active):
        """Part of what is found `before` the next vertex."""

    def vertex(self, row, si, bsdf, scattering, throughput, before, depth, active):
        """See `integrator.Recorder`."""
        light = scattering.light.light
        place = self._grid.place_or_outside(si.p, facing(si), mi.Vector3f(0))
        slot = self._lane + (depth - 1) * self._lanes
        active = active & (depth <= DEPTH)
        diffuse = mi.has_flag(bsdf.flags(), mi.BSDFFlags.DiffuseReflection) & (scattering.delta ^ True)
        # A mesh whose normals are zero has no frame to say a direction in.
        diffuse &= dr.all(dr.isfinite(scattering.direction))
        dr.scatter(self.place, place, slot, active)
        dr.scatter(self.direction, bin_of(scattering.direction), slot, active & diffuse)
        dr.scatter(self.density, scattering.pdf, slot, active)
        plain = scattering.pdf
        if self._guide.directions:
            fraction = self._guide.fraction(row, bsdf, active & diffuse)
            guides = self._guide.density(row, scattering.direction, active & diffuse)
            plain = (scattering.pdf - fraction * guides) / (1 - fraction)
        dr.scatter(self.plain, dr.maximum(plain, 0), slot, active)
        dr.scatter(self.throughput, dr.mean(throughput), slot, active)
        dr.scatter(self.before, dr.mean(before), slot, active)
        dr.scatter(self.light, light, slot, active)
        chosen = self._guide.light_probability(row, light, active)
        given = dr.mean(scattering.value * scattering.incident)
        dr.scatter(self.given, given, slot, active)
        dr.scatter(self.lit, given * chosen, slot, active)


@dataclass
class Samples:
    """Vertices, (N,) each.

    place: number in the grid. direction: bin of the bounce, NONE where the surface is not diffuse; density: of the
    bounce, per steradian, and plain: that of the BSDF alone. reflected: radiance that it brought, reflected, over its
    density. light: number, of the light that was asked, and lit: the radiance of it that is reflected.
    sent: all radiance that is reflected, of that light and of the bounce.
    """

    place: NDArray[np.uint32]
    direction: NDArray[np.uint32]
    density: NDArray[np.float32]
    plain: NDArray[np.float32]
    reflected: NDArray[np.float64]
    light: NDArray[np.uint32]
    lit: NDArray[np.float64]
    sent: NDArray[np.float64]


def trace(scene: Any, guide: Guide, starts: Starts, lanes: int, number: int) -> Samples:
    """Vertices of `lanes` paths. number: of the launch."""
    with tracing():
        sampler = sampler_of(lanes, number)
        recorder = Recorder(guide.grid, guide, lanes)
        ray = starts.ray(sampler)
        direct, indirect = follow_paths(
            scene.mi_scene, sampler.independent, ray, max_depth=DEPTH, guide=guide, recorder=recorder
        )
        total = dr.mean(direct + indirect)
        dr.eval(total, recorder.arrays)
    known = np.array(recorder.place) != NONE
    lane = np.tile(np.arange(lanes), DEPTH)[known]
    place, direction, light, density, plain, throughput, before, lit, given = (
        np.array(a)[known] for a in recorder.arrays
    )
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        reflected = (np.array(total)[lane].astype(np.float64) - before) / throughput
    tells = np.isfinite(reflected) & np.isfinite(lit) & np.isfinite(given)
    reflected, lit, given = (
        np.where(tells, np.maximum(a, 0), 0).astype(np.float64) for a in (reflected, lit, given)
    )
    return Samples(place, direction, density, plain, reflected, light, lit, reflected + given)
