"""Baking a lightmap: unwrap, path-trace every texel, fill what is hidden, filter, and keep it with the site."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.baselines.lightmap.coverage import cover
from gibench.baselines.lightmap.denoising import denoise_lightmap
from gibench.baselines.lightmap.filling import dilate, fill_charts
from gibench.baselines.lightmap.lookup import Lightmap, read_lightmap, write_lightmap
from gibench.baselines.lightmap.texel_paths import TexelPoints, hidden, trace_texels
from gibench.baselines.lightmap.unwrapping import LightmapError, Unwrapping, unwrap
from gibench.baselines.method import Setting, Site
from gibench.baselines.stages import Stages
from gibench.rendering.backend import is_scalar
from gibench.rendering.render import MAX_DEPTH
from gibench.rendering.scene import Scene

SEED = 0
"""The lightmap is part of the scene to all methods and seeds."""


@dataclass(frozen=True, eq=False)
class BakedAtlas:
    """A lightmap in memory.

    atlas: (H, W, 3) float32, W·m⁻². charts: (H, W) int32, −1 off all charts. traced: number of texels that paths
    started from. seconds: by step ("unwrapping", "coverage", "hidden points", "paths", "filling").
    """

    unwrapping: Unwrapping
    atlas: NDArray[np.float32]
    charts: NDArray[np.int32]
    traced: int
    seconds: dict[str, float]


def bake_atlas(
    scene: Scene, *, texels_per_metre: float, spp: int, denoise: bool, max_depth: int = MAX_DEPTH
) -> BakedAtlas:
    """Bake in memory.

    spp: paths a texel, a power of two. max_depth: scattering events, that at the texel included. Raises
    LightmapError, DenoiserError.
    """
    if is_scalar():
        raise LightmapError(
            "a lightmap needs llvm_ad_rgb or cuda_ad_rgb: `gibench doctor` says what keeps them away"
        )
    clock = Stages()
    with clock.stage("unwrapping"):
        unwrapping = unwrap(scene, texels_per_metre)
    width, height = unwrapping.size
    if not (unwrapping.charts >= 0).any():  # nothing in the scene is diffuse
        nothing = np.zeros((height, width, 3), dtype=np.float32)
        return BakedAtlas(unwrapping, nothing, np.full((height, width), -1, dtype=np.int32), 0, clock.seconds)
    with clock.stage("coverage"):
        # A point of a texel is worth testing where a few paths will start from it.
        coverage = cover(unwrapping, 2 if spp < 256 else 4)
    charts = np.full((height, width), -1, dtype=np.int32)
    charts.ravel()[coverage.texels] = coverage.charts
    with clock.stage("hidden points"):
        points = TexelPoints(scene, unwrapping, coverage)
        coverage = coverage.without(hidden(points, len(coverage.faces)))
    with clock.stage("paths"):
        points = TexelPoints(scene, unwrapping, coverage)
        values, is_known = trace_texels(points, coverage.first, spp=spp, max_depth=max_depth, seed=SEED)
    with clock.stage("filling"):
        atlas = np.zeros((height * width, 3), dtype=np.float32)
        known = np.zeros((height * width, 3), dtype=bool)
        atlas[coverage.texels], known[coverage.texels] = values, is_known
        atlas = fill_charts(atlas.reshape(height, width, 3), known.reshape(height, width, 3), charts)
        if denoise:
            atlas = denoise_lightmap(atlas, charts)
        atlas = dilate(atlas, charts)
    return BakedAtlas(unwrapping, atlas, charts, len(coverage.texels), clock.seconds)


def baked_lightmap(site: Site, settings: Mapping[str, Setting]) -> Lightmap:
    """The lightmap of a site, baked where it is not there yet.

    settings: a method's, with the knobs of `knobs.LIGHTMAP_KNOBS`. Raises LightmapError, DenoiserError.
    """
    chosen: dict[str, Any] = {
        "texels_per_metre": settings["texels"],
        "spp": settings["lightmap_spp"],
        "denoise": settings["lightmap_denoise"],
        "max_depth": site.max_depth,
    }

    def make(folder: Path) -> None:
        baked = bake_atlas(
            site.scene,
            texels_per_metre=chosen["texels_per_metre"],
            spp=chosen["spp"],
            denoise=chosen["denoise"],
            max_depth=chosen["max_depth"],
        )
        write_lightmap(folder, baked.atlas, baked.unwrapping.corners, baked.unwrapping.offsets)

    return read_lightmap(site.bakes.get("lightmap", chosen, make).folder, site.scene)
