"""Frames as tensors, for `torch.utils.data.DataLoader`. Importing this module loads torch."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch.utils.data import Dataset

from gibench import gate
from gibench.datasets import loading
from gibench.datasets.cache import FrameCache, Window, opened_cache
from gibench.datasets.exr import decode


class TorchFrames(Dataset[dict[str, torch.Tensor]]):
    """A map-style dataset over frames; see `gibench.datasets.loading.Dataset.torch`."""

    def __init__(
        self, root: Path, files: Sequence[str], channels: Sequence[str], cache: FrameCache | None = None
    ) -> None:
        """root: of the dataset. files: one OpenEXR file a frame, from there. channels: what an item holds.

        cache: where all of them are read from in place of the files.
        """
        self.root = root
        self.files = list(files)
        self.channels = tuple(channels)
        self.cache = cache

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.files)

    def __getitem__(self, index: int) -> dict[str, torch.Tensor]:
        """Return channel → (C, H, W): float32, ids int64 (torch cannot index with uint32)."""
        return self.read(index)

    def read(self, index: int, window: Window | None = None) -> dict[str, torch.Tensor]:
        """An item, or a window of it: top, left, height, width. Out of a cache nothing else is read then."""
        if self.cache is not None:
            stored = self.cache.stored(self.files[index], self.channels, window)
            return {name: _widened(*values) for name, values in stored.items()}
        whole = decode(gate.inside(self.root, self.files[index]), self.channels, widen=True)
        arrays = {name: np.moveaxis(values, -1, 0) for name, values in whole.items()}
        if window is not None:
            top, left, height, width = window
            arrays = {
                name: values[:, top : top + height, left : left + width] for name, values in arrays.items()
            }
        return {name: _tensor(values) for name, values in arrays.items()}


def torch_frames(
    dataset: loading.Dataset, channels: Sequence[str], numbers: Sequence[int] | None = None
) -> TorchFrames:
    """The frames of a dataset, or those of these numbers, out of its cache where that has all the channels.

    Raises DatasetError for a cache that is damaged.
    """
    files = dataset.frames["file"]
    chosen = files if numbers is None else files.iloc[list(numbers)]
    cache = opened_cache(dataset)
    if cache is not None and not cache.channels.issuperset(channels):
        cache = None
    return TorchFrames(dataset.root, [str(file) for file in chosen], channels, cache)


def _widened(values: np.ndarray, exponent: int) -> torch.Tensor:
    """A copy of a part of the cache. torch widens float16 several times faster than NumPy does."""
    if values.dtype == np.uint32:
        return _tensor(values)
    tensor = torch.empty(values.shape, dtype=torch.float32).copy_(torch.from_numpy(values))
    return torch.ldexp(tensor, torch.tensor(exponent)) if exponent else tensor


def _tensor(values: np.ndarray) -> torch.Tensor:
    if values.dtype == np.uint32:
        values = values.astype(np.int64)
    return torch.from_numpy(np.ascontiguousarray(values))
