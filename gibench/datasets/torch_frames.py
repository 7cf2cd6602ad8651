"""Frames as tensors, for `torch.utils.data.DataLoader`. Importing this module loads torch."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch.utils.data import Dataset

from gibench import gate
from gibench.datasets.exr import decode


class TorchFrames(Dataset[dict[str, torch.Tensor]]):
    """A map-style dataset over frame files; see `gibench.datasets.loading.Dataset.torch`."""

    def __init__(self, root: Path, files: Sequence[str], channels: Sequence[str]) -> None:
        """root: of the dataset. files: one OpenEXR file a frame, from there. channels: what an item holds."""
        self.root = root
        self.files = list(files)
        self.channels = tuple(channels)

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.files)

    def __getitem__(self, index: int) -> dict[str, torch.Tensor]:
        """Return channel → (C, H, W): float32, ids int64 (torch cannot index with uint32)."""
        arrays = decode(gate.inside(self.root, self.files[index]), self.channels, widen=True)
        return {name: _tensor(np.moveaxis(values, -1, 0)) for name, values in arrays.items()}


def _tensor(values: np.ndarray) -> torch.Tensor:
    if values.dtype == np.uint32:
        values = values.astype(np.int64)
    return torch.from_numpy(np.ascontiguousarray(values))
