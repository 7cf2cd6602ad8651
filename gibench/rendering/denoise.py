"""Denoising with Intel Open Image Denoise, through `mitsuba-oidn`.

OIDN expects independent noise from pixel to pixel, so only box-filtered images may be given to it.
"""

from __future__ import annotations

import contextlib
import importlib.metadata

import numpy as np
from numpy.typing import NDArray

from gibench.errors import GibenchError

Image = NDArray[np.float32]

KEY = 0.18
"""Where the geometric mean of the input is put before the network sees it."""


class DenoiserError(GibenchError):
    """The denoiser is not there, or refused its input."""


def denoiser_version() -> str | None:
    """Version of the installed OIDN binding, or None."""
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        return importlib.metadata.version("mitsuba-oidn")
    return None


def input_scale(radiance: Image) -> float:
    """Exposure that puts the geometric mean of the lit values of (H, W, 3) radiance at KEY; needs one above 0."""
    lit = radiance[radiance > 0].astype(np.float64)
    return float(KEY / np.exp(np.log(lit).mean()))


def denoise(radiance: Image, *, albedo: Image | None = None, normal: Image | None = None) -> Image:
    """Removes Monte Carlo noise from one radiance image.

    radiance: (H, W, 3) float32, ≥ 0, linear, box-filtered. albedo: (H, W, 3) in [0, 1] and normal: (H, W, 3) in
    [-1, 1], both averaged over the pixel like the radiance; they may be noisy. Returns (H, W, 3) float32 ≥ 0; where
    the whole input is 0, so is the result, exactly.

    Raises DenoiserError where mitsuba-oidn is not installed.
    """
    if not radiance.any():
        return np.zeros_like(radiance)
    try:
        import mitsuba_oidn
    except ImportError as error:
        raise DenoiserError(f"the denoiser does not load ({error}); run: pip install mitsuba-oidn") from error
    result = mitsuba_oidn.denoise(
        np.ascontiguousarray(radiance, dtype=np.float32),
        albedo=None if albedo is None else np.ascontiguousarray(albedo, dtype=np.float32),
        normal=None if normal is None else np.ascontiguousarray(normal, dtype=np.float32),
        hdr=True,
        # OIDN's own choice of exposure depends on the number of threads in its last bits, and so would every pixel.
        input_scale=input_scale(radiance),
    )
    return np.maximum(np.asarray(result, dtype=np.float32), 0.0)
