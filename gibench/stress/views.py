"""Cameras that cases share, and frames of a few pixels and many samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.rendering.camera import PinholeCamera
from gibench.rendering.channels import SETS
from gibench.rendering.render import RenderedFrame, render_frame
from gibench.rendering.scene import Scene

SURFACE_SETS = tuple(name for name in SETS if name not in ("radiance", "samples", "lighting"))
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


def render_path(
    mi_scene: Any,
    camera: PinholeCamera,
    resolution: tuple[int, int],
    *,
    spp: int,
    seed: int,
    max_depth: int,
    rr_depth: int = 1000,
) -> NDArray[np.float32]:
    """Mitsuba's own `path` through a box filter, (H, W, 3): the independent implementation.

    max_depth: scattering events. rr_depth: from which on Russian roulette may end a path; by default it never does.
    """
    import mitsuba as mi

    film = {
        "type": "hdrfilm",
        "width": resolution[0],
        "height": resolution[1],
        "rfilter": {"type": "box"},
        "pixel_format": "rgb",
        "component_format": "float32",
    }
    place = mi.ScalarTransform4f().look_at(
        origin=list(camera.position), target=list(camera.target), up=list(camera.look_at_up)
    )
    sensor = mi.load_dict(
        {
            "type": "perspective",
            "fov": float(np.degrees(camera.fov)),
            "fov_axis": "x",
            "near_clip": 1e-4,
            "to_world": place,
            "film": film,
            "sampler": {"type": "independent"},
        }
    )
    integrator = mi.load_dict({"type": "path", "max_depth": max_depth + 1, "rr_depth": rr_depth})
    return np.array(mi.render(mi_scene, sensor=sensor, integrator=integrator, spp=spp, seed=seed))
