"""The environment as the light encoder sees it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gibench.baselines.environments import turned
from gibench.rendering.latlong import resampled, solid_angles
from gibench.rendering.lighting import EnvironmentMap

ROWS = 128
"""Of the panorama, which has twice as many columns."""


def picture_of(environment: EnvironmentMap) -> NDArray[np.float32]:
    """(3, ROWS, 2·ROWS) radiance of an environment as it is turned, W·m⁻²·sr⁻¹."""
    pixels = turned(environment.panorama.pixels, environment.rotation)
    return np.ascontiguousarray(np.moveaxis(resampled(pixels, ROWS), -1, 0))


def mean_radiance(picture: NDArray[np.float32]) -> NDArray[np.float64]:
    """(3,) mean over the sphere of each colour of a picture (3, H, 2·H)."""
    rows = picture.mean(axis=2, dtype=np.float64)
    weights = solid_angles(rows.shape[1])
    return np.asarray(rows @ weights / weights.sum())
