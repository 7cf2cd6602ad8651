"""Glossy fraction of the views of a room."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gibench.generators.materials import is_glossy
from gibench.generators.parts import Camera, Material, RoomObject
from gibench.generators.visibility import RayCaster

GLOSS = ("any", "much")
"""Rooms as they come, or those with polished floors and furniture."""

MUCH = 0.25
"""Least share of what the cameras of a room with much gloss see that shows reflections."""

COLUMNS, ROWS = 48, 36
"""Rays of a camera."""


def visible_gloss(
    objects: Sequence[RoomObject], materials: Mapping[str, Material], cameras: Sequence[Camera]
) -> float:
    """Share of the rays of all cameras that meet a mirror, or a coat or metal of GGX alpha ≤ 0.1 first, in [0, 1].

    Rays that leave the room count as not glossy. 0 without a camera.
    """
    if not cameras:
        return 0.0
    shapes = [(mesh, is_glossy(materials[name])) for thing in objects for mesh, name in thing.shapes]
    glossy = np.array([shine for _, shine in shapes])
    x, y = np.meshgrid((np.arange(COLUMNS) + 0.5) / COLUMNS, (np.arange(ROWS) + 0.5) / ROWS)
    origins, directions = [], []
    for camera in cameras:
        right, down, forward = camera.pinhole.frame
        wide = np.tan(camera.fov / 2)
        across, along = wide * (2 * x - 1), wide * ROWS / COLUMNS * (2 * y - 1)
        rays = forward + across[..., None] * right + along[..., None] * down
        directions.append((rays / np.linalg.norm(rays, axis=-1, keepdims=True)).reshape(-1, 3))
        origins.append(np.tile(camera.position, (len(directions[-1]), 1)))
    caster = RayCaster([mesh for mesh, _ in shapes], range(len(shapes)))
    _, owner = caster.cast(np.concatenate(origins), np.concatenate(directions))
    return float((glossy[owner] & (owner >= 0)).mean())
