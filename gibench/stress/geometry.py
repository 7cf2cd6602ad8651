"""Geometry that breaks ray tracers: slivers, doubles, holes, thin walls, and places far from the origin."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import norm

from gibench.rendering.camera import PinholeCamera
from gibench.rendering.render import render_frame
from gibench.rendering.scene import Scene, SceneError, load_dict
from gibench.stress import meshes
from gibench.stress.answers import (
    CHANCE,
    ROUNDING,
    UndecidedError,
    mean_check,
    not_finite,
    parallel_rectangle,
    perpendicular_rectangle,
)
from gibench.stress.registry import Check, Found, case
from gibench.stress.scenes import area, closed_answer, constant, diffuse, mesh, rectangle, rgb
from gibench.stress.views import INSIDE, POINT, SURFACE_SETS, seen

REFLECTANCE, DEPTH = 0.5, 24

EQUILIBRIUM = 1 / (1 - REFLECTANCE)
"""Radiance everywhere in and around surfaces that emit 1, under a sky of just this radiance: whatever their shape."""

BALANCE = "a furnace in balance: 1 / (1 − reflectance) everywhere; noise"

OFFSETS = (
    "Mitsuba starts rays 9e-5 · (1 m + |p|) off their surface: 0.9 m at 10 km, a tenth of a room that is 1 mm in size. "
    "Keep rooms near the origin, in metres"
)


def in_balance(vertices: ArrayLike, faces: ArrayLike) -> Scene:
    """A mesh that emits 1 and reflects half, under a sky that it cannot be told from."""
    matt = {"type": "diffuse", "reflectance": rgb(REFLECTANCE)}
    return load_dict(
        {
            "type": "scene",
            "sky": constant(EQUILIBRIUM),
            "thing": mesh(vertices, faces, bsdf=matt, emitter=area(1.0)),
        }
    )


def lightmap_checks(scene: Scene, radiance: float, known: str = "") -> Found:
    """A bake where every texel sees the same radiance in all directions: pi times that."""
    from gibench.baselines.lightmap.bake import bake_atlas

    baked = bake_atlas(scene, texels_per_metre=4, spp=64, denoise=False, max_depth=DEPTH)
    texels = baked.atlas[baked.charts >= 0].astype(np.float64).mean(axis=-1)
    answer = np.pi * radiance
    bound = norm.isf(CHANCE / 2) * texels.std() / np.sqrt(baked.traced) / answer + ROUNDING
    if bound > 0.05:
        raise UndecidedError(f"lightmap: noise leaves {bound:.1%} of the answer open")
    yield Check(
        "lightmap", "irradiance", abs(float(texels.mean()) / answer - 1), float(bound), BALANCE, known
    )
    dark = float((texels < 0.25 * answer).sum())
    yield Check("lightmap", "texels on charts that are dark", dark, 0, "the furnace is even")


@case("{kind}", kind=tuple(meshes.BROKEN), quick=("needle triangles", "zero-area triangles", "open mesh"))
def broken_mesh(kind: str) -> Found:
    """A cube whose mesh is broken in one way: the light inside does not change."""
    scene = in_balance(*meshes.BROKEN[kind]())
    yield mean_check("light", "radiance", seen(scene, INSIDE, max_depth=DEPTH), EQUILIBRIUM, BALANCE)
    yield from surfaces_checks(scene, INSIDE)
    yield from lightmap_checks(scene, EQUILIBRIUM)


TWICE = "two lamps in one place: each is sampled, and only one is hit"


@case("{kind}", kind=tuple(meshes.DOUBLED), quick=("duplicated faces",))
def doubled_mesh(kind: str) -> Found:
    """A cube every point of whose surface belongs to two triangles, seen from outside under the sky, and shining."""
    vertices, faces = meshes.DOUBLED[kind]()
    outwards = mesh(vertices, faces[:, ::-1], bsdf=diffuse(REFLECTANCE))
    scene = load_dict({"type": "scene", "sky": constant(1.0), "thing": outwards})
    outside = PinholeCamera((3.0, 2.0, 1.5), (0.0, 0.0, 0.0), 0.3)
    yield mean_check("light", "radiance", seen(scene, outside), REFLECTANCE, "reflectance · sky; noise")
    yield from surfaces_checks(scene, outside)
    yield from lightmap_checks(scene, 1.0)
    frame = seen(in_balance(vertices, faces), INSIDE, max_depth=DEPTH)
    yield mean_check("light", "radiance where the faces shine", frame, EQUILIBRIUM, BALANCE, known=TWICE)


def surfaces_checks(
    scene: Scene, camera: PinholeCamera, middle: tuple[float, ...] = (0.0, 0.0, 0.0), half: float = 1.0
) -> Found:
    """All channels are finite, and positions lie on the cube of half side `half` around `middle`, relative to it."""
    arrays = render_frame(
        scene, camera, resolution=(64, 64), channels=SURFACE_SETS, previous_camera=camera
    ).arrays
    yield Check("surface", "values that are not finite", not_finite(arrays), 0, "the contract")
    hit = arrays["distance"][..., 0] > 0
    offset = np.abs(arrays["position"].astype(np.float64) - middle).max(axis=-1)[hit]
    error = float(np.abs(offset / half - 1).max()) if hit.any() else np.inf
    bound = 8 * 2.0**-24 * (max(middle) + half) / half
    yield Check("surface", "positions off the walls", error, bound, "8 roundings of float32")


@case("one triangle", quick=True)
def one_triangle() -> Found:
    """The smallest mesh, under the sky."""
    scene = load_dict(
        {
            "type": "scene",
            "sky": constant(EQUILIBRIUM),
            "thing": mesh([[-9, -9, 0], [9, -9, 0], [0, 9, 0]], [[0, 1, 2]], bsdf=diffuse(REFLECTANCE)),
        }
    )
    above = PinholeCamera((0.0, -1.0, 1.0), (0.0, 0.0, 0.0), 0.5)
    answer = REFLECTANCE * EQUILIBRIUM
    yield mean_check("light", "radiance", seen(scene, above), answer, "reflectance · sky; noise")
    frame = render_frame(scene, above, resolution=(16, 16), channels=SURFACE_SETS)
    yield Check("surface", "values that are not finite", not_finite(frame.arrays), 0, "the contract")
    yield from lightmap_checks(scene, EQUILIBRIUM)


@case("a million triangles")
def a_million_triangles() -> Found:
    """A cube of 1,009,200 triangles."""
    vertices, faces = meshes.cube(np.linspace(-1, 1, 291))
    scene = in_balance(vertices, faces)
    yield mean_check("light", "radiance", seen(scene, INSIDE, max_depth=DEPTH), EQUILIBRIUM, BALANCE)
    yield from surfaces_checks(scene, INSIDE)


EDGES = (
    "Embree's fast mode, Mitsuba's default, is not watertight; its robust mode (`embree_use_robust_intersections` in a "
    "scene) is, and takes a tenth longer in a furnished room, whose walls are solids with a second skin"
)


@case("rays through vertices and along edges", quick=True)
def rays_through_vertices() -> Found:
    """A camera in the middle, whose every other ray meets a vertex or an edge: none may slip through.

    Beyond the cube is a sky a million times as bright, so that one path in a million that got out would be seen.
    """
    vertices, faces = meshes.cube(np.linspace(-1, 1, 17))
    matt = {"type": "diffuse", "reflectance": rgb(REFLECTANCE)}
    # 33 pixels across the side at x = 1: every other centre lies on a line of its grid.
    camera = PinholeCamera((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), np.pi / 2)
    for what, robust, known in (("as Mitsuba comes", False, EDGES), ("robust", True, "")):
        thing = mesh(vertices, faces, bsdf=matt, emitter=area(1.0))
        given = {"embree_use_robust_intersections": robust, "sky": constant(1e6), "thing": thing}
        scene = load_dict({"type": "scene", **given})
        frame = render_frame(scene, camera, resolution=(33, 33), channels=["distance"])
        missed = float((frame.arrays["distance"] == 0).sum())
        yield Check(
            "surface", f"rays of 1089 that slip through, {what}", missed, 0, "the cube is closed", known
        )
    frame = seen(scene, camera, resolution=(33, 33))
    answer = closed_answer(REFLECTANCE, 1.0, 8)
    yield mean_check("light", "radiance, robust", frame, answer, "sum of the series; noise")


@case("walls of {thickness:g} m in bright light", thickness=(1e-3, 1e-4), quick=(1e-3,))
def thin_walls(thickness: float) -> Found:
    """A dark room whose walls keep out a sky of 1e6: not one path may get in."""
    import mitsuba as mi

    walls: dict[str, Any] = {}
    for axis in range(3):
        for side in (-1, 1):
            low, high = np.full(3, -1 - thickness), np.full(3, 1 + thickness)
            low[axis], high[axis] = sorted((float(side), side * (1 + thickness)))
            place = mi.ScalarTransform4f().translate(((low + high) / 2).tolist())
            place = place @ mi.ScalarTransform4f().scale(((high - low) / 2).tolist())
            walls[f"wall{axis}{side}"] = {"type": "cube", "to_world": place, "bsdf": diffuse(REFLECTANCE)}
    scene = load_dict({"type": "scene", "sky": constant(1e6), **walls})
    frame = seen(scene, INSIDE)
    yield Check(
        "light", "light that gets in (of 1e6)", float(frame.arrays["color"].max()), 0, "the walls are closed"
    )


@case("inverted normals", quick=True)
def inverted_normals() -> Found:
    """A floor that is wound the wrong way round, and one whose normals contradict its winding."""
    import mitsuba as mi

    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
    camera = PinholeCamera((0.0, -1.0, 1.0), (0.0, 0.0, 0.0), 0.1)
    for what, faces, normal in (
        ("wound backwards", [[0, 2, 1], [0, 3, 2]], None),
        ("normals turned", [[0, 1, 2], [0, 2, 3]], (0, 0, -1)),
    ):
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict(diffuse(REFLECTANCE))
        shape = mi.Mesh("floor", 4, 2, has_vertex_normals=normal is not None, props=properties)
        parameters = mi.traverse(shape)
        parameters["vertex_positions"] = corners.ravel()
        parameters["faces"] = np.ravel(faces)
        if normal is not None:
            parameters["vertex_normals"] = np.tile(normal, 4).astype(np.float32)
        parameters.update()
        scene = load_dict({"type": "scene", "sky": constant(1.0), "floor": shape})
        frame = seen(scene, camera)
        yield mean_check("light", f"radiance, {what}", frame, REFLECTANCE, "reflectance · sky; noise")
        surface = render_frame(scene, camera, resolution=(8, 8), channels=["surface", "reflection"]).arrays
        error = float(np.abs(surface["normal"] - [0, 0, 1]).max())
        yield Check("surface", f"normal towards the viewer, {what}", error, 2.0**-20, "the contract")
        into = float(surface["reflected_distance"].max())
        yield Check("surface", f"mirror rays that go down, {what}", into, 0, "the floor is flat")


@case("mesh without triangles", quick=True)
def mesh_without_triangles() -> Found:
    """Refused by name."""
    import mitsuba as mi

    refused = False
    try:
        load_dict({"type": "scene", "nothing": mi.Mesh("nothing", 0, 0)})
    except SceneError as error:
        refused = "no triangles" in str(error)
    yield Check("checks", "meshes that are let pass", float(not refused), 0, "a named error")


PLACES = {
    "moved by 10 m": (1.0, 10.0),
    "moved by 10 km": (1.0, 1e4),
    "scaled by 1e-3": (1e-3, 0.0),
    "scaled by 1e3": (1e3, 0.0),
}
"""Scale, and how far along x and y the room is moved, metres."""


@case("room {where}", where=tuple(PLACES), quick=("moved by 10 km", "scaled by 1e-3"))
def room_elsewhere(where: str) -> Found:
    """Light does not know where the origin is, nor what a metre is."""
    scale, shift = PLACES[where]
    known = OFFSETS if where in ("moved by 10 km", "scaled by 1e-3") else ""

    def place(x: float, y: float, z: float) -> tuple[float, float, float]:
        return (x * scale + shift, y * scale + shift, z * scale)

    vertices, faces = meshes.cube(np.linspace(-1, 1, 5))
    scene = in_balance(vertices * scale + [shift, shift, 0], faces)
    camera = PinholeCamera(place(0, 0, 0), place(1, 0.2, 0.1), 1.2)
    frame = seen(scene, camera, max_depth=DEPTH, spp=4096)
    yield mean_check("light", "radiance of a furnace", frame, EQUILIBRIUM, BALANCE, known=known)
    yield from surfaces_checks(scene, camera, camera.position, scale)
    if scale == 1:
        yield from lightmap_checks(scene, EQUILIBRIUM, known)

    # A plate of 1 m, 1 cm above the floor: what is below it is dark.
    floor = rectangle(place(0, 0, 0), [0, 0, 1], (scale, scale), bsdf=diffuse(REFLECTANCE))
    plate = rectangle(place(0, 0, 0.01), [0, 0, -1], (0.5 * scale, 0.5 * scale), bsdf=diffuse(0.0))
    below = load_dict({"type": "scene", "sky": constant(1.0), "floor": floor, "plate": plate})
    camera = PinholeCamera(place(0, -0.4, 0.005), place(0, 0, 0), POINT)
    light = float(seen(below, camera, max_depth=1).arrays["color"].mean())
    bound = 4 * REFLECTANCE * (1 - parallel_rectangle(0.5, 0.5, 0.01))
    what = "light below a plate 1 cm above a floor (absolute)"
    yield Check("light", what, light, bound, "4 × what comes in at its edges, in closed form", known)

    wall = rectangle(place(0, 0, 0), [1, 0, 0], (2 * scale, 2 * scale), bsdf=diffuse(REFLECTANCE))
    half = (0.5 * scale, scale)
    lamp = rectangle(place(0.5, 0, 1), [0, 0, -1], half, bsdf=diffuse(0.0), emitter=area(1.0))
    scene = load_dict({"type": "scene", "wall": wall, "lamp": lamp})
    camera = PinholeCamera(place(2, 0, 0.2), place(0, 0, 0.95), POINT)
    answer = REFLECTANCE * perpendicular_rectangle(1.0, 1.0, 0.05)
    frame = seen(scene, camera, max_depth=1)
    source = "form factor in closed form; noise"
    yield mean_check(
        "light", "radiance 5 cm below a lamp that touches the wall", frame, answer, source, known=known
    )
