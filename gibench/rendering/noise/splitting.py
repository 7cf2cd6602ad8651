"""The variance of a frame, taken apart.

A pixel is a sum of contributions: by depth, by lobe, by light, by the technique that found them. Along each of these
its variance is the sum of the variances of the terms and of their covariances. Both are estimated without bias from
the same groups of samples as `color_se` (see `estimate`), so that the rows add up to the variance of the frame,
stratification included. A frame of one block is the one that `render_frame` gives for the seed; a larger one is traced
in smaller blocks than there, which have seeds of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from gibench.rendering.backend import is_scalar, tracing
from gibench.rendering.camera import PinholeCamera, check_resolution
from gibench.rendering.estimate import ROUND, EstimateError, block_seed, group_levels
from gibench.rendering.scene import Scene

LANES = 1 << 18
"""Paths at a time, of DEPTHS scattering events at most: each leaves all of its contributions and vertices."""

DEPTHS = 8

TERMS = 1 << 24
"""Sums of a block, at most: its pixels times groups times terms."""

MOST = 1 << 27
"""Sums of a frame, at most: its pixels times terms."""

DARK = 0.01
"""Share of the frame's squared mean that is added to a pixel's, so that dark pixels do not decide the figure."""

AROUND = 5
"""Pixels along a side of the square whose mean stands for a pixel's: its own is high just where its noise is."""

NOISIEST = 0.01
"""Share of the pixels whose part of the variance is told."""

LOBES = ("diffuse, or seen straight", "specular")


@dataclass(frozen=True)
class Term:
    """One summand of a frame. variance: its own, relative; light: its share of the frame's light."""

    name: str
    variance: float
    light: float


@dataclass(frozen=True)
class Split:
    """A frame's variance along one axis: that of each term, and all of their covariances (which may be negative)."""

    terms: tuple[Term, ...]
    covariance: float


@dataclass(frozen=True)
class Vertex:
    """A point at which a path is scattered, m."""

    shape: str
    material: str
    position: tuple[float, float, float]


@dataclass(frozen=True)
class WorstPath:
    """A path that brings much more than its pixel has on average.

    pixel: column and row. contribution: all that it brings, over the mean around the pixel. pixel_share: of the frame's
    variance that its pixel holds. depth, light, technique: of the largest of its contributions. vertices: up to there,
    from the first hit on.
    """

    pixel: tuple[int, int]
    contribution: float
    pixel_share: float
    depth: int
    light: str
    technique: str
    vertices: tuple[Vertex, ...]


@dataclass(frozen=True)
class FrameNoise:
    """Where the noise of a frame is.

    variance: relative, mean over pixels and components of variance / (mean² + DARK · squared mean of the frame), the
    mean over AROUND × AROUND pixels; all other variances are parts of it. noisiest: share of it in the noisiest
    NOISIEST of the pixels. splits: "depth", "lobe", "light", "technique". paths: the worst, one a pixel at most. spp,
    groups: samples a pixel and independent groups of them. invalid_paths: with NaN or infinity, which count as 0.
    """

    resolution: tuple[int, int]
    spp: int
    groups: int
    mean: tuple[float, float, float]
    variance: float
    noisiest: float
    splits: dict[str, Split]
    paths: tuple[WorstPath, ...]
    invalid_paths: int


@dataclass(frozen=True)
class _Frame:
    """What all blocks share."""

    scene: Scene
    camera: PinholeCamera
    resolution: tuple[int, int]
    seed: int
    spp: int
    levels: int
    max_depth: int

    def rounds(self) -> list[tuple[int, int]]:
        """(samples before, samples) of each launch of a pixel."""
        return [(done, min(ROUND, self.spp - done)) for done in range(0, self.spp, ROUND)]

    def contributions(self, first: int, pixels: int, done: int, samples: int) -> Any:
        from gibench.rendering.noise.records import contributions

        with tracing():
            return contributions(
                self.scene,
                self.camera,
                self.resolution,
                seed=block_seed(self.seed, done, first),
                first_pixel=first,
                pixels=pixels,
                samples=samples,
                levels=self.levels,
                max_depth=self.max_depth,
            )


class _Sums:
    """Means and variances of the terms of all pixels: (pixels, terms, 3) by axis, and "all" with one term."""

    def __init__(self, pixels: int, names: dict[str, Sequence[str]]) -> None:
        self.sizes = {"all": 1, **{axis: len(terms) for axis, terms in names.items()}}
        self.means = {axis: np.zeros((pixels, n, 3), np.float32) for axis, n in self.sizes.items()}
        self.variances = {axis: np.zeros((pixels, n, 3), np.float32) for axis, n in self.sizes.items()}
        self.worst = np.zeros(pixels)
        self.worst_at = np.zeros((pixels, 2), np.int64)  # samples before its launch, and its own number there

    def add(self, where: slice, groups: dict[str, list[NDArray[np.float64]]]) -> None:
        """groups: by axis, (pixels, groups, terms, 3) means of each launch."""
        for axis, launched in groups.items():
            values = np.concatenate(launched, axis=1)
            self.means[axis][where] = values.mean(axis=1)
            # Of the mean of the groups. One group tells nothing of its spread.
            count = values.shape[1]
            self.variances[axis][where] = values.var(axis=1, ddof=1) / count


def split_noise(
    scene: Scene,
    camera: PinholeCamera,
    *,
    resolution: tuple[int, int],
    spp: int = 64,
    seed: int = 0,
    max_depth: int = 8,
    paths: int = 5,
    on_pixels: Callable[[int, int], None] = lambda done, of: None,
) -> FrameNoise:
    """Traces a frame and says where its noise is.

    resolution: (width, height). spp: samples a pixel, at least 2. paths: how many of the worst to name. on_pixels:
    told how many pixels are done, and of how many.

    Raises CameraError, or EstimateError for numbers out of range, for a frame too large to be taken apart, and under
    the scalar variant.
    """
    width, height = check_resolution(resolution)
    levels = group_levels(spp) if spp >= 1 else 0
    groups = spp // 4**levels
    if groups < 2:
        raise EstimateError(f"spp is {spp}: at least 2 samples a pixel are needed to see noise")
    if max_depth < 0:
        raise EstimateError(f"max_depth is {max_depth}: it counts scattering events, from 0")
    if is_scalar():
        raise EstimateError("taking noise apart needs many paths, for which scalar_rgb is too slow")
    from gibench.rendering.light_numbers import light_names
    from gibench.rendering.noise.records import TECHNIQUES

    names: dict[str, Sequence[str]] = {
        "depth": [str(depth) for depth in range(max_depth + 1)],
        "lobe": LOBES,
        "light": light_names(scene.mi_scene) or ["none"],
        "technique": TECHNIQUES,
    }
    terms = sum(map(len, names.values())) + 1
    if width * height * terms > MOST:
        raise EstimateError(
            f"{width}x{height} pixels of {terms} terms are too many to be taken apart: at most {MOST // terms} pixels"
        )
    frame = _Frame(scene, camera, (width, height), seed, spp, levels, max_depth)
    sums, invalid = _Sums(width * height, names), 0
    lanes = LANES * DEPTHS // max(max_depth, DEPTHS)
    at_once = max(1, min(lanes // min(spp, ROUND), TERMS // (groups * terms * 3)))
    for first in range(0, width * height, at_once):
        pixels = min(at_once, width * height - first)
        invalid += _block(frame, sums, first, pixels)
        on_pixels(first + pixels, width * height)
    return _told(frame, sums, names, at_once, groups, invalid, paths)


def _block(frame: _Frame, sums: _Sums, first: int, pixels: int) -> int:
    """Adds a block of pixels; returns its invalid paths."""
    where, invalid = slice(first, first + pixels), 0
    groups: dict[str, list[NDArray[np.float64]]] = {axis: [] for axis in sums.sizes}
    for done, samples in frame.rounds():
        found = frame.contributions(first, pixels, done, samples)
        invalid += found.invalid
        in_group = 4**frame.levels
        group = found.lane // in_group
        count = pixels * samples // in_group
        value = found.value.sum(axis=1)
        keys = {"all": None, "depth": found.depth, "light": found.light, "technique": found.technique}
        for axis, key in keys.items():
            item = group if key is None else group * sums.sizes[axis] + key
            total = _binned(item, value, count * sums.sizes[axis])
            groups[axis].append(total.reshape(pixels, -1, sums.sizes[axis], 3) / in_group)
        lobes = np.stack([_binned(group, found.value[:, lobe], count) for lobe in (0, 1)], axis=1)
        groups["lobe"].append(lobes.reshape(pixels, -1, 2, 3) / in_group)
        brought = _binned(found.lane, value, pixels * samples).mean(axis=1).reshape(pixels, samples)
        best = brought.argmax(axis=1)
        worst = brought[np.arange(pixels), best]
        worse = worst > sums.worst[where]
        sums.worst[where] = np.where(worse, worst, sums.worst[where])
        at = np.stack([np.full(pixels, done), best], axis=1)
        sums.worst_at[where] = np.where(worse[:, None], at, sums.worst_at[where])
    sums.add(where, groups)
    return invalid


def _binned(item: NDArray[np.int64], value: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """(size, 3) sums of (N, 3) values by item."""
    return np.stack([np.bincount(item, component, minlength=size) for component in value.T], axis=-1)


def _told(
    frame: _Frame,
    sums: _Sums,
    names: dict[str, Sequence[str]],
    at_once: int,
    groups: int,
    invalid: int,
    paths: int,
) -> FrameNoise:
    mean = sums.means["all"][:, 0].astype(np.float64)
    width, height = frame.resolution
    around = uniform_filter(mean.reshape(height, width, 3), size=(AROUND, AROUND, 1), mode="nearest").reshape(
        -1, 3
    )
    scale = np.square(around) + DARK * mean.mean() ** 2
    known = scale > 0
    weight = np.where(known, 1 / np.where(known, scale, 1), 0)
    total = float(mean.mean()) or 1.0
    by_pixel = (sums.variances["all"][:, 0] * weight).mean(axis=1)
    variance = float(by_pixel.mean())
    noisiest = np.sort(by_pixel)[len(by_pixel) - int(np.ceil(NOISIEST * len(by_pixel))) :].sum()
    splits = {}
    for axis, terms in names.items():
        parts = [float((sums.variances[axis][:, k] * weight).mean()) for k in range(len(terms))]
        light = [float(sums.means[axis][:, k].mean(dtype=np.float64)) / total for k in range(len(terms))]
        rows = tuple(Term(*row) for row in zip(terms, parts, light, strict=True))
        splits[axis] = Split(rows, variance - sum(parts))
    gray = around.mean(axis=1)
    excess = sums.worst / np.maximum(np.sqrt(np.square(gray) + DARK * gray.mean() ** 2), 1e-30)
    order = np.argsort(-excess, kind="stable")[: max(paths, 0)]
    share = by_pixel / (by_pixel.sum() or 1.0)
    chosen = [int(pixel) for pixel in order if sums.worst[pixel] > 0]
    return FrameNoise(
        resolution=frame.resolution,
        spp=frame.spp,
        groups=groups,
        mean=(float(mean[:, 0].mean()), float(mean[:, 1].mean()), float(mean[:, 2].mean())),
        variance=variance,
        noisiest=float(noisiest / (by_pixel.sum() or 1.0)),
        splits=splits,
        paths=_traced_again(frame, sums, names, at_once, chosen, gray, share),
        invalid_paths=invalid,
    )


def _traced_again(
    frame: _Frame,
    sums: _Sums,
    names: dict[str, Sequence[str]],
    at_once: int,
    chosen: list[int],
    gray: NDArray[np.float64],
    share: NDArray[np.float64],
) -> tuple[WorstPath, ...]:
    """The worst paths of some pixels, in this order. Their launches are repeated, which keeps memory small."""
    launches: dict[tuple[int, int], list[int]] = {}
    for pixel in chosen:
        launches.setdefault((pixel // at_once * at_once, int(sums.worst_at[pixel, 0])), []).append(pixel)
    width, height = frame.resolution
    found: dict[int, WorstPath] = {}
    samples_of = dict(frame.rounds())
    for (first, done), pixels in launches.items():
        samples = samples_of[done]
        traced = frame.contributions(first, min(at_once, width * height - first), done, samples)
        for pixel in pixels:
            lane = (pixel - first) * samples + int(sums.worst_at[pixel, 1])
            own = np.flatnonzero(traced.lane == lane)
            brightest = own[traced.value[own].sum(axis=(1, 2)).argmax()]
            depth = int(traced.depth[brightest])
            vertices = tuple(
                Vertex(
                    _named(frame.scene.shapes, traced.shape[k, lane]),
                    _named(frame.scene.materials, traced.material[k, lane]),
                    tuple(map(float, traced.position[k, lane])),  # type: ignore[arg-type]
                )
                for k in range(depth)
            )
            found[pixel] = WorstPath(
                pixel=(pixel % width, pixel // width),
                contribution=float(sums.worst[pixel] / gray[pixel]),
                pixel_share=float(share[pixel]),
                depth=depth,
                light=names["light"][int(traced.light[brightest])],
                technique=names["technique"][int(traced.technique[brightest])],
                vertices=vertices,
            )
    return tuple(found[pixel] for pixel in chosen)


def _named(names: Sequence[str], number: int) -> str:
    return names[int(number) - 1] if number else "none"
