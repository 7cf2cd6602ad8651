"""Cameras that cases share, and frames of a few pixels and many samples."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.rendering.camera import PinholeCamera
from gibench.rendering.channels import SETS
from gibench.rendering.render import RenderedFrame, render_frame
from gibench.rendering.scene import Scene

SURFACE_SETS = tuple(name for name in SETS if name != "radiance")
"""All channels that are not radiance."""

POINT = 1e-5
"""Field of view, radians, within which a scene is a point."""

INSIDE = PinholeCamera((0.0, 0.0, 0.0), (1.0, 0.2, 0.1), 1.2)
"""From the middle of a closed box."""

SMALL_ROOM = PinholeCamera((0.0, -3.4, 1.0), (0.0, 0.0, 0.95), np.radians(45.0))
"""Into `scenes.small_room`, from its open side."""


def spot(degrees: float) -> PinholeCamera:
    """A camera 4 m from the origin, `degrees` from the z axis, that sees one point of a floor at z = 0."""
    angle = np.radians(degrees)
    return PinholeCamera((0.0, -4 * np.sin(angle), 4 * np.cos(angle)), (0.0, 0.0, 0.0), POINT)


def seen(scene: Scene, camera: PinholeCamera, **options: Any) -> RenderedFrame:
    """A frame of 16 × 16 pixels of 1024 samples, or with other `options` of `render_frame`."""
    given: dict[str, Any] = {"resolution": (16, 16), "channels": ["radiance"], "spp": 1024} | options
    return render_frame(scene, camera, **given)
