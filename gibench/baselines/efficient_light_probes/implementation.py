"""The method `elp-search`: diffuse light from the lightmap, glossy light from probes that are searched."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi

from gibench.baselines.efficient_light_probes.search import Reflected, Screen, blended
from gibench.baselines.first_hits import averaged, hits_of_rays
from gibench.baselines.lightmap.deferred import OnLightmap
from gibench.baselines.method import Prediction, Site, View
from gibench.baselines.probes.baking import ProbeSettings
from gibench.baselines.probes.maps import Probes, load_probes
from gibench.baselines.probes.reflections import mirrored_by, surfaces_of
from gibench.baselines.stages import Stages
from gibench.rendering.replay import Replay, camera_arrays, ray_generator

MAPS = ("radiance", "material_id", "reflected_position", "reflected_material_id")


def _gbuffer(scene, lightmap, camera, width: int, height: int):
    """First hits, their radiance but for glossy light, and the surfaces that a search walks over."""
    hits = hits_of_rays(scene, ray_generator(camera), (width, height))
    base = hits.emission + lightmap.diffuse(hits.si, hits.preliminary, hits.active)
    surfaces = surfaces_of(scene, hits)
    dr.eval(hits.preliminary, base, surfaces)
    return hits.preliminary, base, surfaces


def _mirrored(scene, _lightmap, camera, preliminary, glossy, width: int, height: int):
    """Mirror hit of each glossy hit: the point, or the direction where that is nothing.

    And the mi.PreliminaryIntersection3f of it.
    """
    hits = hits_of_rays(scene, ray_generator(camera), (width, height), preliminary)
    mirrored = mirrored_by(scene, hits, glossy)
    result = mirrored.target, mirrored.far, mirrored.found
    dr.eval(result)
    return result


def _searched(probes: Probes, camera, surfaces, target, far, size, count: int, steps, tolerance):
    """Glossy light at each camera ray, and the steps of its searches. count: of probes that are searched."""
    candidates = dr.concat(probes.nearest(camera["origin"], count))
    dr.eval(candidates)  # found once a frame, not once a point
    screen = Screen(surfaces["position"], surfaces["normal"], surfaces["material"], camera, *size)
    glossy = surfaces["glossy"]
    number = dr.opaque(mi.UInt32, count)
    found = blended(probes, candidates, number, screen, Reflected(target, far), steps, tolerance, glossy)
    color, made = (dr.select(glossy, value, 0) for value in found)
    dr.eval(color, made)
    return color, made


@dataclass
class Searched:
    """Result of a search, a lane a camera ray in row order.

    preliminary, mirrored: mi.PreliminaryIntersection3f of camera ray and mirror ray. surfaces: "glossy", "position",
    "normal" and "material" of the first hits. base: mi.Color3f, all light but the glossy one, specular: that. made:
    steps of the searches.
    """

    preliminary: Any
    mirrored: Any
    surfaces: dict[str, Any]
    base: Any
    specular: Any
    made: Any

    @property
    def effort(self) -> dict[str, float]:
        """Steps that the searches of a glossy camera ray took together, in the mean."""
        count = dr.count(self.surfaces["glossy"])[0]
        return {"search_steps": float(dr.sum(mi.Float(self.made))[0]) / count if count else 0.0}


class ReflectionSearch(OnLightmap):
    """See `gibench.baselines.efficient_light_probes.SEARCH`."""

    functions: ClassVar = {"g-buffer": _gbuffer, "mirror": _mirrored}

    def prepare(self, site: Site) -> None:
        """Bake the lightmap and the probes, or find them."""
        super().prepare(site)
        probes = load_probes(site, ProbeSettings.of(self.settings), MAPS)
        self.probes = probes.count
        self.kernels["search"] = Replay(site.scene, partial(_searched, probes), probes.arrays)

    def searched(self, camera: dict[str, Any], fine: tuple[int, int], stages: Stages) -> Searched:
        """Search a frame. camera: from `camera_arrays`, of a grid of fine = (width, height) rays."""
        with stages.stage("g-buffer"):
            preliminary, base, surfaces = self.kernels["g-buffer"](camera, *fine)
        with stages.stage("ray casting"):
            target, far, mirrored = self.kernels["mirror"](camera, preliminary, surfaces["glossy"], *fine)
        with stages.stage("search"):
            specular, made = self.kernels["search"](
                camera,
                surfaces,
                target,
                far,
                [dr.opaque(mi.Int32, side) for side in fine],
                min(int(self.settings["candidates"]), self.probes),
                dr.opaque(mi.UInt32, int(self.settings["steps"])),
                dr.opaque(mi.Float, float(self.settings["tolerance"])),
            )
        return Searched(preliminary, mirrored, surfaces, base, specular, made)

    def render(self, view: View, stages: Stages) -> Prediction:
        """First hits, what they mirror, and the light of the probes where those mirror the same."""
        fine = self.fine(view)
        found = self.searched(camera_arrays(view.camera, fine), fine, stages)
        with stages.stage("search"):
            base, specular = (averaged(part, fine, self.grid) for part in (found.base, found.specular))
        return Prediction(base + specular, specular, extra=found.effort)
