"""The method `elp`: the search, the frames before, and a network that was trained for the scene."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi
import torch
from torch import Tensor

from gibench.baselines.efficient_light_probes import METHOD
from gibench.baselines.efficient_light_probes.examples import Example, examples
from gibench.baselines.efficient_light_probes.implementation import ReflectionSearch
from gibench.baselines.efficient_light_probes.temporal import DECAY, accumulated, reprojected
from gibench.baselines.efficient_light_probes.training import TrainingPlan, trained_network
from gibench.baselines.first_hits import hits_of_rays
from gibench.baselines.image_to_image.device_frames import as_image
from gibench.baselines.method import Prediction, Setting, Site, View
from gibench.baselines.stages import Stages
from gibench.rendering import surface
from gibench.rendering.backend import torch_device
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.gbuffer import mirror_direction
from gibench.rendering.replay import Replay, camera_arrays, ray_generator


def _guides(scene, _lightmap, camera, preliminary, mirrored, glossy, width: int, height: int):
    """Depth (m, along the optical axis) and albedo of the first hits, albedo of what the glossy ones mirror."""
    generator = ray_generator(camera)
    hits = hits_of_rays(scene, generator, (width, height), preliminary)
    depth = dr.select(hits.active, hits.si.t * dr.dot(hits.ray.d, generator.forward), 0)
    albedo = surface.albedo(scene, hits.bsdf, hits.si, hits.active)
    ray = hits.si.spawn_ray(mirror_direction(hits.si, hits.ray.d))
    there = mirrored.compute_surface_interaction(ray, mi.RayFlags.All, glossy)
    reflected = surface.albedo(scene, there.bsdf(ray), there, glossy & there.is_valid())
    dr.eval(depth, albedo, reflected)
    return depth, albedo, reflected


class Reconstruction(ReflectionSearch):
    """See `gibench.baselines.efficient_light_probes.METHOD`."""

    functions: ClassVar = {**ReflectionSearch.functions, "guides": _guides}

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings that do not bake."""
        super().adjust(settings)
        self._past: list[dict[str, Any]] = []

    def prepare(self, site: Site) -> None:
        """Bake the lightmap and the probes, train the network, or find them."""
        super().prepare(site)
        self.kernels["temporal"] = Replay(site.scene, reprojected)
        plan = TrainingPlan.of(self.settings, site.seed)

        def made() -> list[Example]:
            # One training serves all settings that do not bake, whichever of them is rendered first.
            own = self.settings
            self.adjust(METHOD.settings(METHOD.baked_settings(own)))
            found = examples(site, self.inputs, self.forget, temporal=plan.temporal, seed=plan.seed)
            self.adjust(own)
            return found

        trained = trained_network(site, plan, METHOD.baked_settings(self.settings), made)
        self.scale, self.epoch = trained.scale, trained.epoch
        self.network = trained.network.eval().requires_grad_(False).to(torch_device())

    def forget(self) -> None:
        """Begin another path."""
        self._past = []

    def inputs(
        self, camera: PinholeCamera, resolution: tuple[int, int], stages: Stages
    ) -> tuple[Tensor, Tensor, dict[str, float]]:
        """The next frame of a path: radiance (3, H, W), G-buffers (GUIDES, H, W), and numbers about the search."""
        grid, fine = self.grid, (resolution[0] * self.grid, resolution[1] * self.grid)
        arrays = camera_arrays(camera, fine)
        found = self.searched(arrays, fine, stages)
        with stages.stage("g-buffer"):
            depth, albedo, reflected = self.kernels["guides"](
                arrays, found.preliminary, found.mirrored, found.surfaces["glossy"], *fine
            )
            parts = (depth, found.surfaces["normal"], albedo, reflected)
            guides = torch.cat([as_image(part, fine, grid) for part in parts])
        with stages.stage("temporal"):
            color = mi.Color3f(found.base + found.specular)
            if self.settings["temporal"]:
                color = self._with_the_past(arrays, found.surfaces, color, fine)
            return as_image(color, fine, grid), guides, found.effort

    def _with_the_past(self, camera, surfaces, color, fine):
        dr.eval(color)
        frame = {name: surfaces[name] for name in ("position", "normal", "material")}
        frame |= {"color": color, "camera": camera}
        sides = [dr.opaque(mi.Int32, side) for side in fine]
        color = accumulated(color, [self.kernels["temporal"](frame, past, *sides) for past in self._past])
        self._past = [frame, *self._past][: len(DECAY)]
        return color

    def render(self, view: View, stages: Stages) -> Prediction:
        """Search, add the frames before, and let the network mend it."""
        if view.previous is None:
            self.forget()
        color, guides, effort = self.inputs(view.camera, view.resolution, stages)
        with stages.stage("inference"), torch.inference_mode():
            output = self.network(self.scale.compressed(color)[None], self.scale.guides(guides)[None])[0]
            image = self.scale.radiance(output).permute(1, 2, 0).contiguous()
        count = float(self.network.parameter_count)
        extra = {**effort, "parameters": count, "best_epoch": float(self.epoch)}
        return Prediction(image, extra=extra)
