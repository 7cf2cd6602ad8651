"""Methods of the benchmark on hard scenes whose light is known, from their preparation to a frame."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from gibench.baselines import (
    image_space_gathering,
    lightmap,
    nearest_probe,
    path_traced,
    rtrt,
    unstructured_lumigraph,
)
from gibench.baselines.bakes import BakeCache
from gibench.baselines.method import Method, Prediction, Site, View
from gibench.baselines.stages import Stages
from gibench.datasets.exr import HALF_TOLERANCE
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import Shot
from gibench.rendering.render import MAX_DEPTH
from gibench.rendering.scene import Scene, load_dict
from gibench.stress import meshes
from gibench.stress.answers import largest_z
from gibench.stress.registry import Check, Found, case
from gibench.stress.scenes import area, closed_answer, mesh, metal, rgb
from gibench.stress.views import INSIDE, seen

METHODS: tuple[Method, ...] = tuple(
    module.METHOD
    for module in (lightmap, path_traced, rtrt, image_space_gathering, unstructured_lumigraph, nearest_probe)
)

SETTINGS: dict[str, Any] = {
    "texels": 8,
    "lightmap_spp": 1024,
    "lightmap_denoise": False,
    "probes": 8,
    "probe_width": 64,
    "probe_spp": 64,
    "samples": 16,
    "spp": 32,
    "denoise": False,
    "rays": 4,
}
"""Small and without denoisers, so that what is left is noise whose size is known."""

RESOLUTION = (32, 24)

REFLECTANCE = 0.5


def cube(emitted: float, floor: dict[str, Any] | None = None) -> Scene:
    """A closed cube that emits and reflects half; floor: a material in place of the side at z = −1, which is dark."""
    vertices, faces = meshes.cube(np.linspace(-1, 1, 5))
    sides = faces.reshape(6, -1, 3)
    matt = {"type": "diffuse", "reflectance": rgb(REFLECTANCE)}
    if floor is None:
        return load_dict({"type": "scene", "cube": mesh(vertices, faces, bsdf=matt, emitter=area(emitted))})
    # The axes come in order, each with its lower side first.
    rest = np.concatenate([*sides[:4], sides[5]])
    walls = mesh(vertices, rest, bsdf=matt, emitter=area(emitted))
    return load_dict({"type": "scene", "walls": walls, "floor": mesh(vertices, sides[4], bsdf=floor)})


@contextmanager
def prepared(scene: Scene, files: Path | None = None) -> Iterator[Site]:
    """A place to bake in, which is gone afterwards. files: the folder of its scene.xml, where it has one."""
    with TemporaryDirectory() as folder:
        cache = BakeCache(Path(folder) / "bakes", "scene", {})
        yield Site(scene, files or Path(folder), RESOLUTION, (), 0, cache, Stages())


def frames(
    site: Site, camera: PinholeCamera, methods: tuple[Method, ...] = METHODS, seeds: int = 1
) -> dict[str, Prediction]:
    """One frame of every method, the mean over so many seeds."""
    found = {}
    for method in methods:
        names = {knob.name for knob in method.knobs}
        running = method.load()(
            method.settings({key: value for key, value in SETTINGS.items() if key in names})
        )
        running.prepare(site)
        drawn = [running.render(View(Shot(camera), None, RESOLUTION, 0, s), Stages()) for s in range(seeds)]
        found[method.id] = _mean(drawn)
    return found


def _mean(frames: list[Prediction]) -> Prediction:
    color = np.mean([frame.color for frame in frames], axis=0)
    specular = [frame.specular for frame in frames if frame.specular is not None]
    return Prediction(color=color, specular=np.mean(specular, axis=0) if specular else None)


def wrong_values(frame: Prediction) -> float:
    """Number of values of a frame that no method may give: negative, infinite or NaN."""
    images = [frame.color] if frame.specular is None else [frame.color, frame.specular]
    return float(sum((~(np.isfinite(image) & (image >= 0))).sum() for image in images))


@case("methods in a furnace", quick=True)
def furnace() -> Found:
    """Every pixel of every method has the same answer; what it may be off is the noise of as many paths."""
    scene = cube(1.0)
    answer = closed_answer(REFLECTANCE, 1.0, MAX_DEPTH)
    with prepared(scene) as site:
        found = frames(site, INSIDE)
    for name, frame in found.items():
        paths = SETTINGS["spp"] if name == "path-traced" else SETTINGS["lightmap_spp"]
        noise = float(seen(scene, INSIDE, spp=paths).arrays["color_se"].mean())
        bound = largest_z(RESOLUTION[0] * RESOLUTION[1]) * 1.2 * noise / answer
        error = float(np.abs(frame.color.astype(np.float64) / answer - 1).max())
        yield Check(
            "methods", f"{name}: radiance, worst pixel", error, bound, "sum of the series; noise of its paths"
        )
    for name, frame in found.items():
        matt = 0.0 if frame.specular is None else float(frame.specular.max())
        yield Check("methods", f"{name}: specular light of a matt cube", matt, 0, "a lobe that is not there")


@case("methods in a furnace of {emitted:g}", emitted=(1e6, 1e-6))
def scaled_furnace(emitted: float) -> Found:
    """Light is linear: the same frame, times as much, from preparations that are stored in half floats."""
    found = []
    for level in (1.0, emitted):
        with prepared(cube(level)) as site:
            found.append(frames(site, INSIDE))
    for name, usual in found[0].items():
        scaled = found[1][name].color.astype(np.float64) / emitted
        error = float(np.abs(scaled / usual.color - 1).max())
        yield Check(
            "methods", f"{name}: against 1, worst pixel", error, 2 * HALF_TOLERANCE, "both files' promise"
        )


@case("methods over a black floor", quick=True)
def black_floor() -> Found:
    """Nothing may be divided by an albedo of 0, and nothing comes from there."""
    with prepared(cube(1.0, {"type": "diffuse", "reflectance": rgb(0.0)})) as site:
        found = frames(site, PinholeCamera((0.0, 0.0, 0.5), (0.02, 0.0, -1.0), 0.8))
    for name, frame in found.items():
        yield Check(
            "methods", f"{name}: values it may not give", wrong_values(frame), 0, "finite and not negative"
        )
        yield Check("methods", f"{name}: light of the floor", float(frame.color.max()), 0, "exactly 0")


NEAR_MIRROR = 1e-3


@case("methods over a near-mirror, the camera on a probe", quick=True)
def near_mirror_from_a_probe() -> Found:
    """A floor that absorbs nothing, in a furnace: it shows what the walls show, from wherever it is seen.

    The camera stands exactly where a probe stands, and another at the floor below it, so that distances are 0.
    """
    from gibench.baselines.probes.baking import POSITIONS, ProbeSettings, baked_files

    scene = cube(1.0, metal(NEAR_MIRROR))
    with prepared(scene) as site:
        positions = np.load(baked_files(site, ProbeSettings(8, 64, 32, 64), ("radiance",))[POSITIONS])
        lowest = positions[np.argmin(positions[:, 2])].astype(float)
        camera = PinholeCamera(
            (lowest[0], lowest[1], lowest[2]), (lowest[0] + 0.1, lowest[1] + 0.1, -1.0), np.radians(100)
        )
        found = frames(site, camera)
        at_point = looked_up(site, positions)
    # Radiance in balance is 2; what is cut after MAX_DEPTH scatterings is below this share, twice where probes and
    # lightmap are cut one after the other.
    cut = REFLECTANCE ** (MAX_DEPTH - 1)
    for name, frame in found.items():
        yield Check(
            "methods", f"{name}: values it may not give", wrong_values(frame), 0, "finite and not negative"
        )
        if name == lightmap.METHOD.id:  # which has no glossy light
            continue
        mean = float(frame.color.astype(np.float64).mean())
        noise = float(seen(scene, camera, spp=32, resolution=RESOLUTION).arrays["color_se"].mean())
        bound = 2 * cut + 4.5 * noise / np.sqrt(RESOLUTION[0] * RESOLUTION[1])
        yield Check(
            "methods",
            f"{name}: mean radiance",
            abs(mean / 2 - 1),
            bound,
            "balance; bounces that are cut; noise",
        )
    lost = float((~(np.isfinite(at_point) & (at_point >= 0))).sum())
    yield Check("probes", "lookups at the probe itself that are lost", lost, 0, "finite and not negative")


def looked_up(site: Site, positions: Any) -> Any:
    """Results of both probe methods for points that lie on the probes, seen from the probes."""
    import mitsuba as mi

    from gibench.baselines.nearest_probe.lookup import NearestProbe
    from gibench.baselines.probes.baking import ProbeSettings
    from gibench.baselines.probes.maps import load_probes
    from gibench.baselines.unstructured_lumigraph.blending import UnstructuredLumigraph

    probes = load_probes(site, ProbeSettings(8, 64, 32, 64), UnstructuredLumigraph.maps)
    points = mi.Point3f(np.ascontiguousarray(positions.T, dtype=np.float32))
    camera = mi.Point3f([float(c) for c in positions[0]])
    settings = {"candidates": 8}
    return np.concatenate(
        [
            np.array(method.glossy(probes, points, camera, mi.Bool(True), settings))
            for method in (NearestProbe, UnstructuredLumigraph)
        ]
    )
