"""Learns a guide from paths that start all over a room.

Every vertex of a path tells what the light that it asked gave, and what came from the direction that it went on in.
Each pass is guided by what those before it have found.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.rendering.backend import is_scalar, tracing
from gibench.rendering.free_space import NoFreeSpace, beginnings, free_space, surroundings
from gibench.rendering.guiding.directions import BIN_AREA, BINS, bin_of
from gibench.rendering.guiding.grid import FACES, Grid
from gibench.rendering.guiding.guide import Distributions, Guide
from gibench.rendering.integrator import follow_paths
from gibench.rendering.light_numbers import lights_of
from gibench.rendering.sampling import IndependentSampler

SEED = 0
"""A guide is part of the scene to all frames, workers and methods."""

LANES = 1 << 17
"""Paths at a time. Twice as many learn no better guide: the variance was 1.08 and 1.09 times that in two rooms."""

PASSES = (1, 1)
"""Paths of a pass, as a multiple of LANES. That is enough to know the lights: with 7 instead of 2 the variance was the
same within 3 % in three of four rooms, and .94 of it in the fourth."""

PASSES_OF_DIRECTIONS = (1, 4)
"""Those that follow where directions pay."""

DEPTH = 8
"""Scattering events of the paths."""

FRACTIONS = (0.0, 0.2, 0.4, 0.6)
"""Of the directions at a diffuse surface that a guide may choose; the other ones bound what it can spoil. A place has
that which would have made the least noise of the samples of the last pass."""

LEARNING_FRACTION = 0.4
"""That of the passes in which it learns."""

DIRECTIONS_PAY = 0.09
"""Of the second moment of bounces, the share that a guide of two passes has to take away, in the mean over places, to
choose directions at all. They cost a tenth of the time of a path, and what they do not know shines in single pixels. Of
ten rooms two had more (variance x time .91 and .98 of that of lights alone), the others .01 to .08."""

SPREAD = 0.5
"""Of the guide's directions that follow the root of the second moment of what they bring, which has more regard for
what is bright and rare; the others follow the mean (Rath et al. 2020)."""

FLOOR = 0.1
"""Of the guide's directions that are spread evenly."""

LIGHT_FLOOR = 0.1
"""Of the light samples that are spread over the lights as they would be without a guide."""

DOUBT = 16
"""Samples of a place at which the guide chooses half of its share: few of them tell little of directions."""

PRIOR, PRIOR_OF_DIRECTIONS = 16, 1024
"""A place counts the mean of the 27 cells around it as this many samples of its own: for the lights, whose shadows have
edges, and for directions, of which there are 256. With 16 for both the variance of three rooms was 1.1 to 1.2 times
that."""

FEWEST = 8
"""Samples of the first pass that make a place known."""

MARGIN = 0.6
"""Metres from the free space of a room to the edge of the grid."""

START_ROUNDS = 6
"""Of the walk that finds where paths start. They go on from there, so a nook that it leaves out is seen as well."""

NONE = 0xFFFFFFFF


class Recorder:
    """Takes down the vertices of a launch of paths, one slot for each depth of a lane."""

    def __init__(self, grid: Grid, guide: Guide, lanes: int) -> None:
        """lanes: paths that are launched."""
        self._grid, self._guide, self._lanes = grid, guide, lanes
        self._lane = dr.arange(mi.UInt32, lanes)
        size = lanes * DEPTH
        self.place = dr.full(mi.UInt32, NONE, size)
        self.direction, self.light = dr.full(mi.UInt32, NONE, size), dr.full(mi.UInt32, NONE, size)
        self.density, self.plain, self.throughput, self.before, self.lit = (
            dr.zeros(mi.Float, size) for _ in range(5)
        )
        self.arrays = [self.place, self.direction, self.light]
        self.arrays += [self.density, self.plain, self.throughput, self.before, self.lit]
        dr.eval(self.arrays)

    def met(self, emitter, emitted, depth, active):
        """Part of what is found `before` the next vertex."""

    def vertex(self, row, si, bsdf, scattering, throughput, before, depth, active):
        """See `integrator.Recorder`."""
        light = scattering.light.light
        normal = dr.mulsign(si.n, dr.dot(si.n, si.to_world(si.wi)))
        place = self._grid.place_or_outside(si.p, normal, mi.Vector3f(0))
        slot = self._lane + (depth - 1) * self._lanes
        active = active & (depth <= DEPTH)
        diffuse = mi.has_flag(bsdf.flags(), mi.BSDFFlags.DiffuseReflection) & (scattering.delta ^ True)
        # A mesh whose normals are zero has no frame to say a direction in.
        diffuse &= dr.all(dr.isfinite(scattering.direction))
        dr.scatter(self.place, place, slot, active)
        dr.scatter(self.direction, bin_of(scattering.direction), slot, active & diffuse)
        dr.scatter(self.density, scattering.pdf, slot, active)
        fraction = self._guide.fraction(row, bsdf, active & diffuse)
        guides = self._guide.density(row, scattering.direction, active & diffuse)
        plain = (scattering.pdf - fraction * guides) / (1 - fraction)
        dr.scatter(self.plain, dr.maximum(plain, 0), slot, active)
        dr.scatter(self.throughput, dr.mean(throughput), slot, active)
        dr.scatter(self.before, dr.mean(before), slot, active)
        dr.scatter(self.light, light, slot, active)
        chosen = self._guide.light_probability(row, light, active)
        dr.scatter(self.lit, dr.mean(scattering.value * scattering.incident) * chosen, slot, active)


@dataclass
class Samples:
    """Vertices, (N,) each.

    place: number in the grid. direction: bin of the bounce, NONE where the surface is not diffuse; density: of the
    bounce, per steradian, and plain: that of the BSDF alone. reflected: radiance that it brought, reflected, over its
    density. light: number, of the light that was asked, and lit: the radiance of it that is reflected.
    """

    place: NDArray[np.uint32]
    direction: NDArray[np.uint32]
    density: NDArray[np.float32]
    plain: NDArray[np.float32]
    reflected: NDArray[np.float64]
    light: NDArray[np.uint32]
    lit: NDArray[np.float64]


def _trace(scene: Any, guide: Guide, starts: Any, count: Any, number: int) -> Samples:
    with tracing():
        sampler = IndependentSampler()
        seed = np.random.SeedSequence(SEED, spawn_key=(number,)).generate_state(1)[0]
        sampler.independent.seed(dr.opaque(mi.UInt32, int(seed)), LANES)
        recorder = Recorder(guide.grid, guide, LANES)
        start = dr.minimum(mi.UInt32(sampler.next_1d() * mi.Float(count)), count - 1)
        ray = mi.Ray3f(
            dr.gather(mi.Point3f, starts, start), mi.warp.square_to_uniform_sphere(sampler.next_2d())
        )
        direct, indirect = follow_paths(
            scene.mi_scene, sampler.independent, ray, max_depth=DEPTH, guide=guide, recorder=recorder
        )
        total = dr.mean(direct + indirect)
        dr.eval(total, recorder.arrays)
    known = np.array(recorder.place) != NONE
    lane = np.tile(np.arange(LANES), DEPTH)[known]
    place, direction, light, density, plain, throughput, before, lit = (
        np.array(a)[known] for a in recorder.arrays
    )
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        reflected = (np.array(total)[lane].astype(np.float64) - before) / throughput
    tells = np.isfinite(reflected) & np.isfinite(lit)
    reflected, lit = np.where(tells, np.maximum(reflected, 0), 0), np.where(tells, np.maximum(lit, 0), 0)
    return Samples(place, direction, density, plain, reflected, light, lit.astype(np.float64))


class _Sums:
    """Of all samples so far, by row; row 0 gathers what no place is known for."""

    def __init__(self, shape: tuple[int, ...], place: NDArray[np.uint32], lights: int) -> None:
        """shape: of the grid. place: of the samples of the first pass."""
        x, y, z = shape
        visits = np.bincount(place, minlength=(x * y * z + 1) * FACES)
        places = np.flatnonzero(visits >= FEWEST)
        self.rows = np.zeros(len(visits), dtype=np.uint32)
        self.rows[places] = np.arange(len(places)) + 1
        self._near = _neighbours(self.rows[:-FACES].reshape(z, y, x, FACES), places)
        count = len(places) + 1
        self.reflected, self.squares = np.zeros((count, BINS)), np.zeros((count, BINS))
        self.bounces = np.zeros(count)
        self.lit, self.asked = np.zeros((count, lights)), np.zeros((count, lights))
        self.moments, self.judged = np.zeros((count, len(FRACTIONS))), np.zeros(count)

    def add(self, samples: Samples) -> None:
        row = self.rows[samples.place].astype(np.int64)
        went = samples.direction != NONE
        item = row[went] * BINS + samples.direction[went]
        brought = samples.reflected[went]
        for sums, values in (
            (self.reflected, brought),
            (self.squares, np.square(brought) * samples.density[went]),
        ):
            sums += np.bincount(item, values, minlength=sums.size).reshape(sums.shape)
        self.bounces += np.bincount(row[went], minlength=len(self.bounces))
        item = row * self.lit.shape[1] + samples.light
        self.lit += np.bincount(item, np.square(samples.lit), minlength=self.lit.size).reshape(self.lit.shape)
        self.asked += np.bincount(item, minlength=self.lit.size).reshape(self.lit.shape)

    def judge_anew(self) -> None:
        """Forget the moments: what is known has changed."""
        self.moments[:], self.judged[:] = 0, 0

    def add_moments(self, samples: Samples, guide: Distributions) -> None:
        """Second moments of bounces by each of FRACTIONS, from samples that `guide` has not been learned from.

        Each was drawn with a known density, so its moment is known for every other one (Veach 1997, section 2.5.2).
        """
        went = (samples.direction != NONE) & (samples.density > 0)
        row, drawn = self.rows[samples.place[went]].astype(np.int64), samples.density[went].astype(np.float64)
        guided, plain = guide.directions[row, samples.direction[went]] / BIN_AREA, samples.plain[went]
        moment = np.square(samples.reflected[went]) * drawn
        for k, fraction in enumerate(FRACTIONS):
            density = (1 - fraction) * plain + fraction * guided
            values = np.divide(moment, density, out=np.zeros_like(moment), where=density > 0)
            self.moments[:, k] += np.bincount(row, values, minlength=len(self.judged))
        self.judged += np.bincount(row, minlength=len(self.judged))

    def _blended(
        self, sums: NDArray[np.float64], count: NDArray[np.float64], prior: int
    ) -> NDArray[np.float64]:
        """Means of samples, drawn towards those of the places around."""
        around = self._near @ sums / np.maximum(self._near @ count, 1)
        return np.asarray((sums + prior * around) / (count + prior))

    def fractions(self) -> NDArray[np.float64]:
        """(E,) of FRACTIONS, once all samples are judged."""
        return np.asarray(FRACTIONS)[self._mean_moments().argmin(axis=1)]

    def _mean_moments(self) -> NDArray[np.float64]:
        return self._blended(self.moments, self.judged[:, None], PRIOR_OF_DIRECTIONS)

    def gain_of_directions(self) -> float:
        """Share of the second moment of bounces that directions of the guide take away, in the mean over judged ones.

        Place by place: a sum over all of them would be that of the few brightest samples.
        """
        moments = self._mean_moments()
        plain, best = moments[:, 0], moments.min(axis=1)
        left = np.divide(best, plain, out=np.ones_like(best), where=plain > 0)
        return float(1 - self.judged @ left / self.judged.sum()) if self.judged.any() else 0.0

    def learned(
        self, plain: NDArray[np.float64], fraction: NDArray[np.float64] | float = LEARNING_FRACTION
    ) -> Distributions:
        """plain: (L,) probabilities of the lights without a guide. fraction: of directions that the guide chooses."""
        even = np.full(BINS, 1 / BINS)
        count = self.bounces[:, None]
        means, known = _distributions(self._blended(self.reflected, count, PRIOR_OF_DIRECTIONS), even)
        squares = self._blended(self.squares, count, PRIOR_OF_DIRECTIONS)
        spreads, _ = _distributions(np.sqrt(squares), even)
        directions = (1 - SPREAD) * means + SPREAD * spreads
        # In proportion to the root of the second moment, the variance of a light's sample is least.
        lights, _ = _distributions(np.sqrt(self._blended(self.lit, self.asked, PRIOR)), plain)
        return Distributions(
            self.rows,
            (1 - LIGHT_FLOOR) * lights + LIGHT_FLOOR * plain,
            (1 - FLOOR) * directions + FLOOR * even,
            np.where(known, fraction * self.bounces / (self.bounces + DOUBT), 0.0),
        )


def _distributions(
    values: NDArray[np.float64], otherwise: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Rows divided by their sums, and which of them are known; another distribution where a row is not, as the first.

    values: (E, N), ≥ 0. otherwise: (N,). Divided by the largest first, since sums of huge values overflow.
    """
    scaled = values / np.maximum(values.max(axis=1, keepdims=True), np.finfo(np.float64).tiny)
    total = scaled.sum(axis=1, keepdims=True)
    known = np.asarray(total[:, 0] > 0)
    known[0] = False
    return np.where(known[:, None], scaled / np.where(total > 0, total, 1), otherwise), known


def _neighbours(rows: NDArray[np.uint32], places: NDArray[np.int64]) -> Any:
    """Sparse (E, E): 1 where two rows stand for the same face of cells that touch. rows: (z, y, x, FACES), of cells.

    places: of rows from 1 on; what lies outside comes last, and is a neighbour of itself alone.
    """
    from scipy.sparse import csr_array

    padded = np.pad(rows, ((1, 1), (1, 1), (1, 1), (0, 0)))
    cells = places[places < rows.size]
    at = np.stack(np.unravel_index(cells, rows.shape))
    outside = np.arange(len(cells), len(places)) + 1
    own, near = [outside], [outside]
    for step in np.ndindex(3, 3, 3):
        other = padded[at[0] + step[0], at[1] + step[1], at[2] + step[2], at[3]]
        own.append(np.arange(len(cells))[other > 0] + 1)
        near.append(other[other > 0])
    pairs = np.concatenate(own), np.concatenate(near).astype(np.int64)
    count = len(places) + 1
    return csr_array((np.ones(len(pairs[0])), pairs), shape=(count, count))


def _starts(scene: Any) -> NDArray[np.float64]:
    """(N, 3) points all over the room; in a scene that encloses nothing, free ones next to its shapes."""
    try:
        return free_space(scene, START_ROUNDS)
    except NoFreeSpace:
        points = beginnings(scene)
        return points[surroundings(scene, points)[0]] if len(points) else points


def _unguided(emitters: Sequence[Any]) -> NDArray[np.float64]:
    """(L,) probabilities with which Mitsuba draws the lights: by their sampling weights."""
    weights = np.array([emitter.sampling_weight() for emitter in emitters], dtype=np.float64)
    return weights / weights.sum()


class _Learner:
    """Passes over a scene, each guided by what those before it have found."""

    def __init__(
        self, scene: Any, portals: Any, plain: NDArray[np.float64], points: NDArray[np.float64]
    ) -> None:
        """plain: (L,) probabilities of the lights without a guide. points: (N, 3), where paths start."""
        self.scene, self.portals, self.plain = scene, portals, plain
        self.grid = Grid(points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN)
        # Two rows: arrays with one entry would make another kernel.
        self.learned = Distributions(
            np.zeros(self.grid.places, np.uint32), np.tile(plain, (2, 1)), np.ones((2, BINS)), np.zeros(2)
        )
        self.sums: _Sums | None = None
        self._starts, self._count = mi.Float(points.astype(np.float32).ravel()), len(points)
        dr.make_opaque(self._starts)
        self._numbers = itertools.count()

    def guide(self, *, directions: bool = True) -> Guide:
        return Guide(self.scene.mi_scene, self.portals, self.grid, self.learned, directions=directions)

    def go_on(self, launches: int) -> _Sums:
        """One pass. What it finds judges what was known before it."""
        guide, sums = self.guide(), self.sums
        if sums is not None:
            sums.judge_anew()
        for number in itertools.islice(self._numbers, launches):
            samples = _trace(self.scene, guide, self._starts, dr.opaque(mi.UInt32, self._count), number)
            if sums is None:
                sums = _Sums(self.grid.shape, samples.place, len(self.plain))
            sums.add(samples)
            if self.sums is not None:
                sums.add_moments(samples, self.learned)
        assert sums is not None
        self.sums, self.learned = sums, sums.learned(self.plain)
        return sums


def learn(scene: Any) -> Guide | None:
    """The guide of a `Scene` as it is lit now; None where there is nothing to learn, or under the scalar variant."""
    if is_scalar() or not lights_of(scene.mi_scene):
        return None
    points = _starts(scene)
    if not len(points):
        return None
    portals = scene.portals if scene.portals is not None and float(scene.portals.fraction[0]) > 0 else None
    plain = _unguided(lights_of(scene.mi_scene))
    if portals is not None:
        fraction = float(portals.fraction[0])
        plain = np.append((1 - fraction) * plain, fraction)
    learner = _Learner(scene, portals, plain, points)
    for launches in PASSES:
        sums = learner.go_on(launches)
    directions = sums.gain_of_directions() > DIRECTIONS_PAY
    if directions:
        for launches in PASSES_OF_DIRECTIONS:
            sums = learner.go_on(launches)
        learner.learned = sums.learned(plain, sums.fractions())
    return learner.guide(directions=directions)
