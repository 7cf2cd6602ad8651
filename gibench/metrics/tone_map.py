"""The one way from linear radiance to display values: expose, clip, sRGB.

The exposure comes from the reference alone, so that no method can choose its own, and every method is looked
at under the same exposure on the same frame. Nothing is rounded to 8 bits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gibench.metrics.errors import RangeError, ShapeError
from gibench.metrics.inputs import FloatArray, check_radiance, float_array

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Luminance of linear Rec. 709 RGB (ITU-R BT.709-6, item 3.2)."""

MIDDLE_GREY = 0.18
"""Value that the exposure maps the reference's median to: the reflectance of a photographer's grey card, and the key
value of Reinhard et al. 2002 (Photographic tone reproduction for digital images, section 3)."""

DARKEST_LIT = float(np.finfo(np.float32).tiny)
"""Luminance below which a pixel counts as unlit; from here on an exposure is finite in float32 too."""

DUST = 2.0**-30
"""Share of the brightest luminance of a frame below which a pixel counts as unlit too. Denoising and sampling leave
values like 1e-12 where nothing is lit; the sun seen from a dim room is 2²⁷ times as bright as the room."""


def lit_luminance(luminance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give those of some luminances that count as lit: at least `DARKEST_LIT`, and `DUST` times the brightest."""
    return luminance[luminance >= max(DARKEST_LIT, DUST * float(luminance.max(initial=0.0)))]


def reference_exposure(ref: ArrayLike, *, shared: bool = False) -> float | NDArray[np.float64]:
    """Choose the exposure that brings the median luminance of the lit pixels of a reference to middle grey.

    The median, unlike the mean, does not move when a lamp comes into view. Unlit pixels are left out, because
    the median of a mostly black image, such as a layer of specular light alone, would be 0.

    Args:
        ref: linear radiance of the reference, (H, W, 3) or (N, H, W, 3), Rec. 709 RGB.
        shared: one exposure for all frames of a batch, as a sequence in time needs it.

    Returns:
        The factor on radiance: a float, or (N,) for a batch that does not share one. A black image gives 1.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for an input that is no such image.

    Examples:
        >>> import numpy as np
        >>> round(reference_exposure(np.full((4, 4, 3), 9.0)), 6)
        0.02
    """
    image = _radiance("ref", ref)
    if image.ndim == 4 and not shared:
        return np.array([_exposure(frame) for frame in image])
    return _exposure(image)


def tone_map(radiance: ArrayLike, exposure: ArrayLike) -> FloatArray:
    """Map linear radiance to display values: sRGB(min(exposure · L, 1)).

    Args:
        radiance: (H, W, 3) or (N, H, W, 3), linear Rec. 709 RGB.
        exposure: a positive number, or (N,) with one for each frame of a batch; see `reference_exposure`.

    Returns:
        Display values in [0, 1], not rounded, of the same shape; float64 for float64, else float32.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are no such image or exposure.

    Examples:
        >>> import numpy as np
        >>> radiance = np.array([[[0.0, 0.09, 50.0]]])
        >>> tone_map(radiance, 2.0).round(3).tolist()
        [[[0.0, 0.461, 1.0]]]

    References:
        IEC 61966-2-1:1999, section 5.2 (the sRGB transfer function).
    """
    image = _radiance("radiance", radiance)
    factor = np.asarray(exposure, dtype=np.float64)
    if factor.ndim > 1 or (factor.ndim == 1 and factor.shape != image.shape[:-3]):
        raise ShapeError(f"exposure has shape {factor.shape} for an image of shape {image.shape}")
    if not (np.isfinite(factor).all() and (factor > 0).all()):
        raise RangeError(f"exposure must be positive and finite, not {factor}")
    limits = np.finfo(image.dtype)
    # An exposure beyond the image's own type would be infinite or 0 there.
    wide = np.float64 if ((factor < limits.tiny) | (factor > limits.max)).any() else image.dtype
    factor = (factor[:, None, None, None] if factor.ndim else factor).astype(wide)
    with np.errstate(over="ignore"):  # what overflows is far above 1, where the curve clips
        exposed = np.minimum(image.astype(wide, copy=False) * factor, 1).astype(image.dtype, copy=False)
    return srgb_from_linear(exposed)


def display_slope(radiance: NDArray[np.float64], exposure: float) -> NDArray[np.float64]:
    """Give the derivative of `tone_map` by radiance, of any shape; 0 where it clips."""
    exposed = radiance * exposure
    power = np.power(np.maximum(exposed, 0.0031308), 1 / 2.4 - 1)
    slope = np.where(exposed <= 0.0031308, 12.92, 1.055 / 2.4 * power)
    return np.where(exposed < 1, exposure * slope, 0.0)


def srgb_from_linear(linear: FloatArray) -> FloatArray:
    """Apply the sRGB transfer function to values in [0, 1] of any shape (IEC 61966-2-1:1999, section 5.2)."""
    root = np.power(linear, linear.dtype.type(1 / 2.4))
    # 1.055·root − 0.055 in a form that takes 1 to exactly 1 and nothing above it, whatever the rounding.
    return np.where(linear <= 0.0031308, 12.92 * linear, root + 0.055 * (root - 1))


def linear_from_srgb(display: NDArray[np.float64]) -> NDArray[np.float64]:
    """Invert `srgb_from_linear` for values in [0, 1], of any shape."""
    curve = np.power((display + 0.055) / 1.055, 2.4)
    return np.where(display <= 0.04045, display / 12.92, curve)


def _radiance(name: str, value: ArrayLike) -> FloatArray:
    image = float_array(name, value)
    if image.ndim not in (3, 4) or image.shape[-1] != 3 or image.size == 0:
        raise ShapeError(f"{name} must be (H, W, 3) or (N, H, W, 3) with pixels in it, not {image.shape}")
    check_radiance(name, image)
    return image


def _exposure(image: FloatArray) -> float:
    lit = lit_luminance(image @ LUMINANCE)
    return float(MIDDLE_GREY / np.median(lit)) if lit.size else 1.0
