"""The method `ltc-direct`, and the direct light and radiance cues that networks on the track are given."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.baselines.first_hits import averaged
from gibench.baselines.linearly_transformed_cosines.rectangle import light_arrays
from gibench.baselines.linearly_transformed_cosines.shading import ratios, sampled, unshadowed
from gibench.baselines.linearly_transformed_cosines.table import TransformTable
from gibench.baselines.method import MethodError, Prediction, Setting, Site, View
from gibench.baselines.stages import Stages
from gibench.rendering.backend import tracing
from gibench.rendering.channels import CUES
from gibench.rendering.lighting import AreaLight
from gibench.rendering.replay import Replay, camera_arrays
from gibench.rendering.scene import Scene


@dataclass
class Lit:
    """Light at the camera rays of a frame, mi.Color3f each, W·m⁻²·sr⁻¹, a lane a ray in row order.

    emission: seen straight. diffuse, specular: direct light. cues: by name, as the channels have them; none unless
    they are asked for. surfaces: what the rays hit, mi.PreliminaryIntersection3f.
    """

    emission: Any
    diffuse: Any
    specular: Any
    cues: dict[str, Any]
    surfaces: Any


class RectangleLight:
    """A scene under one rectangle of light, a frame after the other."""

    def __init__(self, scene: Scene, *, cues: bool = False) -> None:
        """cues: whether the basis materials of `gibench.rendering.light_cues` are lit too."""
        self.cues = cues
        table = TransformTable()
        replay = partial(Replay, scene)
        self._unshadowed = replay(partial(unshadowed, scene, table), table.values)
        self._sampled = replay(partial(sampled, scene, table), table.values)

    def lit(
        self,
        view: View,
        area: AreaLight,
        resolution: tuple[int, int],
        shadow_rays: int,
        stages: Stages,
    ) -> Lit:
        """Light a frame. resolution: (width, height) of the grid of camera rays."""
        camera, light = camera_arrays(view.camera, resolution), light_arrays(area)
        seed = dr.opaque(mi.UInt32, view.seed % 2**32)
        with stages.stage("g-buffer"):
            surfaces, emission, lobes, guides = self._unshadowed(light, camera, self.cues, *resolution)
        with stages.stage("shadow rays"):
            models = {name: model for name, (_, model) in lobes.items()}
            sums, disagreement, mirrored = self._sampled(
                light, camera, surfaces, models, seed, shadow_rays, *resolution
            )
        with stages.stage("filtering"), tracing():
            colors = {name: color for name, (color, _) in lobes.items()}
            diffuse, specular, cues = _shadowed(
                light, colors, sums, disagreement, guides, mirrored, *resolution
            )
        return Lit(emission, diffuse, specular, dict(zip(CUES, cues, strict=False)), surfaces)


@dr.freeze
def _shadowed(light, colors, sums, disagreement, guides, mirrored, width: int, height: int):
    """Diffuse and specular direct light, and the cues, of which plain surfaces show their own material."""
    shares = ratios(sums, colors, disagreement, guides, width, height)
    lit = {name: color * shares[name] * light["radiance"] for name, color in colors.items()}
    diffuse, specular = lit.pop("diffuse"), lit.pop("specular") + mirrored
    cues = [dr.select(guides["plain"], diffuse, cue) for cue in lit.values()]
    dr.eval(diffuse, specular, cues)
    return diffuse, specular, cues


def area_light(view: View, method: str) -> AreaLight:
    """The area light of a view. Raises MethodError where there is none."""
    area = view.shot.lighting.area
    if area is None:
        raise MethodError(
            f"{method} is for frames under an area light alone, and this one has {view.shot.lighting.kind} light: "
            "run it on the track moving-light"
        )
    return area


class AnalyticLight:
    """See `gibench.baselines.linearly_transformed_cosines.METHOD`."""

    def __init__(self, settings: Mapping[str, Setting]) -> None:
        """settings: shadow_rays, rays."""
        self.adjust(settings)

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings from the next frame on."""
        self._shadow_rays = int(settings["shadow_rays"])
        self._grid = math.isqrt(int(settings["rays"]))

    def prepare(self, site: Site) -> None:
        """Put the table on the device."""
        self._light = RectangleLight(site.scene)

    def render(self, view: View, stages: Stages) -> Prediction:
        """Direct light; the indirect part is black."""
        fine = (view.resolution[0] * self._grid, view.resolution[1] * self._grid)
        area = area_light(view, "ltc-direct")
        found = self._light.lit(view, area, fine, self._shadow_rays, stages)
        with stages.stage("filtering"):
            seen = found.emission + found.diffuse + found.specular
            color, specular = (averaged(part, fine, self._grid) for part in (seen, found.specular))
        return Prediction(color, specular, indirect=dr.zeros(mi.TensorXf, color.shape))
