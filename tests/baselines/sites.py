"""What a method is given to prepare from, and views to render, without a benchmark around them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gibench.baselines.bakes import BakeCache
from gibench.baselines.method import Site, View
from gibench.baselines.stages import Stages
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import Shot
from gibench.rendering.scene import Scene
from tests.rendering import scenes

RESOLUTION = (32, 24)


def site(scene: Scene, folder: Path, name: str = "scene") -> Site:
    """A site without training views. name: what tells its bakes from those of other scenes in the folder."""
    return Site(scene, folder, RESOLUTION, (), 0, BakeCache(folder / "bakes", name, {}), Stages())


def view(camera: PinholeCamera, seed: int = 0, resolution: tuple[int, int] = RESOLUTION) -> View:
    return View(Shot(camera), None, resolution, 0, seed)


def lit_box(floor: dict[str, Any], reflectance: float = 0.0, half: float = 1.0) -> dict[str, Any]:
    """A cube around the origin: `floor` below, five diffuse walls that emit what `emitted` says.

    half: of its side, metres.
    """
    scene: dict[str, Any] = {
        "type": "scene",
        "floor": scenes.rectangle([0, 0, -half], [0, 0, 1], (half, half), bsdf=floor),
    }
    for axis, side in FACES:
        centre = [side * half if a == axis else 0 for a in range(3)]
        normal = [-side if a == axis else 0 for a in range(3)]
        scene[f"wall{axis}{'+' if side > 0 else '-'}"] = scenes.rectangle(
            centre,
            normal,
            (half, half),
            bsdf={"type": "diffuse", "reflectance": scenes.rgb(reflectance)},
            emitter=scenes.area(*emitted(axis, side)),
        )
    return scene


FACES = ((0, -1), (0, 1), (1, -1), (1, 1), (2, 1))
"""Axis and side of the walls of `lit_box`."""


def emitted(axis: int, side: int) -> tuple[float, float, float]:
    """Radiance of a wall of `lit_box`, another for each."""
    number = FACES.index((axis, side))
    return (1.0 + number, 0.5 * number, 2.0)


def where_rays_leave(origins: Any, directions: Any, half: float = 1.0) -> tuple[Any, Any]:
    """Points (N, 3) where rays from inside leave the cube around the origin, and the face, as axis and side (N, 2)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (half * np.sign(directions) - origins) / directions
    distance[~np.isfinite(distance)] = np.inf
    axis = distance.argmin(axis=1)
    reach = distance[np.arange(len(axis)), axis]
    side = np.sign(directions[np.arange(len(axis)), axis])
    return origins + reach[:, None] * directions, np.stack([axis, side], axis=1).astype(int)
