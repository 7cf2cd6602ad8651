"""A scene and a camera to look at, from a room of a dataset or a scene file."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from gibench import gate
from gibench.datasets.errors import DatasetError
from gibench.datasets.folder import MANIFEST, room_folder

if TYPE_CHECKING:
    from gibench.generators.imported.scene import ImportSettings
    from gibench.rendering.camera import PinholeCamera
    from gibench.rendering.scene import Scene

SCENE = "scene.xml"


@dataclass(frozen=True)
class RoomView:
    """A scene, lit as for the camera. name: for people. max_depth: scattering events of its dataset, or None."""

    scene: Scene
    camera: PinholeCamera
    name: str
    max_depth: int | None


def check_scene_file(root: Path, folder: Path) -> None:
    """Check that the scene.xml of a room names files of its own folder alone, before a renderer follows the names.

    root: of the dataset. Raises GateError.
    """
    try:
        content = gate.read_inside(root, folder.relative_to(root) / SCENE)
        for node in ElementTree.fromstring(content).iter():
            if node.tag in ("include", "path"):
                raise gate.GateError(f"it holds <{node.tag}>, which no room does")
            named = [node.get("filename")] + [node.get("value")] * (node.get("name") == "filename")
            for name in filter(None, named):
                gate.inside(folder, name)
    except ElementTree.ParseError as problem:
        raise gate.GateError(str(problem)) from None


def open_view(
    place: Path, view: int, sampling: str | None, settings: ImportSettings | None = None
) -> RoomView:
    """One view of a scene file, of a folder with one, or of a room folder of a dataset.

    view: number of the frame of the room, or of the camera of the file. sampling: one of `scene.SAMPLINGS`; None for
    that of the dataset, or plain. settings: how a scene file is read. Raises DatasetError, SceneFileError or
    SceneError.
    """
    if not place.exists():
        raise DatasetError(f"there is no {place}: name a scene file, or a room such as DIR/rooms/000000")
    if place.is_dir() and (place / MANIFEST).is_file():
        raise DatasetError(
            f"{place} is a whole dataset: name one of its rooms, such as {room_folder(place, 0)}"
        )
    if place.is_dir() and not (place / SCENE).is_file():
        raise DatasetError(f"{place} holds no {SCENE}: name a scene file, or a room such as DIR/rooms/000000")
    if place.is_dir() and (place.resolve().parents[1] / MANIFEST).is_file():
        return _view_of_room(place.resolve(), view, sampling)
    return _view_of_file(place / SCENE if place.is_dir() else place, view, sampling or "plain", settings)


def _view_of_room(folder: Path, view: int, sampling: str | None) -> RoomView:
    from gibench.datasets.loading import open_dataset
    from gibench.datasets.manifest import recipe_of
    from gibench.rendering.light_rig import LightRig
    from gibench.rendering.scene import load_scene

    root = folder.parents[1]
    dataset = open_dataset(root)
    frames = [frame for frame in dataset if room_folder(root, frame.room) == folder]
    if not frames:
        raise DatasetError(f"{folder} is no whole room of {root}")
    found = next((frame for frame in frames if frame.view == view), None)
    if found is None:
        raise DatasetError(f"--view: there is no view {view}; the room has views 0 to {len(frames) - 1}")
    recipe, shot = recipe_of(dataset.manifest), found.shot
    try:
        check_scene_file(root, folder)
    except gate.GateError as problem:
        raise DatasetError(f"{folder / SCENE} is not read: {problem}") from None
    scene = load_scene(folder / SCENE, sampling=sampling or recipe.room_sampling)
    if shot.lighting.kind != "own":
        rig = LightRig(scene, panoramas=shot.lighting.kind == "environment")
        rig.set(shot.lighting)
        scene = rig.scene
    return RoomView(scene, shot.camera, f"room {found.room} of {root.name}, view {view}", recipe.max_depth)


def _view_of_file(file: Path, view: int, sampling: str, settings: ImportSettings | None) -> RoomView:
    from gibench.generators.imported.room import import_room, write_imported_room
    from gibench.generators.imported.scene import import_scene
    from gibench.rendering.scene import load_scene

    read = import_scene(file, settings)
    room = import_room(read, resolution=read.resolution, views=0 if read.cameras else 1)
    if not 0 <= view < len(room.cameras):
        last = len(room.cameras) - 1
        raise DatasetError(f"--view: there is no camera {view}; {file} has cameras 0 to {last}")
    with tempfile.TemporaryDirectory(prefix="gibench-noise-") as folder:
        write_imported_room(room, folder, max_depth=read.max_depth, resolution=read.resolution, spp=1)
        scene = load_scene(Path(folder) / SCENE, sampling=sampling)
    return RoomView(scene, room.cameras[view].pinhole, f"{read.name}, camera {view}", None)
