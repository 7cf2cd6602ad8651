"""Kernels of a frame that are traced in Python once and then replayed.

Tracing what a frame computes takes Python longer than running it takes a GPU (a path tracer a quarter of a second), and
it is no part of a method. `drjit.freeze` records the launched kernels and repeats them with other inputs. Whatever
changes from frame to frame must therefore be among the arguments: a number that the function reads elsewhere stays what
it was when the recording was made.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import weakref
from collections.abc import Callable
from functools import cache, partial
from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.rendering.backend import tracing
from gibench.rendering.camera import PinholeCamera, RayGenerator
from gibench.rendering.scene import Scene


@cache
def _kinds(variant: str) -> list[Any]:
    """A pointer to a plugin of every kind that kernels call, the same for all replays. variant: the current one.

    A call of a BSDF, a shape or a light reaches all that are alive in the process, those of other scenes too. Dr.Jit
    looks for them where a pointer of that kind is among the inputs.
    """
    lamp = mi.load_dict({"type": "sphere", "bsdf": {"type": "diffuse"}, "emitter": {"type": "area"}})
    return [mi.ShapePtr(lamp), mi.BSDFPtr(lamp.bsdf()), mi.EmitterPtr(lamp.emitter()), lamp]


class Replay:
    """A function of Dr.Jit arrays that is recorded when it is first called and replayed after that.

    It is recorded again where a Python number among the arguments changes, or the number of lanes against another. The
    function must not refer to the owner of the Replay: a scene in a reference cycle dies when Python next looks for
    cycles, and where that is while kernels are traced, the process is aborted.
    """

    def __init__(self, scene: Scene, function: Callable[..., Any], *held: Any) -> None:
        """scene: which the function may read. function: of arrays and pytrees of them, returns such.

        held: arrays, or pytrees of them, that it reads besides and that stay as they are.
        """
        guide = [] if scene.guide is None else scene.guide.arrays
        kinds = _kinds(str(mi.variant()))
        self._held = [scene.mi_scene, scene.tables, scene.layers.arrays, guide, kinds, held]
        # Their arrays are others after a change of the light.
        self._changing = [thing for thing in (scene.portals, scene.lights) if thing is not None]
        self._function = function
        me = weakref.ref(self)  # `dr.freeze` makes cycles of its own, which would hold the scene

        @dr.freeze
        def frozen(held: Any, arguments: Any) -> Any:
            owner = me()
            assert owner is not None  # it is what calls
            return owner._function(*arguments)

        self._frozen = frozen

    @property
    def recordings(self) -> int:
        """Number of recordings so far."""
        return int(self._frozen.n_recordings)

    def __call__(self, *arguments: Any) -> Any:
        """Call the function."""
        with tracing():
            return self._frozen([*self._held, *map(arrays_of, self._changing)], arguments)


def arrays_of(thing: Any) -> dict[str, Any]:
    """The Dr.Jit arrays among the attributes of an object, by name, for a `Replay` to hold."""
    return {name: value for name, value in vars(thing).items() if dr.is_array_v(value)}


def camera_arrays(camera: PinholeCamera, resolution: tuple[int, int]) -> dict[str, Any]:
    """The arrays that a frame's rays depend on, as an argument of a `Replay`."""
    return vars(RayGenerator(camera, resolution))


def ray_generator(arrays: dict[str, Any]) -> RayGenerator:
    """The generator that `camera_arrays` took apart."""
    generator = object.__new__(RayGenerator)
    vars(generator).update(arrays)
    return generator


def replayed(scene: Scene, name: Any, function: Callable[..., Any], *held: Any) -> Replay:
    """The `Replay` of a function of a scene and arrays, which lives as long as the scene.

    name: by which it is found again. function: gets the scene first. held: as for a `Replay`.
    """
    found = scene.replays.get(name)
    if found is None:
        # By a weak reference, or the scene would be in a cycle.
        found = scene.replays[name] = Replay(scene, partial(_call, weakref.ref(scene), function), *held)
    return found


def _call(scene: weakref.ref[Scene], function: Callable[..., Any], *arguments: Any) -> Any:
    return function(scene(), *arguments)
