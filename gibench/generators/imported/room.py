"""An imported scene as a room: with its cameras, and on disk like one that was generated."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ElementTree, SubElement, indent

import numpy as np

from gibench import gate
from gibench.generators.cameras import (
    NoView,
    PathPlan,
    sample_path,
    sample_planned,
    sample_spread,
    sample_stills,
)
from gibench.generators.imported.changes import Change
from gibench.generators.imported.errors import NoPlaceForCamera, SceneFileError
from gibench.generators.imported.glb import write_scene_glb
from gibench.generators.imported.opened import opened_scene
from gibench.generators.imported.openings import find_openings
from gibench.generators.imported.orientation import oriented
from gibench.generators.imported.placing import placed_matrix
from gibench.generators.imported.scene import ImportedScene
from gibench.generators.imported.survey import hits, survey
from gibench.generators.imported.tree import Node
from gibench.generators.imported.turning import without_flips
from gibench.generators.parts import Camera, FloatArray
from gibench.generators.scene_files import camera_records, lighting_records, sensor_element
from gibench.generators.trajectories import Spread
from gibench.rendering.backend import is_scalar, select_variant
from gibench.rendering.free_space import NoFreeSpace
from gibench.rendering.lighting import Lighting
from gibench.rendering.scene import OPENINGS

STILLS, PATH = 3000, 3001
"""Lanes of the random numbers, far from those of generated rooms."""


@dataclass(frozen=True, eq=False)
class ImportedRoom:
    """A scene with its cameras: its own first, then stills, then those on a path.

    index: number in its dataset. openings: (N, 3, 3) rectangles that daylight enters by, as far as they were found.
    rejections: reason → count, of views. free: (N, 3) points all over its free space, m, as far as it was found.
    lightings: one a camera, or none where all frames have the scene's own light.
    """

    seed: int
    index: int
    scene: ImportedScene
    cameras: tuple[Camera, ...]
    openings: FloatArray = field(default_factory=lambda: np.zeros((0, 3, 3)))
    rejections: Mapping[str, int] = field(default_factory=dict)
    free: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    lightings: tuple[Lighting, ...] = ()

    @property
    def kind(self) -> str:
        """Name of the scene."""
        return self.scene.name

    @property
    def given_cameras(self) -> int:
        """How many of the cameras are the scene's own."""
        return len(self.scene.cameras)


def import_room(
    scene: ImportedScene,
    *,
    resolution: tuple[int, int],
    seed: int = 0,
    index: int = 0,
    views: int = 4,
    path: str | None = None,
    path_views: int = 0,
    sequences: Sequence[PathPlan] = (),
    spread: Spread | None = None,
) -> ImportedRoom:
    """Choose the cameras of a scene: its own, `views` stills, and a path of `path_views`, or several `sequences`.

    With a path and no path_views the `views` lie on the path, as in `rooms.sample_room`; spread: as there.
    The cameras that are drawn depend on the seed and the scene alone.

    Raises SceneFileError where no view passes the checks, or where there is none at all.
    """
    select_variant()  # before anything loads Mitsuba, so that it finds the right LLVM

    found, why_none = np.zeros((0, 3)), "the variant scalar_rgb is too slow to look for one"
    if not is_scalar():
        try:
            scene, found = oriented(scene)
        except NoFreeSpace as problem:
            why_none = str(problem)
    scene = without_flips(scene)
    scene = _near_planes_told(scene, resolution)
    openings = find_openings(scene.loaded, found) if len(found) else np.zeros((0, 3, 3))
    cameras = [camera.at(resolution) for camera in scene.cameras]
    rejections: Counter[str] = Counter()
    if path is not None and path_views:
        sequences, path = (PathPlan(path, path, path_views),), None
    if views or sequences:
        if not len(found):
            raise NoPlaceForCamera(
                f"{scene.tree.file}: no place for a camera: {why_none}; give cameras with --cameras"
            )
        try:
            stage = survey(scene.loaded, found)
        except NoPlaceForCamera as problem:
            raise NoPlaceForCamera(f"{scene.tree.file}: {problem}") from None
        try:
            draws = []
            if spread is not None:
                draws.append(sample_spread(_rng(seed, STILLS), stage, views, spread, cameras))
            elif views and path is None:
                draws.append(sample_stills(_rng(seed, STILLS), stage, views))
            elif views and path is not None:
                draws.append(sample_path(_rng(seed, PATH), stage, path, views))
            for number, sequence in enumerate(sequences):
                lane = (PATH, number) if number else (PATH,)
                draws.append(sample_planned(_rng(seed, *lane), stage, sequence))
            for drawn, refused in draws:
                cameras += drawn
                rejections.update({f"view: {reason}": count for reason, count in refused.items()})
        except NoView as refusal:
            worst = ", ".join(f"{reason} {count}" for reason, count in refusal.reasons.most_common(3))
            raise NoPlaceForCamera(
                f"{scene.tree.file}: no {refusal.what} passed the view checks ({worst}); is --scale right? Or give "
                "cameras with --cameras"
            ) from None
    if not cameras:
        raise SceneFileError(
            f"{scene.tree.file}: the scene has no camera of its own: ask for some with --views"
        )
    return ImportedRoom(seed, index, scene, tuple(cameras), openings, dict(rejections), found)


def opened_import(room: ImportedRoom, opened: str) -> ImportedRoom:
    """The room without its ceiling, or also without a wall; see `opened.opened_scene`.

    Raises SceneFileError where no free space was found, or none of it is open to the sky afterwards.
    """
    if not len(room.free):
        raise SceneFileError(
            f"{room.scene.tree.file}: opened is '{opened}', but nothing in the scene is enclosed: leave it out"
        )
    # Where most of the sky is seen, portals cost more noise than they save.
    return replace(room, scene=opened_scene(room.scene, opened, room.free), openings=np.zeros((0, 3, 3)))


def _near_planes_told(scene: ImportedScene, resolution: tuple[int, int]) -> ImportedScene:
    """The scene with a warning for each camera whose near plane cuts away something that is seen here."""
    changes = []
    for given in scene.cameras:
        if given.near <= 0 or is_scalar():
            continue
        camera = given.at(resolution)
        right, down, forward = camera.pinhole.frame
        (x, y), focal = camera.pinhole.centre(resolution), camera.pinhole.focal_length(resolution[0])
        across, along = np.meshgrid(
            (np.linspace(0, resolution[0], 48) - x) / focal, (np.linspace(0, resolution[1], 36) - y) / focal
        )
        rays = forward + across.ravel()[:, None] * right + along.ravel()[:, None] * down
        length = np.linalg.norm(rays, axis=1, keepdims=True)
        distance = hits(scene.loaded, np.tile(camera.position, (len(rays), 1)), rays / length)[0]
        if (distance < given.near * length[:, 0]).any():
            what = f"a near_clip of {given.near:g} m is left out: what it cuts away is seen"
            changes.append(Change("cameras", what, given.where, loss=True))
    return replace(scene, changes=(*scene.changes, *changes)) if changes else scene


def _rng(seed: int, *lane: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=lane))


def write_imported_room(
    room: ImportedRoom, folder: str | Path, *, max_depth: int, resolution: tuple[int, int], spp: int
) -> None:
    """Write scene.xml, meshes/, textures/, openings.json, room.glb and room.json, as `scene_files.write_room` does."""
    folder = Path(folder)
    for name in ("meshes", "textures"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    if any(name.startswith("spectra/") for name in room.scene.files.values()):
        (folder / "spectra").mkdir(exist_ok=True)
    for source, name in room.scene.files.items():
        if isinstance(source, str):
            (folder / name).write_bytes(room.scene.tree.made[source])
            continue
        try:
            shutil.copyfile(source, folder / name)
        except FileNotFoundError:
            raise SceneFileError(f"{source} was there when the scene was read, and is gone") from None
    for name, content in _terms(room.scene).items():
        if content is not None:
            (folder / name).write_bytes(content)
    element = scene_element(room, max_depth=max_depth, resolution=resolution, spp=spp)
    indent(element, "  ")
    ElementTree(element).write(folder / "scene.xml", encoding="utf-8", xml_declaration=True)
    write_scene_glb(room.scene, folder / "room.glb")
    if len(room.openings):
        (folder / OPENINGS).write_text(json.dumps(room.openings.tolist()) + "\n", encoding="utf-8")
    text = json.dumps(describe(room), indent=1, allow_nan=False, ensure_ascii=False)
    (folder / "room.json").write_text(text + "\n", encoding="utf-8")


def _terms(scene: ImportedScene) -> dict[str, bytes | None]:
    """Licences that lie beside a scene, by name; None for one that is a link to a file elsewhere, or no file."""
    found: dict[str, bytes | None] = {}
    for path in sorted(scene.tree.folder.glob("LICEN[CS]E*")):
        try:
            found[path.name] = None if path.is_dir() else gate.read_inside(path.parent, path.name)
        except gate.GateError:
            found[path.name] = None
    return found


def _terms_left_out(scene: ImportedScene) -> list[str]:
    return [
        f"{name} beside the scene is no file of its folder, and was not copied: add the licence by hand"
        for name, content in _terms(scene).items()
        if content is None and not (scene.tree.folder / name).is_dir()
    ]


def scene_element(room: ImportedRoom, *, max_depth: int, resolution: tuple[int, int], spp: int) -> Node:
    """The `<scene>` of a room, with file names relative to its folder."""
    source = room.scene.with_files()
    element = Node("scene", {"version": "3.0.0"})
    integrator = SubElement(element, "integrator", type="path")
    SubElement(integrator, "integer", name="max_depth", value=str(max_depth))
    for number, camera in enumerate(room.cameras):
        element.append(sensor_element(camera, f"camera.{number}", resolution, spp))
    element.extend(source.nodes())
    return element


def describe(room: ImportedRoom) -> dict[str, Any]:
    """Content of room.json, JSON-able: where the scene came from and everything that was done to it."""
    scene = room.scene
    groups: dict[tuple[str, str, bool], list[str]] = {}
    for change in scene.changes:
        groups.setdefault((change.rule, change.what, change.loss), []).append(change.where)
    emitters = [node for node in scene.tree.root.everything() if node.tag == "emitter"]
    return {
        "seed": room.seed,
        "index": room.index,
        "kind": room.kind,
        "source": {
            "file": scene.tree.file.name,
            "up": scene.up,
            "scale": scene.scale,
            "to_metres_z_up": placed_matrix(scene.up, scene.scale).tolist(),
            "missing": list(scene.missing),
            "warnings": [*scene.warnings, *_terms_left_out(scene)],
            "changes": [
                {"rule": rule, "what": what, "loss": loss, "count": len(places), "first": places[0]}
                for (rule, what, loss), places in groups.items()
            ],
        },
        "lights": [{"type": node.type, "where": node.where} for node in emitters],
        "cameras": camera_records(room.cameras),
        **lighting_records(room.lightings),
        "rejections": dict(sorted(room.rejections.items())),
    }
