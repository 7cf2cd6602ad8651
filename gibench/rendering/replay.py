"""Kernels of a frame that are traced in Python once and then replayed.

Tracing what a frame computes takes Python longer than running it takes a GPU (a path tracer a quarter of a second), and
it is no part of a method. `drjit.freeze` records the launched kernels and repeats them with other inputs. Whatever
changes from frame to frame must therefore be among the arguments: a number that the function reads elsewhere stays what
it was when the recording was made.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from typing import Any, Protocol

import drjit as dr
import mitsuba as mi

from gibench.errors import GibenchError
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
        guide = [] if scene.guide is None else arrays_of(scene.guide)
        kinds = _kinds(str(mi.variant()))
        self._held = [scene.mi_scene, scene.tables, scene.layers.arrays, guide, kinds, held]
        # Their arrays are others after a change of the light, and with another kind of light their numbers.
        self._changing = [thing for thing in (scene.portals, scene.lights) if thing is not None]
        for thing in self._changing:
            arrays_of(thing)
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
            return self._frozen([*self._held, *(thing.arrays for thing in self._changing)], arguments)


class ReplayError(GibenchError):
    """A thing whose arrays a recording would miss."""


class HoldsArrays(Protocol):
    """A thing that kernels read. It declares what it holds, since a recording bakes in what it is not shown."""

    @property
    def arrays(self) -> Any:
        """Its Dr.Jit arrays now, a pytree of lists and dictionaries.

        Python numbers among them tell recordings apart: those that kernels bake in.
        """


def arrays_of(thing: HoldsArrays) -> Any:
    """`thing.arrays`, for a `Replay` to hold.

    Raises ReplayError where an attribute holds an array, however deep, that is not among them.
    """
    declared = {id(array) for _, array in _leaves(thing.arrays, "")}
    for name, value in vars(thing).items():
        for place, array in _leaves(value, name):
            if id(array) not in declared:
                raise ReplayError(
                    f"{type(thing).__name__}.{place} is an array that `arrays` leaves out: a recording would keep the "
                    "value that it has now"
                )
    return thing.arrays


def _leaves(value: Any, place: str) -> Iterator[tuple[str, Any]]:
    """The Dr.Jit arrays in lists and dictionaries, with their places. Other things declare theirs themselves."""
    if dr.is_array_v(value):
        yield place, value
    elif isinstance(value, Mapping):
        for key, one in value.items():
            yield from _leaves(one, f"{place}[{key!r}]")
    elif isinstance(value, list | tuple):
        for number, one in enumerate(value):
            yield from _leaves(one, f"{place}[{number}]")


def camera_arrays(camera: PinholeCamera, resolution: tuple[int, int]) -> dict[str, Any]:
    """The arrays that a frame's rays depend on, as an argument of a `Replay`."""
    return RayGenerator(camera, resolution).arrays


def ray_generator(arrays: dict[str, Any]) -> RayGenerator:
    """The generator whose `arrays` these are."""
    return RayGenerator.of(arrays)


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
