"""Scenes of a run: rooms with frames that are held out, stills and sequences, each with its reference.

A reference is rendered twice with independent samples, and what is scored against is the mean of the two. Denoised
references of this many samples are several times closer to the truth than what the samples alone give, but nothing in
one image says how close: the two halves do, by how much they differ.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gibench import gate
from gibench.benchmarks.errors import ResultsError
from gibench.datasets.errors import DatasetError
from gibench.datasets.exr import decode
from gibench.datasets.loading import Frame, open_dataset
from gibench.datasets.manifest import recipe_of, room_record
from gibench.datasets.room_view import check_scene_file

if TYPE_CHECKING:
    from gibench.datasets.recipes import Recipe
    from gibench.rendering.lighting import Shot

STILLS = "stills"
"""Name of the frames that are in no sequence."""


@dataclass(frozen=True)
class Stretch:
    """Frames of a sequence. name: of the sequence. first: number of its first frame. count: how many it has."""

    name: str
    first: int
    count: int


@dataclass(frozen=True)
class SceneFiles:
    """A scene on disk.

    name: such as "room-000000". folder: with scene.xml and room.json. sha256: of all that decides what is seen.
    frames: those that are held out, stills first, then sequence by sequence. sequences: which of them follow each
    other. halves: their references, once and once more. max_depth: scattering events of their paths. nearness: "near",
    "far" or "" of each frame, as of `Recipe.nearness`; nothing where they are not told apart.
    """

    name: str
    room: int
    kind: str
    folder: Path
    sha256: str
    resolution: tuple[int, int]
    frames: tuple[Frame, ...]
    sequences: tuple[Stretch, ...]
    halves: tuple[tuple[Path, ...], tuple[Path, ...]]
    references_sha256: str
    max_depth: int
    nearness: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Number of frames that are held out."""
        return len(self.frames)

    @cached_property
    def shots(self) -> tuple[Shot, ...]:
        """Camera and lighting of each frame."""
        return tuple(shot_of(frame) for frame in self.frames)

    def before(self, frame: int) -> int | None:
        """Number of the frame before it in its sequence; None for stills and where a sequence begins."""
        stretch = self.stretch(frame)
        return None if stretch is None or frame == stretch.first else frame - 1

    def stretch(self, frame: int) -> Stretch | None:
        """The sequence that a frame lies in; None for a still."""
        for one in self.sequences:
            if one.first <= frame < one.first + one.count:
                return one
        return None

    def tags(self, frame: int) -> tuple[str, ...]:
        """What boards may be restricted to.

        The name of the sequence, or `STILLS` and how near they are to the views to train on; "indoor" or "outdoor".
        """
        stretch = self.stretch(frame)
        name = str(self.frames[frame].row.get("environment") or "")
        near = self.nearness[frame] if self.nearness else ""
        return (
            STILLS if stretch is None else stretch.name,
            *([near] if near else []),
            *indoor_or_outdoor(name),
        )

    def half(self, which: int, frame: int, *channels: str) -> dict[str, Any]:
        """Channels of one of the two renderings of a frame's reference, (H, W, C) by channel."""
        return decode(self.halves[which][frame], channels, widen=True)


def shot_of(frame: Frame) -> Shot:
    """Camera and lighting of a frame."""
    from gibench.rendering.lighting import Shot

    return getattr(frame, "shot", None) or Shot(frame.camera)


@cache
def indoor_or_outdoor(environment: str) -> tuple[str, ...]:
    """Of a map that ships, by its name; nothing for others."""
    from gibench.generators.environments.shipped import shipped_maps

    return tuple("indoor" if one.indoor else "outdoor" for one in shipped_maps() if one.name == environment)


def scene_name(room: int) -> str:
    """Name of a room in tables."""
    return f"room-{room:06d}"


def scenes_in(root: Path, again: Path) -> list[SceneFiles]:
    """Scenes of two datasets of the same frames. Raises ResultsError where there is none."""
    try:
        dataset, other = open_dataset(root), open_dataset(again)
    except DatasetError as problem:
        raise ResultsError(f"the scenes of this run cannot be read: {problem}") from None
    if missing := sorted(set(dataset.frames["file"]) - set(other.frames["file"])):
        raise ResultsError(f"{again} lacks {missing[0]}: run `{other.manifest['command']}` again")
    if not len(dataset):
        raise ResultsError(
            f"{root} has no frame: every room was rejected; choose another seed or other kinds"
        )
    recipe = recipe_of(dataset.manifest)
    of_the_other = dict(zip(other.frames["file"], other.frames["sha256"], strict=True))
    scenes = []
    for number, found in groupby(sorted(dataset, key=lambda f: (f.room, f.view)), key=lambda f: f.room):
        frames = tuple(found)
        row, content = frames[0].row, _content(root, number)
        hashes = [(frame.row["sha256"], of_the_other[frame.row["file"]]) for frame in frames]
        scenes.append(
            SceneFiles(
                name=scene_name(number),
                room=number,
                kind=str(row["kind"]),
                folder=dataset.room_folder(number),
                sha256=content,
                resolution=(int(row["width"]), int(row["height"])),
                frames=frames,
                sequences=_sequences(frames),
                halves=(
                    tuple(_inside(root, str(frame.row["file"])) for frame in frames),
                    tuple(_inside(again, str(frame.row["file"])) for frame in frames),
                ),
                references_sha256=_digest([content, hashes]),
                max_depth=recipe.max_depth,
                nearness=_nearness(recipe, frames, room_record(root, number).get("given_cameras", 0)),
            )
        )
    return scenes


def _nearness(recipe: Recipe, frames: Sequence[Frame], given: int) -> tuple[str, ...]:
    return tuple(recipe.nearness(frame.view, given) for frame in frames) if recipe.trajectories else ()


def refuse_files_outside(root: Path, scene: SceneFiles) -> None:
    """Check that a room's scene.xml names files of its own folder alone, before a renderer follows the names.

    root: of the dataset. Raises ResultsError.
    """
    try:
        check_scene_file(root, scene.folder)
    except gate.GateError as problem:
        raise ResultsError(f"{scene.folder / 'scene.xml'} is not read: {problem}") from None


def _inside(root: Path, file: str) -> Path:
    try:
        return gate.inside(root, file)
    except gate.GateError as problem:
        raise ResultsError(f"the scenes of this run cannot be read: {problem}") from None


def _sequences(frames: tuple[Frame, ...]) -> tuple[Stretch, ...]:
    """Stretches of frames that lie on one path, in the order of its steps."""
    found: list[Stretch] = []
    for name, members in groupby(enumerate(frames), key=lambda pair: str(pair[1].row["path"])):
        numbers = [number for number, _ in members]
        if name:
            found.append(Stretch(name, numbers[0], len(numbers)))
    return tuple(found)


def _content(root: Path, room: int) -> str:
    files = room_record(root, room)["files"]
    # The same geometry once more, for viewers.
    known = {name: file["sha256"] for name, file in files.items() if not name.endswith(".glb")}
    return _digest(known)


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def lay_out(scene: SceneFiles, folder: Path) -> Path:
    """A folder with the files of a scene but without its frames, which no method may see; gives that folder.

    Files are links to those of the scene where the file system has such, else copies. What is there stays.
    """
    root = scene.folder.parents[1]
    for name in room_record(root, scene.room)["files"]:
        place = folder / name
        if place.exists():
            continue
        place.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.link(scene.folder / name, place)
        except OSError:
            shutil.copyfile(scene.folder / name, place)
    return folder
