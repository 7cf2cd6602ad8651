"""The way from radiance to a picture: exposure, clip, sRGB."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Weights of linear Rec. 709 RGB in relative luminance (ITU-R BT.709)."""

MIDDLE_GREY = 0.18
"""Where the geometric mean of the image is put: the key of Reinhard et al. 2002, section 3.1."""


def auto_exposure(reference: ArrayLike) -> float:
    """Exposure that puts the geometric mean luminance of `reference` at MIDDLE_GREY.

    reference: (H, W, 3) linear radiance, ≥ 0. Pixels at 0 are left out of the mean (a window onto the night is no
    measure of the room), so a black image gives 1. Returns a factor > 0, finite.
    """
    luminance = np.asarray(reference, dtype=np.float64) @ LUMINANCE
    lit = luminance[np.isfinite(luminance) & (luminance > 0)]
    if lit.size == 0:
        return 1.0
    exposure = MIDDLE_GREY / float(np.exp(np.log(lit).mean()))
    return float(np.clip(exposure, 1e-30, 1e30))


def srgb_encode(linear: ArrayLike) -> NDArray[np.float32]:
    """IEC 61966-2-1 transfer curve; linear in [0, 1] to sRGB in [0, 1], any shape."""
    x = np.asarray(linear, dtype=np.float64)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055).astype(
        np.float32
    )


def display(image: ArrayLike, exposure: float) -> NDArray[np.float32]:
    """Exposed, clipped to [0, 1] and sRGB-encoded. image: (…, 3) linear radiance. Returns float32 of its shape."""
    return srgb_encode(np.clip(np.asarray(image, dtype=np.float64) * exposure, 0.0, 1.0))
