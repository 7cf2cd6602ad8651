"""Reading a dataset: frames that load the channels that are asked for, when they are asked for."""

from __future__ import annotations

import operator
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from gibench import gate
from gibench.datasets.cameras import camera_of
from gibench.datasets.errors import DatasetError, nearest
from gibench.datasets.exr import decode, present_channels
from gibench.datasets.folder import TABLE, room_folder, whole_rooms
from gibench.datasets.lightings import lighting_of
from gibench.datasets.manifest import frame_table, read_manifest, recipe_of, room_record
from gibench.datasets.table import read_table
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import Lighting, Shot

if TYPE_CHECKING:
    import pandas as pd
    from torch import Tensor
    from torch.utils.data import Dataset as TorchDataset


class Frame:
    """One frame. `frame["color"]` reads a channel, `frame.read(...)` several at once; nothing is kept.

    room, view: which one it is. split, kind, exposure … are the columns of its row: `frame.row["exposure"]`.
    """

    def __init__(self, path: Path, row: dict[str, Any]) -> None:
        """path: the OpenEXR file. row: its row of the table."""
        self.path = path
        self.row = row

    def __repr__(self) -> str:
        """Room and number of the frame."""
        return f"Frame(room={self.room}, view={self.view}, path={str(self.path)!r})"

    @property
    def room(self) -> int:
        """Number of its room."""
        return int(self.row["room"])

    @property
    def view(self) -> int:
        """Number of the view in its room."""
        return int(self.row["view"])

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels in the file."""
        return present_channels(self.path)

    @property
    def camera(self) -> PinholeCamera:
        """Its camera, world space in metres, Z up."""
        return camera_of(self.row)

    @property
    def lighting(self) -> Lighting:
        """Its light: `Lighting()` where it is the room's own. An environment is read when its pixels are asked for."""
        return lighting_of(self.row, self.path.parents[3])

    @property
    def shot(self) -> Shot:
        """Its camera and its light."""
        return Shot(self.camera, self.lighting)

    @property
    def camera_to_world(self) -> NDArray[np.float64]:
        """(4, 4) transform from camera space to world space, metres, in OpenCV's convention.

        Camera space has x to the right of the image, y down and z forward; the last column is the position. OpenGL's
        convention, which NeRF tools take, has the second and third column negated. It is rigid, with a determinant of
        1; that of a mirrored camera is −1.
        """
        camera, matrix = self.camera, np.eye(4)
        matrix[:3, :3] = camera.frame.T
        matrix[:3, 3] = camera.position
        return matrix

    @property
    def intrinsics(self) -> NDArray[np.float64]:
        """(3, 3) matrix from camera space (as in `camera_to_world`) to homogeneous pixels.

        The outer corner of the first pixel is (0, 0), its centre (0.5, 0.5).
        """
        width, height = int(self.row["width"]), int(self.row["height"])
        camera = self.camera
        focal, (x, y) = camera.focal_length(width), camera.centre((width, height))
        return np.array([[focal, 0, x], [0, focal, y], [0, 0, 1]])

    def _repr_html_(self) -> str:
        """The frame with all its channels, as a notebook shows it."""
        import base64
        import html
        import io

        from gibench.datasets.previews import frame_panel

        content = io.BytesIO()
        frame_panel(self).save(content, "png")
        title = html.escape(f"room {self.room}, view {self.view} ({self.row['kind']}), {self.path}")
        picture = base64.b64encode(content.getvalue()).decode()
        return f'<figure><figcaption>{title}</figcaption><img src="data:image/png;base64,{picture}"></figure>'

    def __getitem__(self, channel: str) -> NDArray[Any]:
        """Read one channel: (H, W, C) float32, or uint32 for ids. Raises `UnknownChannel`, `StorageError`."""
        return self.read(channel)[channel]

    def read(self, *channels: str) -> dict[str, NDArray[Any]]:
        """Read several channels in one go, all of them where none is named; values as for indexing."""
        return decode(self.path, channels or None, widen=True)


class Dataset:
    """A dataset on disk, a sequence of `Frame`; see `open_dataset`.

    root: its folder. manifest: the content of `dataset.json`. frames: a row a frame (`manifest.frame_table`).
    """

    def __init__(self, root: Path, manifest: dict[str, Any], frames: pd.DataFrame) -> None:
        """frames: all rows of the table, or those of a split."""
        self.root = root
        self.manifest = manifest
        self.frames = frames

    def __repr__(self) -> str:
        """Folder, rooms and frames."""
        return f"Dataset({str(self.root)!r}, {len(self)} frames of {self.frames['room'].nunique()} rooms)"

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.frames)

    @overload
    def __getitem__(self, index: int | np.integer[Any]) -> Frame: ...

    @overload
    def __getitem__(self, index: slice | Sequence[int] | NDArray[Any]) -> Dataset: ...

    def __getitem__(self, index: Any) -> Frame | Dataset:
        """Return one frame by its number, or the dataset of several by a slice, a sequence or a mask.

        Numbers count from the end where negative and may be of any library (a tensor of one element too). Raises
        IndexError.
        """
        if not isinstance(index, slice):
            numbers = np.asarray(index)
            if numbers.ndim:
                return self._part(self._numbers(numbers))
            number = operator.index(numbers.item() if numbers.dtype != object else index)
            if not -len(self) <= number < len(self):
                raise IndexError(f"frame {number} of {len(self)}")
            row: dict[str, Any] = {str(k): v for k, v in self.frames.iloc[number].to_dict().items()}
            return Frame(self._frame_file(row["file"]), row)
        return self._part(np.arange(len(self))[index])

    def _frame_file(self, name: str) -> Path:
        try:
            return gate.inside(self.root, name)
        except gate.GateError as problem:
            raise DatasetError(f"frame {problem}") from None

    def _numbers(self, index: NDArray[Any]) -> NDArray[np.int64]:
        if index.ndim != 1 or (index.size and index.dtype.kind not in "iub"):
            raise IndexError(f"frames by {index.dtype} of shape {index.shape}: give whole numbers or a mask")
        if index.dtype.kind == "b":
            if len(index) != len(self):
                raise IndexError(f"a mask of {len(index)} for {len(self)} frames")
            return np.flatnonzero(index)
        wrong = index[(index < -len(self)) | (index >= len(self))]
        if wrong.size:
            raise IndexError(f"frame {wrong[0]} of {len(self)}")
        return index.astype(np.int64)

    def _part(self, numbers: NDArray[Any]) -> Dataset:
        return Dataset(self.root, self.manifest, self.frames.iloc[numbers].reset_index(drop=True))

    def __iter__(self) -> Iterator[Frame]:
        """Go through the frames, in order."""
        return (self[index] for index in range(len(self)))

    def split(self, name: str) -> Dataset:
        """Return the frames of a split. Splits go by room. Raises `DatasetError` for a name that is none."""
        splits = self.manifest["recipe"]["splits"]
        if name not in splits:
            raise DatasetError(f"{self.root} has no split '{name}'; {nearest(name, splits)}")
        return self._part(np.flatnonzero(self.frames["split"] == name))

    def room_folder(self, room: int) -> Path:
        """Folder of a room's scene.xml, room.json and room.glb."""
        return room_folder(self.root, room)

    def names(self, room: int) -> tuple[list[str], list[str]]:
        """Return what ids mean in a room: names of materials and of shapes; id i is entry i − 1."""
        record = room_record(self.root, room)
        return list(record["materials"]), list(record["shapes"])

    def torch(self, channels: Sequence[str]) -> TorchDataset[dict[str, Tensor]]:
        """Return a map-style `torch.utils.data.Dataset` over the same frames.

        Each item is a dict: channel → float32 tensor (C, H, W), or int64 for ids. It can be sent to the
        worker processes of a `DataLoader`. Items come out of the dataset's cache where `gibench dataset cache` has put
        these channels into one. Raises `DatasetError` where torch is not installed.
        """
        try:
            from gibench.datasets.torch_frames import torch_frames
        except ImportError:
            raise DatasetError("torch is not installed: pip install 'gibench[bench]'") from None
        return torch_frames(self, channels)


def open_dataset(root: str | Path) -> Dataset:
    """Open a dataset that `make-dataset` wrote; pixels are read when a frame is asked for them.

    An unfinished dataset opens with the frames that were whole when its last run ended, or, where that was killed,
    with those of the rooms that are whole now. Raises `DatasetError`.
    """
    root = Path(root)
    manifest = read_manifest(root)
    recipe = recipe_of(manifest)
    try:
        frames = read_table(root, recipe)
    except gate.GateError as problem:
        if not problem.missing:
            raise DatasetError(f"{root / TABLE} cannot be read: {problem}") from None
        # The run was killed before it wrote the table; every whole room has its own part of it.
        frames = frame_table((room_record(root, room) for room in whole_rooms(root)), recipe)
        if not len(frames):
            raise DatasetError(
                f"{root} has no {TABLE} and no whole room: its making was cut off; to continue it run "
                f"`{manifest['command']}`"
            ) from None
    return Dataset(root, manifest, frames)
