"""The materials of a scene a second time, with narrower lobes.

Glossy probes hold what a surface of less roughness would reflect, so that what is still missing can be filtered in
where they are read (Rodriguez et al. 2020, section 6). Only the first hit is narrower: what it reflects are the scene's
own materials.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from gibench.baselines.probes.errors import ProbeError
from gibench.rendering.scene import Scene, load_scene

POWERS = {"alpha": 1.0, "alpha_u": 1.0, "alpha_v": 1.0, "roughness": 0.5}
"""Parameter → the power of alpha that it is; `principled` squares its roughness (Burley 2012, section 5.4)."""

INNER = frozenset({"value", "data", "scale", "color0", "color1"})
"""Parameters of textures, constant ones among them, that their colours are proportional to."""


class NarrowedMaterials:
    """Copies of a scene's materials with GGX alpha times a factor, found by the shape that was hit.

    layers: `rendering.layers.Layers` of the copies. arrays: what a `Replay` must hold.
    """

    def __init__(self, scene: Scene, file: Path, factor: float) -> None:
        """file: the scene.xml that the scene was loaded from. Raises ProbeError where it holds another scene."""
        if not file.is_file():
            raise ProbeError(f"materials of less roughness are read from {file}, which is not there")
        copy = load_scene(file)
        shapes = _in_order(copy)
        if [_looks(shape) for shape in shapes] != [_looks(shape) for shape in _in_order(scene)]:
            raise ProbeError(f"{file} has other shapes than the scene that was loaded")
        _narrow(copy.mi_scene, factor)
        self.layers = copy.layers  # which keeps the copies alive; the rest of the scene may go
        indices = [0, *(_index(shape.bsdf()) for shape in shapes)]
        self._scene = scene
        self._indices = mi.UInt32(np.array(indices, dtype=np.uint32))
        dr.make_opaque(self._indices)
        self.arrays = [self._indices, self.layers.arrays]

    def at(self, si: Any) -> Any:
        """mi.BSDFPtr of the copy of the material at hits (mi.SurfaceInteraction3f); null on a miss."""
        shape = self._scene.shape_ids(si.shape, si.is_valid())
        return dr.reinterpret_array(mi.BSDFPtr, dr.gather(mi.UInt32, self._indices, shape))


def _in_order(scene: Scene) -> list[Any]:
    """Shapes by their id in the scene, from 1 on."""
    shapes = list(scene.mi_scene.shapes())
    index = scene.shape_ids(mi.ShapePtr(shapes), True)
    return [shape for _, shape in sorted(zip(np.array(index), shapes, strict=True), key=lambda pair: pair[0])]


def _looks(shape: Any) -> tuple[Any, ...]:
    box = shape.bbox()
    return shape.id(), *np.array(box.min).ravel(), *np.array(box.max).ravel()


def _index(bsdf: Any) -> int:
    return 0 if bsdf is None else int(dr.reinterpret_array(mi.UInt32, mi.BSDFPtr(bsdf))[0])


def _narrow(mi_scene: Any, factor: float) -> None:
    """Multiply alpha of all materials, textured or not, by a factor."""
    parameters = mi.traverse(mi_scene)
    for name in list(parameters.keys()):
        words = [word for word in name.split(".") if word not in INNER]
        power = POWERS.get(words[-1]) if len(words) > 1 else None
        if power is not None and dr.is_array_v(parameters[name]):
            parameters[name] = parameters[name] * math.pow(factor, power)
    parameters.update()
