"""Surfaces of a frame, with what their diffuse lobes reflect in the place of their albedo."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.baselines.image_to_image.device_frames import DeviceFrames
from gibench.baselines.relighting import SURFACE
from gibench.rendering.gbuffer import Hit, surface_arrays
from gibench.rendering.lobes import diffuse_reflectance
from gibench.rendering.replay import Replay, ray_generator
from gibench.rendering.scene import Scene


class ReflectingFrames(DeviceFrames):
    """`SURFACE` of the frames of a scene, where `albedo` is the share of even light that the diffuse lobe sends to the
    viewer: beneath a coat that is less than the albedo.
    """

    def __init__(self, scene: Scene) -> None:
        """scene: loaded."""
        self._kernel = Replay(scene, partial(_arrays, scene))


def _arrays(scene: Scene, camera: dict[str, Any], width: Any, pixels: int) -> dict[str, Any]:
    found = surface_arrays(scene, SURFACE, camera, width, pixels)
    lane = dr.arange(mi.UInt32, pixels)
    row = lane // width
    centre = mi.Point2f(mi.Float(lane - row * width) + 0.5, mi.Float(row) + 0.5)
    hit = Hit(scene, ray_generator(camera).rays(centre), mi.RayFlags.All)
    found["albedo"] = diffuse_reflectance(scene.layers, hit.bsdf, hit.si, hit.valid)
    dr.eval(found)
    return found
