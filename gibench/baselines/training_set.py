"""Training sets: frames of one room or of many, made from the table of a dataset.

Nothing but the table is read until a frame is handed out. Whoever is handed one is charged with its rendering, whatever
process reads it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, overload

from gibench.baselines.booking import Booking
from gibench.datasets.errors import DatasetError
from gibench.datasets.loading import Dataset, Frame, open_dataset

if TYPE_CHECKING:
    import pandas as pd
    from torch import Tensor
    from torch.utils.data import Dataset as TorchDataset

#: Columns of the table that say how frames were made, not what is in them.
OF_THE_MAKING = ("kernel_seconds", "denoise_seconds", "seconds", "file", "bytes", "median_error")


class TrainingSet(Sequence[Frame]):
    """Frames to learn from, a sequence; see `training_set`.

    Asking how many there are, for the table or for the hash costs nothing. `frames` is the table: a row a frame, in the
    order of the sequence, with the columns of `frames.parquet`.
    """

    def __init__(self, dataset: Dataset | None = None) -> None:
        """dataset: of the frames; None where there are none."""
        self._dataset = dataset
        self._booking = Booking(len(self))

    def __repr__(self) -> str:
        """Number of frames and rooms."""
        return f"TrainingSet({len(self)} frames of {len(self.rooms)} rooms)"

    def __len__(self) -> int:
        """Number of frames."""
        return 0 if self._dataset is None else len(self._dataset)

    @property
    def frames(self) -> pd.DataFrame:
        """The table of the frames."""
        if self._dataset is None:
            raise DatasetError("there are no training frames: this method asked for no channels of them")
        return self._dataset.frames

    @property
    def rooms(self) -> tuple[int, ...]:
        """Numbers of the rooms that frames are of, ascending."""
        return () if self._dataset is None else tuple(sorted({int(room) for room in self.frames["room"]}))

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        """Hand out a frame, or some. Raises IndexError."""
        if isinstance(index, slice):
            return [self[one] for one in range(*index.indices(len(self)))]
        if self._dataset is None:
            raise IndexError(f"frame {index} of none")
        frame = self._dataset[index]
        self._booking.book(index % len(self))
        return frame

    def torch(
        self, channels: Sequence[str], frames: Sequence[int] | None = None
    ) -> TorchDataset[dict[str, Tensor]]:
        """A map-style `torch.utils.data.Dataset`, for a `DataLoader` with or without workers.

        An item is channel → float32 tensor (C, H, W), or int64 for ids. A frame is handed out, and charged for, when
        its item is read, by forked workers too; to workers that are spawned all of them are. frames: numbers of those
        that it is over, in that order; all of them by default. Items come out of the dataset's cache where that has
        these channels; `read(index, window)` of the result reads a part of one. Raises DatasetError where there are no
        frames.
        """
        from gibench.datasets.torch_frames import torch_frames

        chosen = range(len(self.frames)) if frames is None else frames
        assert self._dataset is not None
        items = torch_frames(self._dataset, channels, chosen)
        return cast("TorchDataset[dict[str, Tensor]]", _Handed(items, chosen, self._booking))

    @cached_property
    def sha256(self) -> str:
        """Hash of these frames, hexadecimal, of shots and content; no pixel is read."""
        content = hashlib.sha256()
        if self._dataset is not None:
            table = self.frames.drop(columns=[name for name in OF_THE_MAKING if name in self.frames])
            content.update(table.to_csv(index=False, float_format="%.17g").encode())
        return content.hexdigest()

    @property
    def handed_out(self) -> list[int]:
        """Numbers of the frames that somebody was given."""
        return self._booking.booked

    @property
    def seconds(self) -> float:
        """That rendering these took."""
        return float(self.frames["seconds"].iloc[self.handed_out].sum()) if self.handed_out else 0.0

    def book(self, numbers: Sequence[int]) -> None:
        """Charge for frames that were handed out elsewhere."""
        for number in numbers:
            self._booking.book(number)

    @contextmanager
    def apart(self) -> Iterator[list[int]]:
        """Within it, only what is handed out meanwhile counts; the list holds it afterwards."""
        before, self._booking = self._booking, Booking(len(self))
        inside: list[int] = []
        try:
            yield inside
        finally:
            inside += self._booking.booked
            self._booking = before
            self.book(inside)


class _Handed:  # as torch asks of a map-style dataset; its base class would have to be imported
    """Items of a dataset of torch; whichever is read is booked."""

    def __init__(self, items: Any, numbers: Sequence[int], booking: Booking) -> None:
        self._items, self._numbers, self._booking = items, list(numbers), booking

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: int) -> dict[str, Tensor]:
        return self.read(index)

    def read(self, index: int, window: Sequence[int] | None = None) -> dict[str, Tensor]:
        self._booking.book(self._numbers[index])
        return cast("dict[str, Tensor]", self._items.read(index, window))


def training_set(root: Path | None, room: int | None = None) -> TrainingSet:
    """The frames of a dataset, or of one of its rooms; none where there is no dataset.

    Raises DatasetError.
    """
    if root is None:
        return TrainingSet()
    dataset = open_dataset(root)
    if room is None:
        return TrainingSet(dataset)
    rows = dataset.frames[dataset.frames["room"] == room].reset_index(drop=True)
    return TrainingSet(Dataset(root, dataset.manifest, rows))
