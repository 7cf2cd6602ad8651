"""Images of any size for networks that halve them."""

from __future__ import annotations

from torch import Tensor
from torch.nn.functional import pad


def padded(image: Tensor, multiple: int) -> Tensor:
    """(N, C, H, W) with its last row and column repeated until both sides are multiples; itself where they are."""
    height, width = image.shape[-2:]
    return _wider(image, -height % multiple, -width % multiple)


def at_least(image: Tensor, side: int) -> Tensor:
    """(N, C, H, W) with its last row and column repeated until no side is shorter; itself where none is."""
    height, width = image.shape[-2:]
    return _wider(image, max(0, side - height), max(0, side - width))


def _wider(image: Tensor, rows: int, columns: int) -> Tensor:
    return pad(image, (0, columns, 0, rows), mode="replicate") if rows or columns else image
