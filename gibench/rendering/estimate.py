"""Radiance of a frame from path samples: passes, sums, and the standard error of the result.

Stratified samples of one pixel are not independent, so their own spread would overstate the error. They are
therefore drawn in groups: each is a stratified set, the groups are independent of one another, and the spread of
the group means is an unbiased measure of the error (random groups: Wolter, "Introduction to Variance Estimation",
2007, chapter 2).
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.errors import GibenchError
from gibench.rendering.backend import is_scalar, tracing
from gibench.rendering.camera import PinholeCamera, RayGenerator
from gibench.rendering.channels import PARTS
from gibench.rendering.scene import Scene

LANES = 1 << 22
"""Paths in flight at once, so that memory stays the same for every spp and resolution (about 0.5 GB). Every launch
costs a quarter of a second of tracing Python, so a small frame of 64 samples is one launch."""

MINIMUM_GROUPS = 16
"""With 16 groups the standard error is itself known to 1/√30 = 18 %."""

MAXIMUM_LEVELS = 3
"""Groups of 64 at most, which is what one pass draws."""

ROUND = 64
"""Samples a pixel that are added at a time until a target error is met."""

SMALLEST = float(np.finfo(np.float32).tiny)
"""Radiance below which the spread of groups counts as 0."""

RELATIVE_FLOOR = 0.01
"""Pixels darker than this share of the frame's mean luminance are left out of its median relative error."""

GUIDES = ("albedo", "normal")

CUES_LANE = 1 << 20
"""Of the random numbers of radiance cues; those of radiance are counted by samples, of which there are fewer."""


class EstimateError(GibenchError, ValueError):
    """A number of samples, a depth or an error target that cannot be rendered."""


def group_levels(spp: int) -> int:
    """Groups have 4^levels samples: the largest that divides `spp` and leaves MINIMUM_GROUPS groups.

    64 → 1, 256 → 2, 1024 and more → MAXIMUM_LEVELS; 0 (independent samples) where nothing larger will do.
    """
    fits = (n for n in range(MAXIMUM_LEVELS, 0, -1) if spp % 4**n == 0 and spp // 4**n >= MINIMUM_GROUPS)
    return next(fits, 0)


def block_seed(seed: int, samples: int, first_pixel: int) -> int:
    """Seed of the paths of a block of pixels, after so many samples a pixel."""
    return int(np.random.SeedSequence(seed, spawn_key=(samples, first_pixel)).generate_state(1)[0])


@dataclass
class Estimate:
    """Running means over (H·W) pixels, in float64, from groups of 4^levels samples.

    sums: part → (H·W, 3), summed over samples. mean and squares: (H·W, 3), mean of the group means of color and the
    sum of their squared deviations. seconds: inside the renderer's kernels. invalid: paths that came back
    with NaN or infinity and count as 0.
    """

    pixels: int
    levels: int
    sums: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    mean: NDArray[np.float64] = field(init=False)
    squares: NDArray[np.float64] = field(init=False)
    groups: int = 0
    spp: int = 0
    seconds: float = 0.0
    invalid: int = 0

    def __post_init__(self) -> None:
        self.mean = np.zeros((self.pixels, 3))
        self.squares = np.zeros((self.pixels, 3))

    def part(self, name: str) -> NDArray[np.float64]:
        """Mean of one part or guide, (H·W, 3)."""
        return self.sums[name] / self.spp

    @property
    def standard_error(self) -> NDArray[np.float64]:
        """Of the mean color, (H·W, 3). Needs two groups."""
        if self.groups < 2:
            raise EstimateError("color_se needs at least 2 samples a pixel: raise spp, or leave color_se out")
        return np.sqrt(self.squares / (self.groups * (self.groups - 1)))

    @property
    def median_error(self) -> float:
        """Median over pixels of the relative standard error of color (its components averaged).

        Pixels with less than RELATIVE_FLOOR of the frame's mean are left out. 0 for a black frame.
        """
        color = self.mean.mean(axis=1)
        bright = color > RELATIVE_FLOOR * color.mean()
        if not bright.any():
            return 0.0
        return float(np.median(self.standard_error.mean(axis=1)[bright] / color[bright]))


@dataclass(frozen=True)
class _Block:
    """A run of pixels in row order, and what is to be traced through each of them."""

    width: int
    first_pixel: int
    pixels: int
    samples: int
    levels: int
    seed: int
    max_depth: int
    guides: bool

    @property
    def groups(self) -> int:
        """Groups of samples in each pixel."""
        return self.samples // 4**self.levels


@dataclass(frozen=True)
class _Launched:
    """Over the samples of each pixel of a block.

    parts: name → (pixels, 3), means. mean, squares: (pixels, 3) float64, mean of the group means of color and the sum
    of their squared deviations from it. invalid: paths that came back with NaN or infinity and count as 0.
    """

    parts: dict[str, NDArray[np.float32]]
    mean: NDArray[np.float64]
    squares: NDArray[np.float64]
    invalid: int


def _launch(scene: Scene, camera: PinholeCamera, resolution: tuple[int, int], block: _Block) -> _Launched:
    """Traces a block as one kernel, which is recorded for the first one of its size."""
    import drjit as dr
    import mitsuba as mi

    from gibench.rendering.replay import camera_arrays, replayed
    from gibench.rendering.sampling import permutations

    varying = [dr.opaque(mi.UInt32, n) for n in (block.seed, block.first_pixel, block.width)]
    sizes = (block.pixels, block.samples, block.levels, block.max_depth, block.guides)
    kernel = replayed(scene, "radiance", _traced, permutations(str(mi.variant())))
    traced = kernel(camera_arrays(camera, resolution), *varying, *sizes)
    parts, means, squares, count = traced

    def stacked(components: Any) -> NDArray[np.float32]:
        return np.stack([np.array(c) for c in components], axis=-1)

    values = stacked(means).astype(np.float64)
    return _Launched(
        {name: stacked(value) for name, value in parts.items()},
        values,
        stacked(squares).astype(np.float64) * np.square(values),
        int(count[0]),
    )


def _traced(
    scene: Scene,
    camera: dict[str, Any],
    seed: Any,
    first: Any,
    width: Any,
    pixels: int,
    samples: int,
    levels: int,
    max_depth: int,
    guides: bool,
) -> tuple[dict[str, Any], Any, Any, Any]:
    """The sums of a block that `_Launched` holds, on the device; squares over the squared mean."""
    import drjit as dr
    import mitsuba as mi

    from gibench.rendering.integrator import trace_paths
    from gibench.rendering.replay import ray_generator
    from gibench.rendering.sampling import StratifiedSampler

    lanes, groups = pixels * samples, samples // 4**levels
    sampler = StratifiedSampler(seed, lanes, levels)
    pixel = dr.arange(mi.UInt32, lanes) // dr.opaque(mi.UInt32, samples) + first
    row = pixel // width
    corner = mi.Point2f(mi.Float(pixel - row * width), mi.Float(row))
    path = trace_paths(
        scene.mi_scene,
        sampler,
        ray_generator(camera).rays(corner + sampler.next_2d()),
        max_depth=max_depth,
        guides=guides,
        portals=scene.portals,
        layers=scene.layers,
        guide=scene.guide,
    )

    parts = {name: getattr(path, name) for name in PARTS}
    finite = dr.all(dr.isfinite(sum(parts.values())))
    if guides:
        finite &= dr.all(dr.isfinite(path.albedo + path.normal))
    # Divided before they are summed, so that huge radiance does not overflow on the way.
    per_sample = 1 / dr.opaque(mi.Float, samples)
    parts = {name: dr.select(finite, value * per_sample, 0) for name, value in parts.items()}
    if guides:
        parts |= {name: dr.select(finite, getattr(path, name) * per_sample, 0) for name in GUIDES}
    invalid = dr.select(finite, mi.UInt32(0), mi.UInt32(1))
    # One kernel for all of it. A reduction of what is not evaluated yet would trace the paths once more.
    dr.eval(parts, invalid)

    sums = {name: [dr.block_sum(c, samples) for c in value] for name, value in parts.items()}
    means, squares = [], []
    for component in sum(parts[name] for name in PARTS):
        group = dr.block_sum(component, 4**levels) * groups
        mean = dr.block_sum(group / groups, groups)
        # As multiples of the mean, which are at most the number of groups: squares of huge radiance overflow. A mean
        # below the smallest normal number has lost its digits, or is 0 where its groups are not.
        scale = dr.repeat(mean, groups)
        multiple = dr.select(scale >= SMALLEST, group / dr.maximum(scale, SMALLEST), 1)
        means.append(mean)
        squares.append(dr.block_sum(dr.square(multiple - 1), groups))
    count = dr.sum(invalid)
    dr.eval(sums, means, squares, count)
    return sums, means, squares, count


def _launch_scalar(
    scene: Scene, camera: PinholeCamera, resolution: tuple[int, int], block: _Block
) -> _Launched:
    """The same one path at a time, for machines on which Dr.Jit compiles nothing."""
    import mitsuba as mi

    from gibench.rendering.integrator import trace_paths
    from gibench.rendering.sampling import IndependentSampler

    sampler = IndependentSampler()
    generator = RayGenerator(camera, resolution)
    names = [*PARTS, *(GUIDES if block.guides else ())]
    values = np.zeros((len(names), block.pixels, block.samples, 3), dtype=np.float32)
    for p in range(block.pixels):
        sampler.seed((block.seed * 0x9E3779B1 + block.first_pixel + p) % 2**32)
        corner = mi.Point2f((block.first_pixel + p) % block.width, (block.first_pixel + p) // block.width)
        for s in range(block.samples):
            rays = generator.rays(corner + sampler.next_2d())
            path = trace_paths(
                scene.mi_scene,
                sampler,
                rays,
                max_depth=block.max_depth,
                guides=block.guides,
                layers=scene.layers,
            )
            values[:, p, s] = [np.array(getattr(path, name)) for name in names]
    finite = np.isfinite(values).all(axis=(0, -1))
    values[:, ~finite] = 0
    values /= block.samples
    color = values[: len(PARTS)].sum(axis=0)
    groups = color.reshape(block.pixels, block.groups, 4**block.levels, 3).sum(axis=2, dtype=np.float64)
    groups *= block.groups
    mean = groups.mean(axis=1)
    squares = np.square(groups - mean[:, None]).sum(axis=1, dtype=np.float64)
    return _Launched(dict(zip(names, values.sum(axis=2), strict=True)), mean, squares, int((~finite).sum()))


def _add(
    estimate: Estimate,
    scene: Scene,
    camera: PinholeCamera,
    resolution: tuple[int, int],
    samples: int,
    seed: int,
    max_depth: int,
    guides: bool,
) -> None:
    """Adds `samples` paths to every pixel: a block of pixels after the other, so that LANES bounds the memory."""

    launch = _launch_scalar if is_scalar() else _launch
    pixels = max(LANES // samples, 1)
    added = samples // 4**estimate.levels
    total = estimate.groups + added
    for first in range(0, estimate.pixels, pixels):
        count = min(pixels, estimate.pixels - first)
        where = slice(first, first + count)
        number = block_seed(seed, estimate.spp, first)
        start = time.perf_counter()
        block = _Block(resolution[0], first, count, samples, estimate.levels, number, max_depth, guides)
        with tracing():
            launched = launch(scene, camera, resolution, block)
        estimate.seconds += time.perf_counter() - start
        estimate.invalid += launched.invalid
        for name, value in launched.parts.items():
            sums = estimate.sums.setdefault(name, np.zeros((estimate.pixels, 3)))
            sums[where] += value.astype(np.float64) * samples

        # Chan, Golub and LeVeque 1979: pairwise update of mean and squared deviations.
        shift = launched.mean - estimate.mean[where]
        estimate.squares[where] += launched.squares
        estimate.squares[where] += np.square(shift) * (estimate.groups * added / total)
        estimate.mean[where] += shift * (added / total)
    estimate.groups = total
    estimate.spp += samples


def estimate_radiance(
    scene: Scene,
    camera: PinholeCamera,
    resolution: tuple[int, int],
    *,
    spp: int | None = None,
    error: float | None = None,
    spp_cap: int = 4096,
    seed: int = 0,
    max_depth: int = 8,
    guides: bool = False,
) -> Estimate:
    """Traces paths until `spp` samples a pixel are there, or until the median relative error is below `error`.

    Give one of spp (≥ 1) and error (> 0; a multiple of ROUND samples, at most spp_cap). seed: any integer ≥ 0.
    max_depth: scattering events, ≥ 0. guides: also sum first-hit albedo and normal, for the denoiser.
    Raises EstimateError for numbers out of range.
    """
    if (spp is None) == (error is None):
        raise EstimateError("give either spp or error")
    if spp is not None and spp < 1:
        raise EstimateError(f"spp is {spp}: at least 1 sample a pixel is needed")
    if error is not None and not error > 0:
        raise EstimateError(f"error is {error}: the target must be above 0 (0.02 is 2 %)")
    if spp_cap < ROUND and error is not None:
        raise EstimateError(f"the cap of {spp_cap} samples is below one round of {ROUND}")
    if max_depth < 0:
        raise EstimateError(f"max_depth is {max_depth}: it counts scattering events, from 0")

    _ = scene.guide, scene.portals  # learned before the clock of the kernels runs
    width, height = resolution
    estimate = Estimate(width * height, group_levels(spp if spp is not None else ROUND))
    goal = spp if spp is not None else spp_cap - spp_cap % ROUND
    while estimate.spp < goal:
        samples = min(ROUND, goal - estimate.spp)
        _add(estimate, scene, camera, resolution, samples, seed, max_depth, guides)
        if error is not None and estimate.median_error < error:
            break
    return estimate


def frame_of(values: NDArray[Any], resolution: tuple[int, int]) -> NDArray[np.float32]:
    """(H·W, C) as a float32 image (H, W, C)."""
    width, height = resolution
    return values.reshape(height, width, -1).astype(np.float32)


def estimate_cues(
    scene: Scene, camera: PinholeCamera, resolution: tuple[int, int], *, spp: int, seed: int = 0
) -> dict[str, NDArray[np.float32]]:
    """Radiance cues of a frame, and the guides that denoise them: name → (H, W, 3).

    Raises EstimateError for less than one sample a pixel, or under the scalar variant.
    """
    if spp < 1:
        raise EstimateError(f"spp is {spp}: radiance cues need at least 1 sample a pixel")
    if is_scalar():
        raise EstimateError(
            "radiance cues take many rays, for which scalar_rgb is too slow: use another variant"
        )
    import drjit as dr
    import mitsuba as mi

    from gibench.rendering.light_cues import cue_images
    from gibench.rendering.replay import camera_arrays, replayed

    width, height = resolution
    at_once = min(spp, ROUND)
    pixels = max(LANES // at_once, 1)
    total: dict[str, NDArray[np.float64]] = {}
    kernel, eye = replayed(scene, "cues", cue_images), camera_arrays(camera, resolution)
    for done in range(0, spp, at_once):
        samples = min(at_once, spp - done)
        for first in range(0, width * height, pixels):
            count = min(pixels, width * height - first)
            number = int(
                np.random.SeedSequence(seed, spawn_key=(CUES_LANE, done, first)).generate_state(1)[0]
            )
            varying = [dr.opaque(mi.UInt32, n) for n in (number, first, width)]
            for name, value in kernel(eye, *varying, count, samples).items():
                sums = total.setdefault(name, np.zeros((width * height, 3)))
                # Component by component: interleaving would take a kernel of its own for every size.
                found = np.stack([np.array(part) for part in value], axis=-1)
                sums[first : first + count] += found.astype(np.float64) * (samples / spp)
    return {name: frame_of(value, resolution) for name, value in total.items()}
