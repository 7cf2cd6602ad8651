"""Images of any size for networks that halve them."""

from __future__ import annotations

from torch import Tensor
from torch.nn.functional import pad


def padded(image: Tensor, multiple: int) -> Tensor:
    """(N, C, H, W) with its last row and column repeated until both sides are multiples; itself where they are."""
    height, width = image.shape[-2:]
    margins = (0, -width % multiple, 0, -height % multiple)
    return pad(image, margins, mode="replicate") if any(margins) else image
