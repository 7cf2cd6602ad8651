"""Scenes of a run: rooms with training views, and with the frames on a path that are held out.

A reference is rendered twice with independent samples, and what is scored against is the mean of the two. Denoised
references of this many samples are several times closer to the truth than what the samples alone give, but nothing in
one image says how close: the two halves do, by how much they differ.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from gibench import gate
from gibench.baselines.booking import Booking
from gibench.benchmarks.errors import ResultsError
from gibench.datasets.errors import DatasetError
from gibench.datasets.exr import decode
from gibench.datasets.loading import Dataset, Frame, open_dataset
from gibench.datasets.manifest import room_record

if TYPE_CHECKING:
    from torch import Tensor
    from torch.utils.data import Dataset as TorchDataset

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
                    tuple(_inside(root, str(file)) for file in frames["file"]),
                    tuple(_inside(again, str(file)) for file in frames["file"]),
                ),
            )
        )
    return scenes


def _inside(root: Path, file: str) -> Path:
    try:
        return gate.inside(root, file)
    except gate.GateError as problem:
        raise ResultsError(f"the scenes of this run cannot be read: {problem}") from None


def _content(root: Path, room: int) -> str:
    files = room_record(root, room)["files"]
    # The same geometry once more, for viewers.
    known = {name: file["sha256"] for name, file in files.items() if not name.endswith(".glb")}
    return hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()


class TrainingViews(Sequence[Frame]):
    """The training views of a room. Whoever is handed one is charged with its rendering, whatever process reads it."""

    def __init__(self, dataset: Dataset | None) -> None:
        """dataset: of this room's views alone; None where the run made none."""
        self._dataset = dataset
        self._booking = Booking(len(self))

    def __len__(self) -> int:
        """Number of views; asking costs nothing."""
        return len(self._dataset) if self._dataset is not None else 0

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        """Hand out a view, or some. Raises IndexError."""
        if isinstance(index, slice):
            return [self[one] for one in range(*index.indices(len(self)))]
        if self._dataset is None:
            raise IndexError(f"view {index} of none")
        frame = self._dataset[index]
        self._booking.book(index % len(self))
        return frame

    def torch(self, channels: Sequence[str]) -> TorchDataset[dict[str, Tensor]]:
        """Hand out all of them, as `Dataset.torch` does."""
        if self._dataset is None:
            raise ResultsError("this method asked for no channels of training views")
        self._booking.book_all()
        return self._dataset.torch(channels)

    @property
    def handed_out(self) -> list[int]:
        """Numbers of the views that somebody was given."""
        return self._booking.booked

    @property
    def seconds(self) -> float:
        """That rendering these took."""
        if self._dataset is None:
            return 0.0
        return float(sum(self._dataset[index].row["seconds"] for index in self.handed_out))


def training_views(root: Path | None, room: int) -> TrainingViews:
    """Training views of a room; none where the run made none."""
    if root is None:
        return TrainingViews(None)
    dataset = open_dataset(root)
    rows = dataset.frames[dataset.frames["room"] == room].reset_index(drop=True)
    return TrainingViews(Dataset(root, dataset.manifest, rows))
