"""A floor in strips of all materials that rooms have, with a box on it and a wall behind, for lights that move."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import trimesh

from gibench.rendering.camera import PinholeCamera
from gibench.rendering.light_rig import LightRig
from gibench.rendering.scene import load_dict
from tests.rendering import scenes

CAMERA = PinholeCamera((0.0, -2.4, 1.2), (0.0, 0.2, 0.3), np.radians(70.0))


def coat(alpha: float) -> dict[str, Any]:
    return scenes.two_sided(
        type="roughplastic", alpha=alpha, distribution="ggx", diffuse_reflectance=scenes.rgb(0.4, 0.2, 0.1)
    )


STRIPS: dict[str, dict[str, Any]] = {
    "matt": scenes.MATERIALS["diffuse"],
    "coat": coat(0.05),
    "rough coat": coat(0.4),
    "metal": scenes.two_sided(type="roughconductor", material="Cu", alpha=0.15, distribution="ggx"),
    "rough metal": scenes.two_sided(type="roughconductor", material="Al", alpha=0.5, distribution="ggx"),
    "mirror": scenes.MATERIALS["mirror"],
}
"""Materials of the floor, from left to right: those that rooms have."""


WALL = scenes.two_sided(type="diffuse", reflectance=scenes.rgb(0.6))

POLISHED: dict[str, dict[str, Any]] = {
    "mirror": scenes.MATERIALS["mirror"],
    "polished metal": scenes.two_sided(type="roughconductor", material="Cu", alpha=0.005, distribution="ggx"),
}
"""A mirror, and what is nearly one."""


def strips_rig(
    *, panoramas: bool = False, strips: dict[str, dict[str, Any]] = STRIPS, rest: dict[str, Any] = WALL
) -> LightRig:
    """strips: materials of the floor, from left to right. rest: of the wall and the box."""
    width = 3.0 / len(strips)
    parts = {
        name.replace(" ", "_"): scenes.rectangle(
            [-1.5 + (k + 0.5) * width, 0, 0], [0, 0, 1], (width / 2, 1.5), bsdf=material
        )
        for k, (name, material) in enumerate(strips.items())
    }
    parts["wall"] = scenes.rectangle([0, 1.5, 1], [0, -1, 0], (1.5, 1), bsdf=rest)
    parts["box"] = {
        "type": "cube",
        "to_world": mi.ScalarTransform4f().translate([0.2, 0.3, 0.25]).scale([0.5, 0.15, 0.25]),
        "bsdf": rest,
    }
    return LightRig(load_dict({"type": "scene", **parts}), panoramas=panoramas)


def strips_parts() -> list[trimesh.Trimesh]:
    """The same geometry, a mesh a part: floor, wall and box."""
    floor = trimesh.Trimesh(
        [[-1.5, -1.5, 0], [1.5, -1.5, 0], [1.5, 1.5, 0], [-1.5, 1.5, 0]], [[0, 1, 2], [0, 2, 3]]
    )
    wall = trimesh.Trimesh(
        [[-1.5, 1.5, 0], [1.5, 1.5, 0], [1.5, 1.5, 2], [-1.5, 1.5, 2]], [[0, 1, 2], [0, 2, 3]]
    )
    box = trimesh.creation.box(bounds=[[-0.3, 0.15, 0.0], [0.7, 0.45, 0.5]])
    return [floor, wall, box]
