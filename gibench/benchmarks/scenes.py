"""Scenes of a run: rooms with training views, and with the frames on a path that are held out.

A reference is rendered twice with independent samples, and what is scored against is the mean of the two. Denoised
references of this many samples are several times closer to the truth than what the samples alone give, but nothing in
one image says how close: the two halves do, by how much they differ.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gibench.benchmarks.errors import ResultsError
from gibench.datasets.errors import DatasetError
from gibench.datasets.exr import decode
from gibench.datasets.loading import Frame, open_dataset
from gibench.datasets.manifest import room_record

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class SceneFiles:
    """A scene on disk.

    name: such as "room-000000". folder: with scene.xml and room.json. sha256: of all that decides what is seen.
    cameras: (position, target, horizontal field of view in radians) of the frames on the path, in order. halves: their
    references, once and once more.
    """

    name: str
    room: int
    kind: str
    folder: Path
    sha256: str
    resolution: tuple[int, int]
    cameras: tuple[tuple[Vector, Vector, float], ...]
    halves: tuple[tuple[Path, ...], tuple[Path, ...]]

    def half(self, which: int, frame: int, *channels: str) -> dict[str, Any]:
        """Channels of one of the two renderings of a frame's reference, (H, W, C) by channel."""
        return decode(self.halves[which][frame], channels, widen=True)


def scene_name(room: int) -> str:
    """What tables call a room."""
    return f"room-{room:06d}"


def scenes_in(root: Path, again: Path) -> list[SceneFiles]:
    """Scenes of two datasets of the same frames on paths. Raises ResultsError where there is none."""
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
    scenes = []
    for room, frames in dataset.frames.sort_values(["room", "step"]).groupby("room"):
        number = int(str(room))
        row = frames.iloc[0]
        scenes.append(
            SceneFiles(
                name=scene_name(number),
                room=number,
                kind=str(row["kind"]),
                folder=dataset.room_folder(number),
                sha256=_content(root, number),
                resolution=(int(row["width"]), int(row["height"])),
                cameras=tuple(
                    (
                        (float(f["camera_x"]), float(f["camera_y"]), float(f["camera_z"])),
                        (float(f["target_x"]), float(f["target_y"]), float(f["target_z"])),
                        float(f["fov"]),
                    )
                    for _, f in frames.iterrows()
                ),
                halves=(
                    tuple(root / str(file) for file in frames["file"]),
                    tuple(again / str(file) for file in frames["file"]),
                ),
            )
        )
    return scenes


def _content(root: Path, room: int) -> str:
    files = room_record(root, room)["files"]
    # The same geometry once more, for viewers.
    known = {name: file["sha256"] for name, file in files.items() if not name.endswith(".glb")}
    return hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()


class TrainingView(Frame):
    """A frame that remembers that it was looked at, since whoever reads it pays for its rendering."""

    was_read = False

    def read(self, *channels: str) -> dict[str, Any]:
        """As `Frame.read`."""
        self.was_read = True
        return super().read(*channels)


def training_views(root: Path | None, room: int) -> list[TrainingView]:
    """Training views of a room; none where the run made none."""
    if root is None:
        return []
    return [TrainingView(frame.path, frame.row) for frame in open_dataset(root) if frame.room == room]
