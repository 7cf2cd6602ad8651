"""A loaded scene that changes its light without compiling anything.

A rig puts one rectangle and one panorama into a scene and from then on changes their numbers alone. These are kept out
of the compiled code, so kernels serve every pose, every radiance and every panorama of one size, and recordings those
of one kind of light.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.rendering.backend import is_scalar
from gibench.rendering.children import children_of
from gibench.rendering.latlong import for_envmap
from gibench.rendering.lighting import AreaLight, Lighting, LightingError
from gibench.rendering.panoramas import HEIGHT
from gibench.rendering.scene import Scene, make_tables, wrap

AREA_LIGHT, AREA_LIGHT_MATERIAL, ENVIRONMENT = "area_light", "area_light_material", "environment"
"""Names of what a rig adds to a scene."""

RECTANGLE, SKY = "rectangle", "sky"
"""Names of the same among its parameters."""

HIDDEN = 1e-4
"""Metres: sides of the rectangle while it gives no light."""

DARKEST = 1e-30
"""Radiance of textures that give no light, W·m⁻²·sr⁻¹: what float16 and every sum with other light make 0."""

_CONSTANT = for_envmap(np.ones((HEIGHT, 2 * HEIGHT, 3)))


class Lights:
    """The lighting of a scene now, as arrays that kernels read.

    lighting: as it was set. centre: mi.Point3f of an area light, m. placed: mi.Float, 1 where there is one, else 0.
    weights: by which each light of the scene is chosen, in Mitsuba's order.
    """

    def __init__(self, mi_scene: Any) -> None:
        """The scene's own light. mi_scene: the `mitsuba.Scene`."""
        self.show(Lighting(), mi_scene)

    def show(self, lighting: Lighting, mi_scene: Any) -> None:
        """Take another lighting, which the scene has already."""
        self.lighting = lighting
        self.weights = tuple(float(emitter.sampling_weight()) for emitter in mi_scene.emitters())
        self.centre = mi.Point3f(list(lighting.area.centre) if lighting.area else [0.0] * 3)
        self.placed = mi.Float(1.0 if lighting.area else 0.0)
        _keep_out(self.centre, self.placed)

    @property
    def arrays(self) -> dict[str, Any]:
        """What kernels read; see `replay.HoldsArrays`.

        Mitsuba's code for the density of a light sample reads the weights as numbers.
        """
        return {"centre": self.centre, "placed": self.placed, "weights": self.weights}


@dataclass
class _Lamp:
    """Light that a scene brings along. dimmers: parameter → value, for what turns it dark."""

    weight: str
    sampling: float
    dimmers: dict[str, Any]


class LightRig:
    """A rectangle and a panorama in a loaded scene, one of which may take over from the scene's own light.

    scene: the handle to render from now on; that of the constructor is to be dropped. It has one shape and one
    material more, with the last ids, and says in `lights` what lights it. lighting: what it was set to last.
    """

    def __init__(self, scene: Scene, *, panoramas: bool = True) -> None:
        """scene: as it was loaded, under the current variant; its own light stays until something else is set.

        panoramas: whether environments will be set. Without them the scene's own environment stays what it is, and a
        scene without one needs none. Raises LightingError for a scene with lights whose brightness nothing sets.
        """
        mi_scene = scene.mi_scene
        parts = {
            f"part{number}": child
            for number, child in enumerate(children_of(mi_scene))
            if not (panoramas and isinstance(child, mi.Emitter) and child.is_environment())
        }
        names = {key: part.id() for key, part in parts.items()}
        self._own_sky = _Sky.of(mi_scene.environment()) if panoramas else None
        if panoramas:
            white = mi.Bitmap(_CONSTANT)
            parts[SKY] = mi.load_dict({"type": "envmap", "bitmap": white})
        parts[RECTANGLE] = mi.load_dict(
            {
                "type": "rectangle",
                "bsdf": {"type": "diffuse", "id": AREA_LIGHT_MATERIAL, "reflectance": 0.0},
                "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 0.0}},
            }
        )
        lit = mi.load_dict({"type": "scene", **parts}, optimize=False)
        self._corner = [float(c) for c in lit.bbox().min]
        self._parameters = mi.traverse(lit)
        self._lamps = self._own_lamps(names)
        # Loading named the parts anew, since the names that they had may hold dots or be there twice.
        name = AREA_LIGHT
        while name in names.values():
            name += "."
        for key, part in parts.items():
            part.set_id({**names, RECTANGLE: name, SKY: ENVIRONMENT}[key])
        handle = wrap(lit, last=name)
        self._lit = {lamp.weight: True for lamp in self._lamps}
        self.scene = replace(handle, openings=scene.openings, lights=Lights(lit), _beside=scene._beside)
        self.lighting: Lighting | None = None
        self.set(Lighting())

    def _own_lamps(self, ids: dict[str, str]) -> list[_Lamp]:
        """Lights of the scene but for the rig's own two. ids: of the parts, by the names that they have now."""
        names = [n for n in self._parameters.keys() if n.partition(".")[0] not in (RECTANGLE, SKY)]  # noqa: SIM118
        lamps = []
        for weight in (n for n in names if n.endswith(".sampling_weight")):
            stem = weight.removesuffix("sampling_weight")
            below = [n for n in names if n.startswith(stem)]
            scales = [n for n in below if n.endswith("scale")]
            dimmers = scales or [n for n in below if n.rpartition(".")[2] in ("value", "data")]
            if not dimmers:
                raise LightingError(
                    f"the light {ids[stem.partition('.')[0]]!r} has no brightness that can be set: use another kind"
                )
            values = {name: _copy(self._parameters[name]) for name in dimmers}
            lamps.append(_Lamp(weight, float(self._parameters[weight]), values))
        return lamps

    def set(self, lighting: Lighting) -> None:
        """Light the scene by this alone. Nothing is done where it does so already.

        Kernels stay as they are, but for a panorama of another size than the one before it. So do recordings, of which
        each kind of light has its own: which lights are drawn is part of them. Raises LightingError for an environment
        where the rig was made without, and for the scene's own light where that has an environment that a panorama
        cannot stand for.
        """
        if lighting == self.lighting:
            return
        if lighting.environment is not None and self._own_sky is None:
            raise LightingError(
                f"environment {lighting.environment.panorama.name}: this rig was made without panoramas"
            )
        self._set_area(lighting.area)
        sky = lighting.environment is not None
        if self._own_sky is not None:
            sky = self._set_sky(lighting)
        self._switch(lighting.kind == "own", lighting.area is not None, sky)
        self._parameters.update()
        make_tables(self.scene.mi_scene)
        self.scene.lights.show(lighting, self.scene.mi_scene)
        if self.scene.portals is not None:
            by_own = self._own_sky is None and lighting.kind == "own"
            self.scene.portals.open(sky or by_own)
        self.lighting = lighting

    def _put(self, name: str, value: Any) -> None:
        _keep_out(value)
        self._parameters[name] = value

    def _set_area(self, area: AreaLight | None) -> None:
        # Out of sight, but never far away: the scene's bounds decide how rays are started.

        hidden = AreaLight(tuple(self._corner), (0, 0, 1), HIDDEN, HIDDEN, (0, 0, 0))  # type: ignore[arg-type]
        shown = area or hidden
        before = (self.lighting.area or hidden) if self.lighting is not None else None
        if before is None or not np.array_equal(before.to_world, shown.to_world):
            self._put(f"{RECTANGLE}.to_world", _transform(shown.to_world))
        self._put(f"{RECTANGLE}.emitter.radiance.value", mi.Color3f(list(shown.radiance)))

    def _set_sky(self, lighting: Lighting) -> bool:
        """Returns whether light is drawn from the sky.

        A black environment is dark by its scale, and drawn by what was there before: recordings of others serve it.
        """
        environment, own = lighting.environment, self._own_sky
        assert own is not None
        pixels, to_world = None, own.to_world
        if environment is None:
            drawn = lighting.kind == "own" and own.bright
            scale = own.scale if drawn else 0.0
            if drawn or self.lighting is None:
                pixels = own.pixels
        else:
            drawn, to_world = True, environment.to_world
            bright = bool(environment.panorama.pixels.any())
            scale = float(bright)
            if bright:
                pixels = _around(for_envmap(environment.panorama.pixels))
        self._put(f"{SKY}.scale", mi.Float(scale))
        if pixels is not None:
            self._put(f"{SKY}.data", mi.TensorXf(pixels))
            self._put(f"{SKY}.to_world", _transform(to_world))
        return drawn

    def _switch(self, own: bool, area: bool, sky: bool) -> None:
        """Turn lights on and off, and with them their sampling."""
        for lamp in self._lamps:
            if self._lit[lamp.weight] != own or self.lighting is None:
                for name, value in lamp.dimmers.items():
                    self._put(name, _copy(value) if own else _dimmed(name, value))
                self._lit[lamp.weight] = own
            self._parameters[lamp.weight] = lamp.sampling if own else 0.0
        lit = area or (own and any(lamp.sampling > 0 for lamp in self._lamps))
        if self._own_sky is not None:
            self._parameters[f"{SKY}.sampling_weight"] = self._own_sky.sampling if sky else 0.0
            lit |= sky
        # Something must be drawn where all is dark. Everything at 1 would be drawn by other code than weights are, so
        # there is always a light of weight 0.
        self._parameters[f"{RECTANGLE}.emitter.sampling_weight"] = float(area or not lit)


@dataclass
class _Sky:
    """The environment that a scene brings along, as a panorama.

    A dark one is dark by its scale: a panorama of zeros has no density, and paths that meet it would be lost.
    """

    bright: bool = False
    sampling: float = 1.0
    scale: float = 1.0
    to_world: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    pixels: NDArray[np.float32] = field(default_factory=lambda: _around(_CONSTANT))

    @classmethod
    def of(cls, emitter: Any) -> _Sky:
        """Raises LightingError for what no panorama can stand for."""
        if emitter is None:
            return cls()
        parameters = mi.traverse(emitter)
        sampling = float(parameters["sampling_weight"])
        if "data" in parameters and "scale" in parameters:
            pixels = np.array(parameters["data"])
            scale = float(np.ravel(np.array(parameters["scale"]))[0])
            matrix = np.array(parameters["to_world"].matrix, dtype=np.float64).reshape(4, 4)
            return cls(True, sampling, scale, matrix, pixels) if scale > 0 and pixels.any() else cls()
        if "radiance.value" in parameters:
            color = np.broadcast_to(np.ravel(np.array(parameters["radiance.value"])), 3).astype(np.float32)
            return cls(True, sampling, pixels=cls().pixels * color) if color.any() else cls()
        raise LightingError(
            f"the scene's own environment is a {emitter.class_name()}, which a rig for panoramas does not give back: "
            "make the rig without panoramas, or the environment a panorama"
        )


def _keep_out(*values: Any) -> None:
    """Makes numbers inputs of kernels, in place of parts of their code."""
    if not is_scalar():
        dr.make_opaque(*values)


def _around(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """One column more on either side, as the parameter of Mitsuba's `envmap` has it."""
    return np.pad(image, ((0, 0), (1, 1), (0, 0)), "wrap")


def _transform(matrix: NDArray[np.float64]) -> Any:
    return mi.AffineTransform4f(matrix)


def _copy(value: Any) -> Any:
    return type(value)(value)


def _dimmed(name: str, value: Any) -> Any:
    # A texture of zeros has no density, and paths that meet it would be lost.
    return value * 0 + (DARKEST if name.endswith(".data") else 0)
