"""The method `lpv`: direct light by linearly transformed cosines, indirect light of diffuse surfaces from a volume."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from gibench.baselines.first_hits import averaged, hits_of_rays
from gibench.baselines.light_propagation_volumes.emission import lit_volume
from gibench.baselines.light_propagation_volumes.geometry import passing, room_grid, surfaces
from gibench.baselines.light_propagation_volumes.volume import AXES, EVEN, Grid, looked_up, propagated
from gibench.baselines.linearly_transformed_cosines.implementation import RectangleLight, area_light
from gibench.baselines.linearly_transformed_cosines.rectangle import light_arrays
from gibench.baselines.method import Prediction, Setting, Site, View, reading
from gibench.baselines.stages import Stages
from gibench.rendering import surface
from gibench.rendering.lighting import AreaLight
from gibench.rendering.replay import Replay, camera_arrays, ray_generator
from gibench.rendering.scene import Scene

GLOSSY_CELLS = 4
"""Cells along the mirrored direction whose light a glossy surface reflects, in the mean."""


def spread(grid, state, shares, steps: int, cells: int):
    """The sum over steps of what goes on from cell to cell, COMPONENTS arrays.

    shares: `geometry.passing`. In the first step nothing is blocked: virtual lights would be by their own surfaces.
    """
    total = [mi.Float(part) for part in state]
    for step in range(steps):
        state = propagated(grid, state, shares if step else None, cells)
        total = [whole + part for whole, part in zip(total, state, strict=True)]
        dr.eval(state, total)
    return total


def indirect(scene: Scene, grid, volume, camera, preliminary, width: int, height: int):
    """Indirect radiance at camera rays per flux of the light, diffuse and glossy, mi.Color3f, m⁻²·sr⁻¹."""
    hits = hits_of_rays(scene, ray_generator(camera), (width, height), preliminary)
    si, active, normal, side = hits.si, hits.active, hits.normal, grid["side"]
    per_area = dr.rcp(dr.square(side))
    before = si.p + 0.5 * side * normal  # where the light of the surface's own side is
    received = looked_up(grid, volume, before, -normal, active) * (EVEN * per_area)
    diffuse = surface.albedo(scene, hits.bsdf, si, active) * received * dr.inv_pi
    mirrored = si.to_world(mi.reflect(si.wi))
    seen = mi.Color3f(0)
    for number in range(GLOSSY_CELLS):
        along = before + number * side * mirrored
        seen += looked_up(grid, volume, along, -mirrored, hits.glossy)
    glossy = surface.specular_albedo(scene, hits.bsdf, si, active)
    glossy = dr.select(hits.glossy, glossy * seen * (EVEN * dr.inv_pi / GLOSSY_CELLS * per_area), 0)
    dr.eval(diffuse, glossy)
    return diffuse, glossy


GRID, PASSING = "grid.json", "passing.npy"
"""Names in a bake: where the cells are, and what comes through between them."""


class PropagatedLight:
    """See `gibench.baselines.light_propagation_volumes.METHOD`."""

    def __init__(self, settings: Mapping[str, Setting]) -> None:
        """settings: all knobs."""
        self.adjust(settings)

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings from the next frame on."""
        self.settings = dict(settings)
        self._grid = math.isqrt(int(settings["rays"]))

    def prepare(self, site: Site) -> None:
        """Find the room and what blocks light in it."""
        scene, cells = site.scene, int(self.settings["cells"])
        bake = site.bakes.get("geometry", {"cells": cells}, partial(_made, scene, cells))
        with reading("the geometry volume", bake.folder):
            grid, shares = _read(bake.folder)
        self.cells = grid.size
        self._volume = grid.arrays
        self._passing = [mi.Float(np.ascontiguousarray(share)) for share in shares]
        self._light = RectangleLight(scene)
        self.kernels = {
            "virtual lights": Replay(scene, partial(lit_volume, scene)),
            "propagation": Replay(scene, spread),
            "lookup": Replay(scene, partial(indirect, scene)),
        }

    def volume(self, area: AreaLight, stages: Stages) -> list[Any]:
        """Intensity of all cells under a light, per light that it emits, COMPONENTS arrays."""
        settings = self.settings
        with stages.stage("virtual lights"):
            state = self.kernels["virtual lights"](
                self._volume,
                light_arrays(area),
                int(settings["virtual_lights"]),
                int(settings["bounces"]),
                self.cells,
            )
        with stages.stage("propagation"):
            found: list[Any] = self.kernels["propagation"](
                self._volume,
                state,
                self._passing if settings["geometry"] else None,
                int(settings["steps"]),
                self.cells,
            )
        return found

    def render(self, view: View, stages: Stages) -> Prediction:
        """Direct light, then the volume, then what each camera ray finds in it."""
        area = area_light(view, "lpv")
        fine = (view.resolution[0] * self._grid, view.resolution[1] * self._grid)
        lit = self._light.lit(view, area, fine, int(self.settings["shadow_rays"]), stages)
        volume = self.volume(area, stages)
        with stages.stage("gather"):
            camera = camera_arrays(view.camera, fine)
            parts = self.kernels["lookup"](self._volume, volume, camera, lit.surfaces, *fine)
            flux = mi.Color3f(*(float(np.float32(math.pi * area.area * c)) for c in area.radiance))
            dr.make_opaque(flux)
            diffuse, glossy = (part * flux for part in parts)
            color = lit.emission + lit.diffuse + lit.specular + diffuse + glossy
            images = [averaged(part, fine, self._grid) for part in (color, diffuse + glossy)]
        return Prediction(images[0], indirect=images[1])


def _made(scene: Scene, cells: int, folder: Path) -> None:
    grid = room_grid(scene, cells)
    np.save(folder / PASSING, passing(grid, *surfaces(scene, grid)))
    (folder / GRID).write_text(json.dumps(asdict(grid)), encoding="utf-8")


def _read(folder: Path) -> tuple[Grid, Any]:
    found = json.loads((folder / GRID).read_text(encoding="utf-8"))
    grid = Grid(tuple(found["low"]), float(found["side"]), tuple(found["counts"]))
    shares = np.load(folder / PASSING, allow_pickle=False)
    if shares.shape != (len(AXES), grid.size):
        raise ValueError(f"{PASSING} is not of {grid.size} cells")
    return grid, shares
