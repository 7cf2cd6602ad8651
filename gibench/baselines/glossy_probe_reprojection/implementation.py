"""The method `gpr`: diffuse light from the lightmap, glossy light from probes that are reprojected and filtered."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi
import numpy as np

from gibench.baselines.first_hits import averaged, hits_of_rays
from gibench.baselines.glossy_probe_reprojection.filtering import Guides, filtered
from gibench.baselines.glossy_probe_reprojection.footprint import REDUCED, Footprint, slanted
from gibench.baselines.glossy_probe_reprojection.gather import (
    MAPS,
    NOTHING,
    Search,
    TexelTable,
    Wanted,
    gathered,
    trilinear,
)
from gibench.baselines.glossy_probe_reprojection.history import PastFrame, recalled
from gibench.baselines.glossy_probe_reprojection.perturbation import Mirror
from gibench.baselines.lightmap.deferred import OnLightmap
from gibench.baselines.method import Prediction, Setting, Site, View
from gibench.baselines.probes.baking import POSITIONS, ProbeSettings
from gibench.baselines.probes.maps import load_probes
from gibench.baselines.probes.reflections import mirrored_by, surfaces_of
from gibench.baselines.stages import Stages
from gibench.rendering import flags, surface
from gibench.rendering.replay import Replay, camera_arrays, ray_generator

LEAST_ENERGY = 0.01
"""Energy below which samples are all as good: equation 4 divides by it."""

MAPPINGS = {"plain": "lat-long", "adaptive": "adaptive"}
"""Of the probes, by parameterization."""

RECALLED = 1.0
"""Energy of what comes from the frame before."""


def _gbuffer(scene, lightmap, camera, width: int, height: int):
    """First hits, their radiance but for glossy light, and their surfaces for search and filter."""
    hits = hits_of_rays(scene, ray_generator(camera), (width, height))
    base = hits.emission + lightmap.diffuse(hits.si, hits.preliminary, hits.active)
    surfaces = surfaces_of(scene, hits) | {
        "roughness": surface.roughness(scene, hits.bsdf, hits.si, hits.active),
        "distance": dr.select(hits.active, hits.si.t, 0),
    }
    dr.eval(hits.preliminary, base, surfaces)
    return hits.preliminary, base, surfaces


def _bent(scene, camera, preliminary, width: int, height: int):
    """Principal curvatures of what was hit, and the direction of the first."""
    ray = hits_of_rays(scene, ray_generator(camera), (width, height), preliminary).ray
    si = preliminary.compute_surface_interaction(ray, flags.HIT_WITH_CURVATURE)
    first, second, direction = scene.curvature.principal(si, preliminary, si.is_valid())
    bent = {"curvature": mi.Vector2f(first, second), "direction": mi.Vector3f(direction)}
    dr.eval(bent)
    return bent


def _mirrored(scene, _lightmap, camera, preliminary, glossy, width: int, height: int):
    """Mirror hit of each glossy hit: place, material and distance.

    The place is a direction where that is infinitely far; the material is 0 there.
    """
    hits = hits_of_rays(scene, ray_generator(camera), (width, height), preliminary)
    one = mirrored_by(scene, hits, glossy)
    there = glossy & ~one.far
    hit = one.found.compute_surface_interaction(one.ray, mi.RayFlags.Minimal, there)
    mirrored = {
        "far": one.far,
        "target": one.target,
        "material": scene.material_ids(hit.bsdf(), there),
        "reach": dr.select(one.far, dr.inf, one.found.t),
    }
    dr.eval(mirrored)
    return mirrored


def _gathered(table, chosen, shares, number, eye, surfaces, mirrored, search, paraboloid):
    """Glossy light before the filter, and the energy of its best sample."""
    bend = dr.select(paraboloid, surfaces["curvature"], 0)
    wanted = Wanted(
        Mirror(surfaces["position"], surfaces["normal"], bend, surfaces["direction"]),
        surfaces["material"],
        mirrored["target"],
        mirrored["far"],
        mirrored["material"],
    )
    found = gathered(table, chosen, shares, number, wanted, eye, Search(*search), surfaces["glossy"])
    dr.eval(found)
    return found


def _recalled(frame, surfaces, color, energy):
    """The same, with the frame before where no probe has anything."""
    missing = surfaces["glossy"] & (energy >= NOTHING)
    old, found = recalled(PastFrame(**frame), surfaces["position"], surfaces["material"], missing)
    result = dr.select(found, old, color), dr.select(found, RECALLED, energy)
    dr.eval(result)
    return result


def _filtered(footprint, camera, surfaces, mirrored, color, energy, size, unit, reduced, taps):
    """Glossy light after the filter. reduced: roughness in the probes over the surfaces' own."""
    guides = Guides(surfaces["normal"], surfaces["distance"], surfaces["material"], *size, unit)
    reach, distance = mirrored["reach"], surfaces["distance"]
    share = dr.select(mirrored["far"], 1, reach / dr.maximum(reach + distance, 1e-20))
    roughness = surfaces["roughness"]
    own, baked = (footprint.deviation(factor * roughness, share) for factor in (1.0, reduced))
    towards = (surfaces["position"] - camera["origin"]) / dr.maximum(distance, 1e-20)
    cosine = dr.abs(dr.dot(towards, surfaces["normal"]))
    across, down, ahead = (dr.dot(axis, surfaces["normal"]) for axis in camera["axes"])
    right, below, forward = (dr.dot(axis, towards) for axis in camera["axes"])
    slant = mi.Vector2f(across - ahead * right / forward, down - ahead * below / forward)
    length = dr.norm(slant)
    slant = dr.select(length > 1e-4, slant / dr.maximum(length, 1e-4), mi.Vector2f(1, 0))
    scale = dr.rcp(camera["scale"])
    covariance = slanted(dr.square(own * scale), slant, 1, dr.square(cosine)) - slanted(
        dr.square(baked * scale), slant, 1, dr.square(cosine)
    )
    weight = dr.select(energy < NOTHING, dr.rcp(dr.maximum(energy, LEAST_ENERGY)), 0)
    result = filtered(color, weight, guides, covariance, taps, surfaces["glossy"])
    result = dr.select(surfaces["glossy"], result, 0)
    dr.eval(result)
    return result


class GlossyProbeReprojection(OnLightmap):
    """See `gibench.baselines.glossy_probe_reprojection.METHOD`."""

    functions: ClassVar = {"g-buffer": _gbuffer, "mirror": _mirrored}

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings that do not bake, and forget the frame before."""
        super().adjust(settings)
        self._previous: Any = None

    def prepare(self, site: Site) -> None:
        """Bake the lightmap and the probes, or find them."""
        super().prepare(site)
        self._reduced = REDUCED if self.settings["halved"] else 1.0
        asked = replace(
            ProbeSettings.of(self.settings),
            mapping=MAPPINGS[str(self.settings["parameterization"])],
            first_roughness=self._reduced,
        )
        probes = load_probes(site, asked, MAPS)
        self._positions = np.array(probes.arrays[POSITIONS]).reshape(-1, 3)
        curvature = site.scene.curvature.arrays
        self.kernels["curvature"] = Replay(site.scene, partial(_bent, site.scene), curvature)
        table, footprint = TexelTable(probes), Footprint()
        self.kernels["gather"] = Replay(site.scene, partial(_gathered, table), table.arrays)
        self.kernels["history"] = Replay(site.scene, _recalled)
        self.kernels["filter"] = Replay(site.scene, partial(_filtered, footprint), footprint.arrays)

    def render(self, view: View, stages: Stages) -> Prediction:
        """First hits, what they mirror, the light of the probes that mirror the same, and the filter."""
        grid, fine, knobs = self.grid, self.fine(view), self.settings
        camera = camera_arrays(view.camera, fine)
        size = [dr.opaque(mi.Int32, side) for side in fine]
        unit = dr.opaque(mi.Float, float(knobs["unit"]))
        with stages.stage("g-buffer"):
            preliminary, base, surfaces = self.kernels["g-buffer"](camera, *fine)
            surfaces |= self.kernels["curvature"](camera, preliminary, *fine)
            base = averaged(base, fine, grid)
        with stages.stage("ray casting"):
            mirrored = self.kernels["mirror"](camera, preliminary, surfaces["glossy"], *fine)
        with stages.stage("gather"):
            number = min(int(knobs["used"]), len(self._positions))
            chosen, shares = trilinear(self._positions, view.camera.position, number)
            color, energy = self.kernels["gather"](
                mi.UInt32(chosen),
                mi.Float(shares),
                dr.opaque(mi.UInt32, number),
                camera["origin"],
                surfaces,
                mirrored,
                [
                    dr.opaque(mi.UInt32, int(knobs["order"])),
                    dr.opaque(mi.UInt32, int(knobs["window"])),
                    dr.opaque(mi.UInt32, int(knobs["levels"])),
                    unit,
                ],
                dr.opaque(mi.Bool, bool(knobs["paraboloid"])),
            )
            if self._previous is not None and view.previous is not None and knobs["history"]:
                color, energy = self.kernels["history"](self._previous, surfaces, color, energy)
        with stages.stage("filter"):
            if knobs["filter"]:
                color = self.kernels["filter"](
                    camera,
                    surfaces,
                    mirrored,
                    color,
                    energy,
                    size,
                    unit,
                    dr.opaque(mi.Float, self._reduced),
                    dr.opaque(mi.UInt32, int(knobs["taps"])),
                )
            specular = averaged(color, fine, grid)
        self._previous = {
            "camera": camera,
            "width": size[0],
            "height": size[1],
            "color": color,
            "position": surfaces["position"],
            "material": surfaces["material"],
            "known": surfaces["glossy"] & (energy < NOTHING),
        }
        return Prediction(base + specular, specular, extra=_found(surfaces["glossy"], energy))


def _found(glossy: Any, energy: Any) -> dict[str, float]:
    """Share of the glossy camera rays for which there is a sample, and the mean energy of those."""
    count = dr.count(glossy)[0]
    known = glossy & (energy < NOTHING)
    found = dr.count(known)[0]
    mean = float(dr.sum(dr.select(known, energy, 0))[0]) / found if found else 0.0
    return {"found": found / count if count else 1.0, "energy": mean}
