"""One frame with all the channels that were asked for."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.rendering.camera import PinholeCamera, check_resolution
from gibench.rendering.channels import CUES, PARTS, SAMPLED, SETS, resolve
from gibench.rendering.denoise import denoise_part, mean_change
from gibench.rendering.estimate import (
    GUIDES,
    Estimate,
    EstimateError,
    estimate_cues,
    estimate_radiance,
    frame_of,
)
from gibench.rendering.scene import Scene

MAX_DEPTH = 8
"""Scattering events by default: what later bounces would add to a furnished room is below one per cent."""


@dataclass(frozen=True, eq=False)
class RenderedFrame:
    """A frame's channels and how they came to be.

    arrays: channel → (H, W, C) float32, or uint32 for ids. spp: samples a pixel (0 where no radiance was asked for).
    paths: that were traced. invalid_paths: of these, how many came back with NaN or infinity and count as 0.
    median_error: median relative standard error of color over the pixels, before denoising (NaN where unknown).
    kernel_seconds: inside the renderer; denoise_seconds; seconds: all of it. denoise_change: by how much denoising
    changed the mean of a part, relative, of the part and the channel where it is most.
    """

    arrays: dict[str, NDArray[Any]]
    spp: int
    paths: int
    invalid_paths: int
    median_error: float
    kernel_seconds: float
    denoise_seconds: float
    seconds: float
    denoise_change: float = 0.0


def _radiance(
    estimate: Estimate, names: Sequence[str], resolution: tuple[int, int], denoise: bool
) -> tuple[dict[str, NDArray[Any]], float]:
    parts = {name: frame_of(estimate.part(name), resolution) for name in PARTS}
    sampled = {name: parts[part] for name, part in SAMPLED.items()}
    change = 0.0
    if denoise:
        guides = {name: frame_of(estimate.part(name), resolution) for name in ("albedo", "normal")}
        # What is seen straight has no noise but that of its edges, which are meant to stay as they are.
        clean = {name: denoise_part(parts[name], **guides) for name in PARTS if name != "emission"}
        whole = float(sum(part.mean((0, 1), dtype=np.float64) for part in parts.values()).max())
        change = max((mean_change(clean[name], parts[name], whole=whole) for name in clean), key=abs)
        parts |= clean
    result: dict[str, NDArray[Any]] = parts | sampled
    color = np.zeros_like(parts["emission"])
    for name in PARTS:
        color += parts[name]
    result["color"] = color
    if "color_se" in names:
        result["color_se"] = frame_of(estimate.standard_error, resolution)
    return {name: result[name] for name in names}, change


def render_frame(
    scene: Scene,
    camera: PinholeCamera,
    *,
    resolution: tuple[int, int],
    channels: Sequence[str] = ("radiance", "surface"),
    spp: int | None = None,
    error: float | None = None,
    spp_cap: int = 4096,
    seed: int = 0,
    max_depth: int = MAX_DEPTH,
    denoise: bool = False,
    previous_camera: PinholeCamera | None = None,
) -> RenderedFrame:
    """Renders one frame.

    scene: from `load_scene`. resolution: (width, height). channels: names of channels or sets; what is not named is
    not computed. spp or error: samples a pixel, or the median relative standard error to reach with at most spp_cap
    samples. seed: decides every pixel, together with the variant and the versions. denoise: removes the noise of each
    radiance part and cue on its own; color stays their sum, and color_se stays that of the samples. previous_camera:
    for the motion channels.

    Raises UnknownChannelError, CameraError, EstimateError or DenoiserError.
    """
    start = time.perf_counter()
    width, height = check_resolution(resolution)
    names = resolve(channels)
    radiance = [n for n in names if n in SETS["radiance"] or n in SAMPLED]
    cues = [n for n in names if n in CUES]
    rest = [n for n in names if n not in radiance and n not in CUES]
    arrays: dict[str, NDArray[Any]] = {}
    estimate = Estimate(0, 0)
    denoise_seconds = denoise_change = 0.0
    if radiance:
        estimate = estimate_radiance(
            scene,
            camera,
            (width, height),
            spp=spp,
            error=error,
            spp_cap=spp_cap,
            seed=seed,
            max_depth=max_depth,
            guides=denoise,
        )
        before = time.perf_counter()
        denoised, denoise_change = _radiance(estimate, radiance, (width, height), denoise)
        arrays |= denoised
        denoise_seconds = time.perf_counter() - before if denoise else 0.0
    kernel_seconds = estimate.seconds
    if cues:
        if not (estimate.spp or spp):
            raise EstimateError(
                "radiance cues need spp where no radiance is asked for: give it in place of error"
            )
        before = time.perf_counter()
        sampled = estimate_cues(scene, camera, (width, height), spp=estimate.spp or spp or 0, seed=seed)
        kernel_seconds += time.perf_counter() - before
        before = time.perf_counter()
        guides = {name: sampled[name] for name in GUIDES}
        arrays |= {n: denoise_part(sampled[n], **guides) if denoise else sampled[n] for n in cues}
        denoise_seconds += time.perf_counter() - before if denoise else 0.0
    if rest:
        from gibench.rendering.gbuffer import render_gbuffer

        before = time.perf_counter()
        arrays |= render_gbuffer(scene, camera, (width, height), rest, previous_camera=previous_camera)
        kernel_seconds += time.perf_counter() - before
    return RenderedFrame(
        arrays={name: arrays[name] for name in names},
        spp=estimate.spp,
        paths=estimate.spp * width * height,
        invalid_paths=estimate.invalid,
        median_error=estimate.median_error if estimate.groups > 1 else float("nan"),
        kernel_seconds=kernel_seconds,
        denoise_seconds=denoise_seconds,
        seconds=time.perf_counter() - start,
        denoise_change=denoise_change,
    )
