"""The orthonormal Haar transform of square images, non-standard: rows and columns in turn at every level.

Four neighbours a, b (above) and c, d (below) become (a + b + c + d)/2 and three differences: (a − b + c − d)/2,
(a + b − c − d)/2 and (a − b − c + d)/2; the sums are transformed again (Ng, Ramamoorthi and Hanrahan 2003, section 4,
on each face of a cubemap by itself). The sum over all is at [0, 0]; differences of a level are in the three quarters
that begin at [0, h], [h, 0] and [h, h], where h is 1 for the coarsest level and half of the side for the finest.

Functions take NumPy arrays and PyTorch tensors alike.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gibench.errors import GibenchError

if TYPE_CHECKING:
    import torch

Image = TypeVar("Image", NDArray[Any], "torch.Tensor")


class WaveletError(GibenchError, ValueError):
    """An image that has no Haar transform, or a selection that cannot be made."""


def side_of(image: Any) -> int:
    """The side of square images (…, S, S, C), a power of 2. Raises WaveletError."""
    shape = tuple(image.shape)
    side = shape[-2] if len(shape) >= 3 else 0
    if len(shape) < 3 or shape[-3] != side or side < 1 or side & (side - 1):
        raise WaveletError(f"an image of shape {shape}: (…, S, S, C) is needed, S a power of 2")
    return side


def haar(image: Image) -> Image:
    """Coefficients (…, S, S, C) of images (…, S, S, C), S a power of 2. Raises WaveletError.

    The sum of squares stays what it was.
    """
    half = side_of(image) // 2
    result = image * 1
    low = image
    while half:
        a, b = low[..., 0::2, 0::2, :], low[..., 0::2, 1::2, :]
        c, d = low[..., 1::2, 0::2, :], low[..., 1::2, 1::2, :]
        low = (a + b + c + d) / 2
        result[..., :half, half : 2 * half, :] = (a - b + c - d) / 2
        result[..., half : 2 * half, :half, :] = (a + b - c - d) / 2
        result[..., half : 2 * half, half : 2 * half, :] = (a - b - c + d) / 2
        result[..., :half, :half, :] = low
        half //= 2
    return result


def inverse_haar(coefficients: Image) -> Image:
    """Images (…, S, S, C) of coefficients (…, S, S, C). Raises WaveletError."""
    side = side_of(coefficients)
    result = coefficients * 1
    half = 1
    while half < side:
        low = result[..., :half, :half, :] * 1
        across = result[..., :half, half : 2 * half, :] * 1
        down = result[..., half : 2 * half, :half, :] * 1
        both = result[..., half : 2 * half, half : 2 * half, :] * 1
        result[..., 0 : 2 * half : 2, 0 : 2 * half : 2, :] = (low + across + down + both) / 2
        result[..., 0 : 2 * half : 2, 1 : 2 * half : 2, :] = (low - across + down - both) / 2
        result[..., 1 : 2 * half : 2, 0 : 2 * half : 2, :] = (low + across - down - both) / 2
        result[..., 1 : 2 * half : 2, 1 : 2 * half : 2, :] = (low - across - down + both) / 2
        half *= 2
    return result


@lru_cache(maxsize=8)
def supports(side: int) -> NDArray[np.float64]:
    """(side, side) on how many texels each coefficient's wavelet is not 0; side² for the sum. Not to be written to."""
    place = np.maximum(*np.mgrid[0:side, 0:side])
    # The wavelets whose place is from h on, below 2·h, divide the picture into h × h parts.
    level = np.where(place > 0, 2 ** np.floor(np.log2(np.maximum(place, 1))), 1)
    found = np.asarray((side / level) ** 2)
    found.flags.writeable = False
    return found
