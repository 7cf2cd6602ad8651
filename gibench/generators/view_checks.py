"""Whether a view is worth rendering, checked by a coarse grid of rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gibench.generators.parts import Camera, FloatArray
from gibench.generators.visibility import Caster

GRID = (24, 18)  # rays across and down, at the aspect of the usual 4:3 frame

NEAREST = 0.5  # least distance to anything seen, m
MEAN_DEPTH = (1.2, 12.0)  # bounds of the mean distance, m
DEPTH_SPREAD = 0.15  # least standard deviation of the distance, relative to its mean
OBJECTS = 5  # least number of things seen, walls, floor and the rest of the shell apart
LARGEST_SHARE = 0.5  # most that one surface may take of the view
OUTSIDE_SHARE = 0.35  # most of the view that may leave through windows


@dataclass(frozen=True)
class CheckedView:
    """Findings about a candidate. reason: why it is refused, empty if it is not. objects: how many things it sees."""

    camera: Camera
    reason: str
    objects: int
    seen: frozenset[int]


def camera_rays(cameras: Sequence[Camera], grid: tuple[int, int] = GRID) -> FloatArray:
    """(cameras, columns · rows, 3) unit directions through a grid over each view, row by row from the top."""
    frames = np.array([c.pinhole.frame for c in cameras])
    right, down, forward = frames[:, 0], frames[:, 1], frames[:, 2]
    columns, rows = grid
    reach = np.tan(np.array([camera.fov for camera in cameras]) / 2)[:, None]
    x = ((np.arange(columns) + 0.5) / columns * 2 - 1) * reach
    y = ((np.arange(rows) + 0.5) / rows * 2 - 1) * reach * rows / columns
    across = x[:, None, :, None] * right[:, None, None]
    rays = forward[:, None, None] + y[:, :, None, None] * down[:, None, None] + across
    # In a frame of unit vectors the length follows from where a ray meets the image plane.
    rays /= np.sqrt(1 + x[:, None, :] ** 2 + y[:, :, None] ** 2)[..., None]
    return rays.reshape(len(cameras), -1, 3)


def check_views(caster: Caster, cameras: Sequence[Camera], shell_owners: int) -> list[CheckedView]:
    """Cast the grids of all candidates at once and check each.

    shell_owners: owners below this number are the shell's and do not count as things seen.
    """
    rays = camera_rays(cameras)
    count = rays.shape[1]
    origins = np.repeat([camera.position for camera in cameras], count, axis=0)
    distance, owner = caster.cast(origins, rays.reshape(-1, 3))
    shape = (len(cameras), count)
    return [
        _judge_one(camera, d, o, shell_owners)
        for camera, d, o in zip(cameras, distance.reshape(shape), owner.reshape(shape), strict=True)
    ]


def _judge_one(
    camera: Camera, distance: NDArray[np.float32], owner: NDArray[np.int64], shell_owners: int
) -> CheckedView:
    hit = owner >= 0
    seen, counts = np.unique(owner[hit], return_counts=True)
    things = frozenset(seen[seen >= shell_owners].tolist())
    reason = ""
    if hit.mean() < 1 - OUTSIDE_SHARE:
        reason = "looks outside"
    else:
        depth = distance[hit].astype(np.float64)
        mean = depth.mean()
        if depth.min() < NEAREST:
            reason = "too close"
        elif not MEAN_DEPTH[0] <= mean <= MEAN_DEPTH[1]:
            reason = "mean depth"
        elif depth.std() < DEPTH_SPREAD * mean:
            reason = "flat depth"
        elif counts.max() > LARGEST_SHARE * len(owner):
            reason = "one surface"
        elif len(things) < OBJECTS:
            reason = "few objects"
    return CheckedView(camera, reason, len(things), things)
