"""OIDN's filter for lightmaps, which needs no guides and was trained on atlases."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gibench.rendering.denoise import DenoiserError, input_scale


def denoise_lightmap(atlas: NDArray[np.float32]) -> NDArray[np.float32]:
    """Remove the noise of an atlas without black between its charts.

    atlas: (H, W, 3) float32 ≥ 0. Returns the same shape, ≥ 0. Raises DenoiserError where mitsuba-oidn is missing.
    """
    if not atlas.any():
        return atlas
    try:
        import mitsuba_oidn
    except ImportError as error:
        raise DenoiserError(f"the denoiser does not load ({error}); run: pip install mitsuba-oidn") from error
    result = mitsuba_oidn.denoise(
        np.ascontiguousarray(atlas), hdr=True, filter="RTLightmap", input_scale=input_scale(atlas)
    )
    return np.maximum(np.asarray(result, dtype=np.float32), 0.0)
