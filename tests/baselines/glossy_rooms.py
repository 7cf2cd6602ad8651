"""Rooms with one glossy floor, for methods that reflect what the lightmap holds."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

from gibench.baselines.first_hits import first_hits, pixels
from gibench.baselines.lightmap.bake import baked_lightmap
from gibench.baselines.method import Method, Site
from gibench.baselines.stages import Stages
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.scene import Scene, load_dict
from tests.baselines.meshes import diffuse, room, slab
from tests.baselines.sites import view
from tests.rendering import scenes

CAMERA = PinholeCamera((0.7, 0.8, 0.3), (-0.4, -0.5, -0.8), 1.2)
LIGHTMAP = {"texels": 16, "lightmap_spp": 64}
FLOOR = 0.999
"""Depth of the glossy floor below the origin."""


def glossy_room(floor: dict[str, Any]) -> Scene:
    """A closed room with a lamp, a coloured box, and a floor of its own material just above that of the room."""
    lamp = scenes.rectangle([0.2, 0, 0.98], [0, 0, -1], (0.3, 0.3), emitter=scenes.area(8, 7, 6))
    return load_dict(
        {
            "type": "scene",
            **room(diffuse(0.7, 0.6, 0.5)),
            "lamp": lamp,
            "box": slab([-0.7, -0.7, -1.001], [-0.2, -0.2, -0.3], diffuse(0.2, 0.5, 0.7)),
            "floor": slab([-1.05, -1.05, -1.05], [1.05, 1.05, -FLOOR], floor),
        }
    )


def rendered(method: Method, where: Site, resolution: tuple[int, int], seed: int = 0, **given: Any) -> Any:
    implementation = method.load()(method.settings(LIGHTMAP | given))
    implementation.prepare(where)
    return implementation.render(view(CAMERA, seed=seed, resolution=resolution), Stages())


def mirror_image(scene: Scene, where: Site, resolution: tuple[int, int], grid: int, tint: float) -> Any:
    """What a perfectly reflecting floor, times `tint`, shows of the lightmap and the lamps: (H, W, 3)."""
    lightmap = baked_lightmap(where, LIGHTMAP | {"lightmap_denoise": True})
    hits = first_hits(scene, CAMERA, resolution, grid=grid)
    points, towards = np.array(hits.si.p).T, np.array(hits.ray.d).T
    on_floor = np.abs(points[:, 2] + FLOOR) < 1e-4
    ray = mi.Ray3f(
        mi.Point3f((points * [1, 1, 0] + [0, 0, 1e-5 - FLOOR]).T.astype(np.float32)),
        mi.Vector3f((towards * [1, 1, -1]).T.astype(np.float32)),
    )
    preliminary = scene.mi_scene.ray_intersect_preliminary(ray)
    si = preliminary.compute_surface_interaction(ray)
    seen = lightmap.diffuse(si, preliminary) + si.emitter(scene.mi_scene).eval(si)
    shown = mi.Color3f(seen) * mi.Float(np.where(on_floor, tint, 0).astype(np.float32))
    return np.asarray(pixels(shown, hits, grid))
