"""Windows of images: training on crops fits memory, and makes many views of few."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from torch import Tensor


class Window(NamedTuple):
    """Pixels of an image from (top, left) on."""

    top: int
    left: int
    height: int
    width: int

    def of(self, image: Tensor) -> Tensor:
        """That part of (…, H, W), a view."""
        return image[..., self.top : self.top + self.height, self.left : self.left + self.width]


def random_window(size: Sequence[int], side: int, random: np.random.Generator) -> Window:
    """A window of side × side pixels, or as much as there is, anywhere in an image of that (height, width).

    Every place is equally likely, so pixels at an edge are in fewer windows than those in the middle.
    """
    height, width = (min(side, length) for length in size)
    top = int(random.integers(size[0] - height + 1))
    left = int(random.integers(size[1] - width + 1))
    return Window(top, left, height, width)
