"""Small test scenes, in Mitsuba's dictionary form; Z up, metres."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.rendering.camera import PinholeCamera
from gibench.stress import views
from gibench.stress.scenes import area, closed_box, rectangle, rgb, two_sided

__all__ = ["area", "closed_box", "rectangle", "rgb", "two_sided"]

CAMERA = PinholeCamera((0.0, -3.4, 1.0), (0.0, 0.0, 0.95), np.radians(45.0))
"""Looks into `box` from its open side."""


def checker() -> dict[str, Any]:
    return {"type": "checkerboard", "color0": rgb(0.1, 0.2, 0.5), "color1": rgb(0.8, 0.6, 0.3)}


MATERIALS: dict[str, dict[str, Any]] = {
    "diffuse": two_sided(type="diffuse", reflectance=rgb(0.6, 0.5, 0.3)),
    "textured": two_sided(type="diffuse", reflectance=checker()),
    "coat": two_sided(
        type="roughplastic",
        alpha=0.1,
        distribution="ggx",
        int_ior=1.5,
        diffuse_reflectance=rgb(0.5, 0.2, 0.1),
    ),
    "textured_coat": two_sided(
        type="roughplastic", alpha=0.02, distribution="ggx", int_ior=1.5, diffuse_reflectance=checker()
    ),
    "metal": two_sided(type="roughconductor", material="Cu", alpha=0.2, distribution="ggx"),
    "mirror": two_sided(type="conductor", material="Al", specular_reflectance=rgb(0.9)),
}


def box(material: str) -> dict[str, Any]:
    """A room of 2 × 2 × 2 m open to −y, with a lamp under the ceiling and spheres of `material` and of others."""
    wall = {"type": "ref", "id": "wall"}
    scene: dict[str, Any] = {
        "type": "scene",
        "wall": {**two_sided(type="diffuse", reflectance=rgb(0.7, 0.65, 0.6)), "id": "wall"},
        "subject": {**MATERIALS[material], "id": "subject"},
        "floor": rectangle([0, 0, 0], [0, 0, 1], (1, 1), bsdf={"type": "ref", "id": "subject"}),
        "ceiling": rectangle([0, 0, 2], [0, 0, -1], (1, 1), bsdf=wall),
        "back": rectangle([0, 1, 1], [0, -1, 0], (1, 1), bsdf=wall),
        "left": rectangle([-1, 0, 1], [1, 0, 0], (1, 1), bsdf=wall),
        "right": rectangle([1, 0, 1], [-1, 0, 0], (1, 1), bsdf=wall),
        "lamp": rectangle([0, 0, 1.95], [0, 0, -1], (0.25, 0.25), bsdf=wall, emitter=area(8, 7, 6)),
        "ball": {
            "type": "sphere",
            "center": [-0.4, 0.1, 0.4],
            "radius": 0.35,
            "bsdf": {"type": "ref", "id": "subject"},
        },
    }
    for number, name in enumerate(("coat", "metal", "mirror")):
        scene[f"extra_{name}"] = {
            "type": "sphere",
            "center": [0.1 + 0.35 * number, -0.2 + 0.2 * number, 0.2 + 0.3 * number],
            "radius": 0.18,
            "bsdf": {**MATERIALS[name], "id": f"extra_{name}_material"},
        }
    return scene


def furnace(bsdf: dict[str, Any], radiance: float = 1.0) -> dict[str, Any]:
    """A sphere of radius 1 at the origin under uniform light from everywhere."""
    return {
        "type": "scene",
        "light": {"type": "constant", "radiance": rgb(radiance)},
        "ball": {"type": "sphere", "radius": 1.0, "bsdf": bsdf},
    }


def render_path(mi_scene: Any, camera: PinholeCamera, side: int, spp: int, seed: int, max_depth: int) -> Any:
    """Mitsuba's own `path` with the same Russian roulette, so that the two also compare by time."""
    from gibench.rendering.integrator import RR_DEPTH

    options = {"spp": spp, "seed": seed, "max_depth": max_depth, "rr_depth": RR_DEPTH}
    return views.render_path(mi_scene, camera, (side, side), **options)
