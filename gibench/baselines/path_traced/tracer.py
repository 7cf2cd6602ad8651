"""The real-time path tracer that the papers compare with: every light path, a few samples, then a denoiser.

Rodriguez et al. 2020 ("Glossy Probe Reprojection for Interactive Global Illumination"), section 7.3.1: paths of all
kinds in the same time as the method that is compared, which came to 2 a pixel, then OptiX's denoiser. Here it is Open
Image Denoise with albedo and normal as guides.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi
import numpy as np

from gibench.baselines.first_hits import averaged
from gibench.baselines.method import PARTS, Prediction, Setting, Site, View
from gibench.baselines.stages import Stages
from gibench.rendering.denoise import denoise
from gibench.rendering.integrator import trace_paths
from gibench.rendering.replay import Replay, camera_arrays, ray_generator
from gibench.rendering.sampling import IndependentSampler
from gibench.rendering.scene import Scene

LANES = 1 << 22
"""Paths in flight at once, so that 32 samples of a large frame need no more memory than 2 of them."""

GUIDES = ("albedo", "normal")


def trace_rows(
    scene: Scene, max_depth: int, parts: tuple[str, ...], camera, seed, first, width, pixels: int, spp: int
) -> dict[str, Any]:
    """GUIDES, "full" and other parts of rows of a frame, each mi.Color3f of `pixels` lanes.

    first: row. pixels, spp: how many.
    """
    # Independent samples: strata make frames that are denoised no better, and each size of them is a kernel.
    sampler = IndependentSampler()
    sampler.independent.seed(seed, pixels * spp)
    # Opaque, so that all numbers of samples share one kernel.
    pixel = dr.arange(mi.UInt32, pixels * spp) // dr.opaque(mi.UInt32, spp)
    row = pixel // width
    corner = mi.Point2f(mi.Float(pixel - row * width), mi.Float(row + first))
    path = trace_paths(
        scene.mi_scene,
        sampler,
        ray_generator(camera).rays(corner + sampler.next_2d()),
        max_depth=max_depth,
        guides=True,
        portals=scene.portals,
        layers=scene.layers,
    )
    diffuse = path.direct_diffuse + path.indirect_diffuse
    specular = path.direct_specular + path.indirect_specular
    indirect = path.indirect_diffuse + path.indirect_specular
    lit = path.emission + diffuse + specular
    images = {"full": lit, "diffuse": diffuse, "specular": specular, "indirect": indirect}
    images["direct_diffuse"] = path.direct_diffuse
    values: dict[str, Any] = {name: image for name, image in images.items() if name in ("full", *parts)}
    values |= {"albedo": path.albedo, "normal": path.normal}
    # A path that overflows counts as black. Shares are summed, so that huge radiance does not overflow on the way.
    finite = dr.all(dr.isfinite(sum(values.values())))
    share = dr.rcp(dr.opaque(mi.Float, spp))
    values = {name: dr.select(finite, value * share, 0) for name, value in values.items()}
    # One kernel for all of it. A reduction of what is not evaluated yet would trace the paths once more.
    dr.eval(values)
    sums = {name: mi.Color3f(*(dr.block_sum(c, spp) for c in value)) for name, value in values.items()}
    dr.eval(sums)
    return sums


class PathTracer:
    """Method `path-traced`; nothing is prepared."""

    max_depth: ClassVar[int | None] = None
    """Scattering events of a path; None for as many as the light of the site has."""

    def __init__(self, settings: Mapping[str, Setting]) -> None:
        """settings: spp, denoise."""
        self.adjust(settings)

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings from the next frame on."""
        self._spp, self._denoise = int(settings["spp"]), bool(settings["denoise"])

    def prepare(self, site: Site) -> None:
        """Keep the scene."""
        self._parts = self.parts_of(site)
        depth = site.max_depth if self.max_depth is None else self.max_depth
        self._kernel = Replay(site.scene, partial(trace_rows, site.scene, depth, tuple(self._parts)))

    @staticmethod
    def parts_of(site: Site) -> list[str]:
        """Names of the images that are traced, "full" first."""
        return ["full", *(part for part in PARTS if part in site.parts)]

    def render(self, view: View, stages: Stages) -> Prediction:
        """Trace, then denoise the image as a whole, as a renderer shows it.

        The sum of lobes denoised apart is worse below 8 paths a pixel: what one lacks is what the other has noise in.
        """
        parts = self.images(view, stages, ("full",))
        return Prediction(parts["full"], **{part: parts[part] for part in PARTS if part in parts})

    def images(self, view: View, stages: Stages, shown: Sequence[str]) -> dict[str, Any]:
        """Parts of a frame, denoised where that is set, and GUIDES as they were sampled: (H, W, 3).

        shown: parts that the frame is made of. Others, which are scored alone, are functions of no arguments where they
        are denoised, to be called outside of the clock.
        """
        parts = self.traced(view, stages)
        if not self._denoise:
            return parts
        scored = {part: partial(denoised, parts, part) for part in self._parts if part not in shown}
        with stages.stage("denoising"):
            return parts | scored | {part: denoised(parts, part) for part in shown}

    def traced(self, view: View, stages: Stages) -> dict[str, Any]:
        """Parts of a frame and GUIDES as they were sampled, (H, W, 3)."""
        with stages.stage("ray casting"):
            found = self._traced(view)
            return {name: averaged(found[name], view.resolution) for name in (*self._parts, *GUIDES)}

    def _traced(self, view: View) -> dict[str, Any]:
        """Result of `trace_rows` with a lane a pixel, means over its samples."""
        width, height = view.resolution
        camera = camera_arrays(view.camera, view.resolution)
        rows = max(LANES // (width * self._spp), 1)
        parts = []
        for first in range(0, height, rows):
            count = min(rows, height - first)
            seed = int(np.random.SeedSequence(view.seed, spawn_key=(first,)).generate_state(1)[0])
            # Numbers that are not opaque are part of the recording.
            varying = [dr.opaque(mi.UInt32, number) for number in (seed, first, width)]
            images = self._kernel(camera, *varying, count * width, self._spp)
            parts.append(images)
        if len(parts) == 1:
            return parts[0]
        return {
            name: mi.Color3f(*(dr.concat([part[name][c] for part in parts]) for c in range(3)))
            for name in parts[0]
        }


def denoised(traced: Mapping[str, Any], part: str) -> Any:
    """One of the parts of `PathTracer.traced`, denoised by its GUIDES: (H, W, 3)."""
    guides = {name: np.asarray(traced[name]) for name in GUIDES}
    return mi.TensorXf(denoise(np.asarray(traced[part]), **guides))
