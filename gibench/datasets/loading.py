"""Reading a dataset: frames that load the channels that are asked for, when they are asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from gibench.datasets.errors import DatasetError, nearest
from gibench.datasets.exr import decode, present_channels
from gibench.datasets.folder import TABLE, room_folder
from gibench.datasets.manifest import read_manifest, room_record

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
        """Which frame it is."""
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
        """Where it is and how much is in it."""
        return f"Dataset({str(self.root)!r}, {len(self)} frames of {self.frames['room'].nunique()} rooms)"

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.frames)

    def __getitem__(self, index: int) -> Frame:
        """Return frame number `index`, counted from the end where negative. Raises IndexError."""
        if not -len(self) <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        row: dict[str, Any] = {str(k): v for k, v in self.frames.iloc[index].to_dict().items()}
        return Frame(self.root / row["file"], row)

    def __iter__(self) -> Iterator[Frame]:
        """Go through the frames, in order."""
        return (self[index] for index in range(len(self)))

    def split(self, name: str) -> Dataset:
        """Return the frames of a split. Splits go by room. Raises `DatasetError` for a name that is none."""
        splits = self.manifest["recipe"]["splits"]
        if name not in splits:
            raise DatasetError(f"{self.root} has no split '{name}'; {nearest(name, splits)}")
        return Dataset(
            self.root, self.manifest, self.frames[self.frames["split"] == name].reset_index(drop=True)
        )

    def room_folder(self, room: int) -> Path:
        """Where a room's scene.xml, room.json and room.glb lie."""
        return room_folder(self.root, room)

    def names(self, room: int) -> tuple[list[str], list[str]]:
        """Return what ids mean in a room: names of materials and of shapes; id i is entry i − 1."""
        record = room_record(self.root, room)
        return list(record["materials"]), list(record["shapes"])

    def torch(self, channels: Sequence[str]) -> TorchDataset[dict[str, Tensor]]:
        """Return a map-style `torch.utils.data.Dataset` over the same frames.

        Each item is a dict: channel → float32 tensor (C, H, W), or int64 for ids. It can be sent to the
        worker processes of a `DataLoader`. Raises `DatasetError` where torch is not installed.
        """
        try:
            from gibench.datasets.torch_frames import TorchFrames
        except ImportError:
            raise DatasetError("torch is not installed: pip install 'gibench[bench]'") from None
        return TorchFrames([self.root / file for file in self.frames["file"]], channels)


def open_dataset(root: str | Path) -> Dataset:
    """Open a dataset that `make-dataset` wrote; pixels are read when a frame is asked for them.

    An unfinished dataset opens with the frames that were whole when its last run ended. Raises
    `DatasetError`.
    """
    root = Path(root)
    manifest = read_manifest(root)
    import pandas as pd

    try:
        frames = pd.read_parquet(root / TABLE)
    except FileNotFoundError:
        raise DatasetError(
            f"{root} has no {TABLE}: its making was cut off; to continue it run `{manifest['command']}`"
        ) from None
    except (OSError, ValueError) as problem:
        raise DatasetError(
            f"{root / TABLE} is damaged ({problem}): remove it and run `{manifest['command']}`"
        ) from None
    return Dataset(root, manifest, frames)
