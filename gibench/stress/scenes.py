"""Pieces of small scenes in Mitsuba's dictionary form; Z up, metres."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike


def rgb(*value: float) -> dict[str, Any]:
    """A colour from three numbers, or a grey from one."""
    return {"type": "rgb", "value": list(value) if len(value) > 1 else [value[0]] * 3}


def two_sided(**bsdf: Any) -> dict[str, Any]:
    """A material that both sides of a surface have."""
    return {"type": "twosided", "inside": bsdf}


def diffuse(*reflectance: float) -> dict[str, Any]:
    """A matt material of both sides."""
    return two_sided(type="diffuse", reflectance=rgb(*reflectance))


def metal(alpha: float) -> dict[str, Any]:
    """A rough conductor that absorbs nothing."""
    return two_sided(type="roughconductor", material="none", alpha=alpha, distribution="ggx")


def coat(alpha: float, *reflectance: float) -> dict[str, Any]:
    """A matt base under a rough coat of index 1.5, as `gibench.generators.materials` writes it."""
    return two_sided(
        type="roughplastic",
        alpha=alpha,
        distribution="ggx",
        int_ior=1.5,
        nonlinear=False,
        diffuse_reflectance=rgb(*reflectance),
    )


def area(*radiance: float) -> dict[str, Any]:
    """An area light."""
    return {"type": "area", "radiance": rgb(*radiance)}


def constant(radiance: float) -> dict[str, Any]:
    """The same light from everywhere."""
    return {"type": "constant", "radiance": rgb(radiance)}


def rectangle(centre: ArrayLike, normal: ArrayLike, half: tuple[float, float], **more: Any) -> dict[str, Any]:
    """A rectangle of half sides `half` that faces along `normal`."""
    import mitsuba as mi

    centre, normal = np.asarray(centre, dtype=float), np.asarray(normal, dtype=float)
    up = [0.0, 1.0, 0.0] if abs(normal[2]) > 0.5 else [0.0, 0.0, 1.0]
    place = mi.ScalarTransform4f().look_at(origin=centre.tolist(), target=(centre + normal).tolist(), up=up)
    return {
        "type": "rectangle",
        "to_world": place @ mi.ScalarTransform4f().scale([half[0], half[1], 1]),
        **more,
    }


def closed_box(reflectance: float, emitted: float) -> dict[str, Any]:
    """A cube of 2 m around the origin whose six walls emit `emitted` and reflect `reflectance`."""
    walls = {
        f"wall{axis}{side}": rectangle(
            [side if a == axis else 0 for a in range(3)],
            [-side if a == axis else 0 for a in range(3)],
            (1, 1),
            bsdf={"type": "diffuse", "reflectance": rgb(reflectance)},
            emitter=area(emitted),
        )
        for axis in range(3)
        for side in (-1, 1)
    }
    return {"type": "scene", **walls}


def closed_answer(reflectance: float, emitted: float, depth: int) -> float:
    """Radiance in a closed scene whose surfaces all emit and reflect alike, whatever its shape.

    Scattering event k brings emitted · reflectanceᵏ, and there are at most `depth` of them.
    """
    return float(emitted * np.sum(np.float64(reflectance) ** np.arange(depth + 1)))


def mesh(vertices: ArrayLike, faces: ArrayLike, **more: Any) -> Any:
    """A `mitsuba.Mesh` without normals of its own. vertices: (V, 3), metres. faces: (F, 3). more: bsdf, emitter."""
    import mitsuba as mi

    corners, triangles = np.asarray(vertices, dtype=np.float32), np.asarray(faces, dtype=np.uint32)
    properties = mi.Properties()
    for name, plugin in more.items():
        properties[name] = mi.load_dict(plugin)
    shape = mi.Mesh("mesh", len(corners), len(triangles), props=properties)
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = corners.ravel()
    parameters["faces"] = triangles.ravel()
    parameters.update()
    return shape


def small_room(*, glossy: bool = True) -> dict[str, Any]:
    """A room of 2 × 2 × 2 m, open to −y, with a lamp below its ceiling.

    glossy: with a coated floor, and balls that are coated, of metal and a mirror; otherwise all is matt.
    """
    wall = diffuse(0.7, 0.65, 0.6)
    room: dict[str, Any] = {
        "type": "scene",
        "floor": rectangle([0, 0, 0], [0, 0, 1], (1, 1), bsdf=diffuse(0.4, 0.3, 0.2)),
        "ceiling": rectangle([0, 0, 2], [0, 0, -1], (1, 1), bsdf=wall),
        "back": rectangle([0, 1, 1], [0, -1, 0], (1, 1), bsdf=wall),
        "left": rectangle([-1, 0, 1], [1, 0, 0], (1, 1), bsdf=diffuse(0.6, 0.2, 0.2)),
        "right": rectangle([1, 0, 1], [-1, 0, 0], (1, 1), bsdf=diffuse(0.2, 0.5, 0.2)),
        "lamp": rectangle([0, 0, 1.95], [0, 0, -1], (0.25, 0.25), bsdf=wall, emitter=area(8, 7, 6)),
    }
    if not glossy:
        return room
    copper = two_sided(type="roughconductor", material="Cu", alpha=0.2, distribution="ggx")
    balls = {
        "coated": ([-0.4, 0.2, 0.4], 0.35, coat(0.1, 0.5, 0.2, 0.1)),
        "metal": ([0.35, -0.1, 0.25], 0.25, copper),
        "mirror": ([0.55, 0.5, 0.7], 0.2, two_sided(type="conductor", material="Al")),
    }
    room["floor"]["bsdf"] = coat(0.05, 0.4, 0.3, 0.2)
    for name, (centre, radius, bsdf) in balls.items():
        room[name] = {"type": "sphere", "center": centre, "radius": radius, "bsdf": bsdf}
    return room
