"""A scene that is ready to be rendered: Mitsuba's, with stable ids for its materials and shapes."""

from __future__ import annotations

import contextlib
import json
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from gibench import gate
from gibench.errors import GibenchError
from gibench.rendering.backend import is_scalar, registry_key, select_variant, threads_to_load
from gibench.rendering.kernel_sharing import spare_plugins

OPENINGS = "openings.json"
"""Beside scene.xml: a list of rectangles, each as corner and two edges in metres, that daylight enters by."""


PLAIN, GUIDED = "plain", "guided"

SAMPLINGS = (PLAIN, GUIDED)
"""Choice of lights and directions: from the materials alone, or also from what is learned of the room first. The
means are the same; a guide takes 2 to 6 CPU seconds a scene, makes paths 1.5 times as long, and takes two
thirds to three quarters of the variance away."""


class SceneError(GibenchError):
    """A scene file that is not there or that Mitsuba refuses, or a scene with a shape that cannot be rendered."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A loaded Mitsuba scene.

    mi_scene: the `mitsuba.Scene`. materials, shapes: names by id; id i is entry i − 1, since id 0 is a miss. The order
    is alphabetical by shape id (a material stands where its first shape does): Mitsuba loads in parallel and lists
    shapes in an order of its own. openings: (N, 3, 3), the rectangles that daylight enters by (corner and two edges
    whose cross product points inside, metres), or None where nothing is known of them. lights: `light_rig.Lights`, what
    lights it now, or None for a scene that keeps its own light. sampling: one of SAMPLINGS.
    """

    mi_scene: Any
    materials: tuple[str, ...]
    shapes: tuple[str, ...]
    _material_of: dict[int, int]
    _shape_of: dict[int, int]
    openings: NDArray[np.float64] | None = None
    lights: Any = None
    sampling: str = PLAIN
    _beside: tuple[Any, ...] = ()  # what must live as long as the scene

    @cached_property
    def replays(self) -> dict[Any, Any]:
        """Kernels that were recorded for this scene, by name; see `replay.replayed`."""
        return {}

    @cached_property
    def tables(self) -> tuple[Any, Any]:
        """Ids of materials and of shapes, by what identifies them inside a kernel; mi.UInt32 each."""
        import drjit as dr
        import mitsuba as mi

        def table(ids: dict[int, int]) -> Any:
            values = np.zeros(max(ids, default=0) + 1, dtype=np.uint32)
            values[list(ids)] = list(ids.values())
            array = mi.UInt32(values)
            dr.make_opaque(array)
            return array

        return table(self._material_of), table(self._shape_of)

    @cached_property
    def portals(self) -> Any:
        """`portals.Portals` of the openings; None where none are known, or under the scalar variant.

        Under a light that stays they have the share of the samples that pays in this room (`portal_share`), and are
        None where that is none.
        """
        if self.openings is None or is_scalar():
            return None
        from gibench.rendering.portals import Portals

        portals = Portals(self.mi_scene, self.openings)
        if self.lights is not None:
            return portals
        if not portals.lead_outside:
            return None
        from gibench.rendering.portal_share import portal_share

        share = portal_share(self.mi_scene, portals)
        portals.send(share)
        return portals if share > 0 else None

    @cached_property
    def guide(self) -> Any:
        """`guiding.guide.Guide` of the scene as it is lit when first asked for.

        None where the sampling is plain, where the light moves, where there is nothing to learn, or under the scalar
        variant.
        """
        if self.sampling == PLAIN or self.lights is not None:
            return None
        from gibench.rendering.guiding.learning import learn

        return learn(self)

    @cached_property
    def layers(self) -> Any:
        """`layers.Layers` of the materials."""
        from gibench.rendering.layers import Layers

        bsdfs = {id(bsdf): bsdf for shape in self.mi_scene.shapes() if (bsdf := shape.bsdf()) is not None}
        return Layers(list(bsdfs.values()))

    @cached_property
    def curvature(self) -> Any:
        """`curvature.Curvature` of the shapes."""
        from gibench.rendering.curvature import Curvature

        return Curvature(list(self.mi_scene.shapes()))

    def material_ids(self, bsdf: Any, active: Any) -> Any:
        """Ids (from 1) of an array of BSDF pointers; 0 where not `active`."""
        import drjit as dr
        import mitsuba as mi

        if is_scalar():
            return self._material_of.get(id(bsdf), 0) if active else 0
        return dr.gather(mi.UInt32, self.tables[0], dr.reinterpret_array(mi.UInt32, bsdf), active)

    def shape_ids(self, shape: Any, active: Any) -> Any:
        """Ids (from 1) of an array of shape pointers; 0 where not `active`."""
        import drjit as dr
        import mitsuba as mi

        if is_scalar():
            return self._shape_of.get(id(shape), 0) if active else 0
        return dr.gather(mi.UInt32, self.tables[1], dr.reinterpret_array(mi.UInt32, shape), active)


def _check(shape: Any) -> None:
    """Raise SceneError for a mesh without triangles, and for a lamp without area, which would shine in vain."""
    if shape.is_mesh() and shape.face_count() == 0:
        raise SceneError(f"the mesh {shape.id()!r} has no triangles: remove it")
    if shape.is_emitter():
        area = float(np.array(shape.surface_area()).item())
        if not (np.isfinite(area) and area > 0):
            raise SceneError(
                f"the light {shape.id()!r} has an area of {area:g} m²: give it a size or remove it"
            )


def make_tables(mi_scene: Any) -> None:
    """Let lights with a texture make the tables by which they are sampled.

    They do so when they are first sampled. Where that is in the middle of a recording (`replay`), be it of another
    scene, whose calls reach all lights that are alive, the tables would be no input of it.
    """
    if is_scalar():
        return
    import drjit as dr
    import mitsuba as mi

    nowhere = dr.zeros(mi.Interaction3f, 1)
    for emitter in mi_scene.emitters():
        if mi.has_flag(emitter.flags(), mi.EmitterFlags.SpatiallyVarying) and not emitter.is_environment():
            dr.eval(emitter.sample_direction(nowhere, mi.Point2f(0.5))[1])


def wrap(mi_scene: Any, *, last: str = "") -> Scene:
    """The handle of a `mitsuba.Scene` that already exists, made under the current variant.

    last: id of a shape that is numbered after all others, so that these keep their ids without it.
    Raises SceneError for a mesh without triangles or a light without area.
    """

    for shape in mi_scene.shapes():
        _check(shape)
    materials: list[str] = []
    material_of: dict[int, int] = {}
    shapes: list[str] = []
    shape_of: dict[int, int] = {}
    for number, shape in enumerate(sorted(mi_scene.shapes(), key=lambda s: (s.id() == last, s.id()))):
        shapes.append(shape.id() or f"shape_{number}")
        shape_of[registry_key("ShapePtr", shape)] = number + 1
        bsdf = shape.bsdf()
        if bsdf is None:
            continue
        key = registry_key("BSDFPtr", bsdf)
        if key not in material_of:
            materials.append(bsdf.id() or f"material_{len(materials)}")
            material_of[key] = len(materials)
    make_tables(mi_scene)
    return Scene(mi_scene, tuple(materials), tuple(shapes), material_of, shape_of)


def load_dict(description: dict[str, Any]) -> Scene:
    """A scene from Mitsuba's dictionary form. Selects a variant where none is current."""
    select_variant()
    import mitsuba as mi

    return wrap(mi.load_dict(description, optimize=False))


def load_scene(path: str | Path, *, share_kernels: bool = False, sampling: str = PLAIN) -> Scene:
    """A scene from a Mitsuba 3 XML file, of its cameras the first alone. Selects a variant where none is current.

    share_kernels: for one of many rooms, so that the next need not be compiled again; see `kernel_sharing`. A file
    OPENINGS beside it says where daylight enters; without it the same image takes more samples. sampling: one of
    SAMPLINGS.

    Raises SceneError for another sampling, where the file is missing or Mitsuba refuses it, with its reason, and as
    `wrap` does.
    """
    select_variant()
    if sampling not in SAMPLINGS:
        raise SceneError(f"there is no sampling {sampling!r}: use {' or '.join(SAMPLINGS)}")
    if not Path(path).is_file():
        raise SceneError(f"there is no scene file {path}")
    try:
        # Mitsuba would merge shapes that share a material, and their ids with them.
        with threads_to_load():
            scene = wrap(_read(Path(path)))
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise SceneError(f"Mitsuba refuses {path}: {reason}") from error
    openings = _openings(Path(path).with_name(OPENINGS))
    return replace(
        scene, openings=openings, sampling=sampling, _beside=spare_plugins() if share_kernels else ()
    )


def _read(path: Path) -> Any:
    """Mitsuba's scene of a file. Frames have cameras of their own, and recorded kernels look through all that a scene
    holds whenever they are replayed: a thousand cameras take a tenth of a second.
    """
    import mitsuba as mi

    with contextlib.suppress(ElementTree.ParseError):  # of which Mitsuba says more
        root = ElementTree.parse(path).getroot()
        cameras = root.findall("sensor")
        if len(cameras) > 1:
            for camera in cameras[1:]:
                root.remove(camera)
            files = mi.file_resolver()
            files.prepend(str(path.resolve().parent))
            try:
                return mi.load_string(ElementTree.tostring(root, encoding="unicode"), optimize=False)
            finally:
                del files[0]
    return mi.load_file(str(path), optimize=False)


def _openings(file: Path) -> NDArray[np.float64] | None:
    if not file.is_file():
        return None
    try:
        openings = np.array(json.loads(gate.read_regular(file)), dtype=np.float64).reshape(-1, 3, 3)
    except (ValueError, TypeError, RecursionError, OverflowError):
        openings = np.full((1, 3, 3), np.nan)
    if not np.isfinite(openings).all():
        raise SceneError(
            f"{file} is no list of rectangles (corner and two edges, metres): remove it or mend it"
        )
    return openings
