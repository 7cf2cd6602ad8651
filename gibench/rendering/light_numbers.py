"""Numbers of the lights of a scene, by which kernels tell them apart."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.rendering.backend import registry_key


def lights_of(mi_scene: Any) -> list[Any]:
    """The emitters of a scene, in an order that does not depend on how it was loaded."""
    shapes = sorted((s for s in mi_scene.shapes() if s.is_emitter()), key=lambda s: s.id())
    on_shapes = [shape.emitter() for shape in shapes]
    known = {registry_key("EmitterPtr", emitter) for emitter in on_shapes}
    others = [e for e in mi_scene.emitters() if registry_key("EmitterPtr", e) not in known]
    return [*on_shapes, *sorted(others, key=lambda e: e.id())]


def light_names(mi_scene: Any) -> list[str]:
    """Names of `lights_of`: of the shape that shines, "environment", or the light's own."""
    shapes = sorted(s.id() for s in mi_scene.shapes() if s.is_emitter())
    others = lights_of(mi_scene)[len(shapes) :]
    return [*shapes, *("environment" if e.is_environment() else e.id() or "light" for e in others)]


def keys_of(emitters: list[Any]) -> NDArray[np.uint32]:
    """What pointers to emitters are inside a kernel."""
    return np.array([registry_key("EmitterPtr", emitter) for emitter in emitters], dtype=np.uint32)


def light_numbers(emitters: list[Any]) -> Any:
    """Table of the places of emitters in a list, mi.UInt32, by `keys_of`."""
    keys = keys_of(emitters)
    numbers = np.zeros(max(keys, default=0) + 1, dtype=np.uint32)
    numbers[keys] = np.arange(len(keys))
    return mi.UInt32(numbers)


def number_of(numbers: Any, emitter: Any, active: Any) -> Any:
    """Numbers of pointers to emitters, by a table of `light_numbers`; 0 where not active."""
    return dr.gather(mi.UInt32, numbers, dr.reinterpret_array(mi.UInt32, emitter), active)
