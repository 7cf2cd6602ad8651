"""Every method on every kind of material: a floor in uniform light, whose lobes the path tracer tells apart."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from gibench.baselines import (
    efficient_light_probes,
    glossy_probe_reprojection,
    image_space_gathering,
    light_field_probes,
    lightmap,
    nearest_probe,
    path_traced,
    rtrt,
    unstructured_lumigraph,
)
from gibench.rendering.backend import threads_to_load
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.scene import Scene, load_scene
from gibench.stress import meshes
from gibench.stress.methods import RESOLUTION, frames, prepared
from gibench.stress.registry import Check, Found, case
from gibench.stress.scenes import area, coat, mesh, metal, rgb
from gibench.stress.views import seen

CAMERA = PinholeCamera((0.0, 0.0, 0.5), (0.02, 0.0, -1.0), 0.8)
"""Sees nothing but the floor, at 0 to 28°."""

PATHS = 1024
"""A pixel, of the answer."""

SEEDS = 8
"""Frames of each method: with one of 32 paths a pixel, which paths go through holes is a noise of .5 % of the mean."""


def _principled(**parameters: Any) -> dict[str, Any]:
    return {"type": "principled", "base_color": rgb(0.6, 0.4, 0.2), **parameters}


MATT = {"type": "diffuse", "reflectance": rgb(0.6, 0.4, 0.2)}
PLASTIC = coat(0.2, 0.5)
PRINCIPLED = _principled(roughness=0.55, specular=0.5)

BUMPS: dict[str, Any] = {"type": "bitmap", "filename": "bumps.exr", "raw": True}
"""A slope of 1 in 50 over each triangle, as a displacement; `room` writes the picture."""

MATERIALS: dict[str, dict[str, Any]] = {
    "diffuse": MATT,
    "roughplastic": PLASTIC,
    "pplastic": {"type": "pplastic", "diffuse_reflectance": rgb(0.6, 0.4, 0.2), "alpha": 0.2},
    "plastic": {"type": "plastic", "diffuse_reflectance": rgb(0.6, 0.4, 0.2)},
    "roughconductor": metal(0.2),
    "brushed roughconductor": {"type": "roughconductor", "material": "Cu", "alpha_u": 0.3, "alpha_v": 0.1},
    "conductor": {"type": "conductor", "material": "Cu"},
    "dielectric": {"type": "dielectric"},
    "thindielectric": {"type": "thindielectric"},
    "roughdielectric": {"type": "roughdielectric", "alpha": 0.2},
    "principled": PRINCIPLED,
    "principledthin": {
        "type": "principledthin",
        "base_color": rgb(0.6, 0.4, 0.2),
        "roughness": 0.5,
        "diff_trans": 0.6,
    },
    "principled metal": _principled(metallic=0.7, roughness=0.5),
    "principled coat": _principled(roughness=0.6, clearcoat=1.0, clearcoat_gloss=0.7, sheen=0.3),
    "two-sided principled": {"type": "twosided", "inside": PRINCIPLED},
    "two sides": {"type": "twosided", "above": PRINCIPLED, "below": MATT},
    "blend": {"type": "blendbsdf", "weight": 0.4, "one": MATT, "other": metal(0.2)},
    "principled blend": {"type": "blendbsdf", "weight": 0.4, "one": PRINCIPLED, "other": PLASTIC},
    "mask": {"type": "mask", "opacity": 0.7, "inside": PLASTIC},
    "principled mask": {"type": "mask", "opacity": 0.7, "inside": PRINCIPLED},
    "bump": {"type": "bumpmap", "texture": BUMPS, "inside": PLASTIC},
    "principled bump": {"type": "bumpmap", "texture": BUMPS, "inside": PRINCIPLED},
    "normal map": {
        "type": "normalmap",
        "normalmap": {"type": "rgb", "value": [0.55, 0.5, 0.98]},
        "in": PLASTIC,
    },
    "principled normal map": {
        "type": "normalmap",
        "normalmap": {"type": "rgb", "value": [0.55, 0.5, 0.98]},
        "in": PRINCIPLED,
    },
}
"""Stock materials of Mitsuba, and what may lie over them."""

SHEER = ("dielectric", "thindielectric", "roughdielectric", "principledthin", "mask")
"""Plugins that let light through."""


def room(floor: dict[str, Any], folder: Path) -> Scene:
    """A closed cube of black sides that emit 1, but for the floor: whatever it reflects, it reflects uniform light.

    Below a floor that lets light through is another such cube, without a ceiling.

    folder: where its scene.xml is written, since some methods read materials from there.
    """
    import mitsuba as mi

    slope = np.linspace(0, 0.02, 4, dtype=np.float32)[:, None, None] * np.ones((1, 4, 1), dtype=np.float32)
    with threads_to_load():
        mi.Bitmap(slope).write(str(folder / BUMPS["filename"]))
    vertices, faces = meshes.cube(np.linspace(-1, 1, 5))
    sides = faces.reshape(6, -1, 3)
    walls = {"bsdf": {"type": "diffuse", "reflectance": rgb(0.0)}, "emitter": area(1.0)}
    shapes = []
    closed = np.concatenate([*sides[:4], sides[5]])
    if floor["type"] in SHEER:
        lower = np.concatenate(sides[:5]) + len(vertices)
        vertices, closed = np.concatenate([vertices, vertices - [0, 0, 2]]), np.concatenate([closed, lower])
    for name, own, plugins in (
        ("walls", closed, walls),
        ("floor", sides[4], {"bsdf": floor}),
    ):
        mesh(vertices, own).write_ply(str(folder / f"{name}.ply"))
        inside = "".join(_xml(tag, plugin) for tag, plugin in plugins.items())
        file = f'<string name="filename" value="{name}.ply"/><boolean name="face_normals" value="true"/>'
        shapes.append(f'<shape type="ply" id="{name}">{file}{inside}</shape>')
    path = folder / "scene.xml"
    path.write_text(f'<scene version="3.0.0">{"".join(shapes)}</scene>')
    return load_scene(path)


def _xml(tag: str, plugin: dict[str, Any], name: str = "") -> str:
    """A plugin in Mitsuba's XML. tag: of it, and of the plugins in it that are neither colours nor pictures."""
    inside = []
    for key, value in plugin.items():
        if isinstance(value, dict) and value["type"] == "rgb":
            inside.append(f'<rgb name="{key}" value="{", ".join(map(str, value["value"]))}"/>')
        elif isinstance(value, dict):
            inside.append(_xml("texture" if value["type"] == "bitmap" else tag, value, key))
        elif key != "type":
            kind = next(name for type, name in VALUES.items() if isinstance(value, type))
            inside.append(
                f'<{kind} name="{key}" value="{str(value).lower() if kind == "boolean" else value}"/>'
            )
    named = f' name="{name}"' if name else ""
    return f'<{tag} type="{plugin["type"]}"{named}>{"".join(inside)}</{tag}>'


VALUES = {bool: "boolean", int: "integer", float: "float", str: "string"}
"""Tag of a value in Mitsuba's XML; a truth value is a number too, so that it comes first."""


EXACT, SPLIT_SUM, FROM_PROBES = 0.01, 0.03, 0.03
"""Bounds on the mean, of all that the floor reflects: of methods that follow the very lobes; of one that multiplies a
mirror image with what 64 samples of the lobe weigh; and of those that see the lobe from where their probes stand, or
by 16 rays."""

METHODS = (
    (path_traced.METHOD, EXACT),
    (lightmap.METHOD, EXACT),
    (rtrt.METHOD, EXACT),
    (image_space_gathering.METHOD, SPLIT_SUM),
    (light_field_probes.METHOD, FROM_PROBES),
    (unstructured_lumigraph.METHOD, FROM_PROBES),
    (nearest_probe.METHOD, FROM_PROBES),
    (glossy_probe_reprojection.METHOD, FROM_PROBES),
    (efficient_light_probes.SEARCH, FROM_PROBES),
)

THROUGH = "light that a sheet scatters through it is asked of probes in front of it, and no mirror image"

HALVED = "probes of half the roughness lose less light below the horizon of a metal, and the filter gives none back"

LEANING = "principled is taken apart at the normal below the map, as Mitsuba tells nobody the other"


KNOWN_CASES = (
    (("principledthin",), ("light-field-probes", "isg"), "specular", THROUGH),
    (("roughconductor", "principled metal"), ("gpr",), "specular", HALVED),
    (
        ("principled normal map", "principled bump"),
        tuple(method.id for method, _ in METHODS if method is not path_traced.METHOD),
        "diffuse",
        LEANING,
    ),
)
"""Coverings, methods and lobe of which a deviation is known, and why."""


def _known(covering: str, method: str, lobe: str) -> str:
    reasons = (why for over, by, of, why in KNOWN_CASES if covering in over and method in by and lobe == of)
    return next(reasons, "")


@case("methods over {covering}", covering=tuple(MATERIALS), quick=("principled", "mask"))
def floor_of(covering: str) -> Found:
    """Diffuse and specular light of the floor, each against the path tracer's, by every method."""
    with TemporaryDirectory() as folder:
        yield from _compared(covering, room(MATERIALS[covering], Path(folder)), Path(folder))


def _compared(covering: str, scene: Scene, folder: Path) -> Found:
    truth = seen(scene, CAMERA, spp=PATHS, resolution=RESOLUTION).arrays
    answer = {
        lobe: float(np.mean(truth[f"direct_{lobe}"] + truth[f"indirect_{lobe}"], dtype=np.float64))
        for lobe in ("diffuse", "specular")
    }
    total = sum(answer.values())
    with prepared(scene, folder) as site:
        found = frames(site, CAMERA, tuple(method for method, _ in METHODS), SEEDS)
    for method, bound in METHODS:
        frame = found[method.id]
        specular = 0.0 if frame.specular is None else float(np.mean(frame.specular, dtype=np.float64))
        means = {"diffuse": float(np.mean(frame.color, dtype=np.float64)) - specular, "specular": specular}
        # A lightmap has no glossy light, and says so.
        for lobe in ("diffuse",) if method is lightmap.METHOD else ("diffuse", "specular"):
            known = _known(covering, method.id, lobe)
            yield Check(
                "methods",
                f"{method.id}: {lobe} light, of all of it",
                abs(means[lobe] - answer[lobe]) / total,
                EXACT if lobe == "diffuse" else bound,  # which all of them have from the lightmap
                "path tracing with 1024 paths",
                known,
            )
