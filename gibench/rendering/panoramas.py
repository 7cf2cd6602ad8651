"""A panorama of light from all directions, known by what it holds."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.errors import GibenchError

HEIGHT = 128
"""Rows of the panoramas that frames are lit by: the renderer compiles anew for every other size."""

Pixels = NDArray[np.float32]


class PanoramaError(GibenchError, ValueError):
    """Pixels that are no panorama, or have values that no light has."""


@dataclass(frozen=True)
class Panorama:
    """Radiance from all directions, laid out as `latlong` says.

    name: by which it is told apart in tables. sha256: of its size and pixels; two panoramas are equal where both are.
    source: the pixels, or what reads them when they are asked for. Make one with `of`.
    """

    name: str
    sha256: str
    source: Pixels | Callable[[], Pixels] = field(compare=False, repr=False)

    @classmethod
    def of(cls, name: str, pixels: NDArray[Any]) -> Panorama:
        """From pixels (H, 2·H, 3), W·m⁻²·sr⁻¹ in linear Rec. 709, finite, ≥ 0; may be black. Raises PanoramaError."""
        values = np.array(_checked(name, np.asarray(pixels)), dtype=np.float32, order="C")
        values.setflags(write=False)
        return cls(name, digest(values), values)

    @cached_property
    def pixels(self) -> Pixels:
        """(H, 2·H, 3), read-only. Raises PanoramaError where what was read is not what `sha256` says."""
        if not callable(self.source):
            return self.source
        pixels = self.source()
        if digest(pixels) != self.sha256:
            raise PanoramaError(f"panorama {self.name}: its pixels are not those that it was made with")
        pixels.setflags(write=False)
        return pixels


def digest(pixels: Pixels) -> str:
    """SHA-256 of the size and the float32 values of pixels, the same on every machine."""
    values = np.ascontiguousarray(pixels, dtype="<f4")
    return hashlib.sha256(str(values.shape).encode() + values.tobytes()).hexdigest()


def _checked(name: str, pixels: NDArray[Any]) -> NDArray[Any]:
    if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.shape[1] != 2 * pixels.shape[0] or len(pixels) < 2:
        raise PanoramaError(
            f"panorama {name}: it has the shape {pixels.shape}; an equirectangular panorama is twice as wide as high, "
            "with 3 colours"
        )
    broken = int((~np.isfinite(pixels)).sum() + (pixels < 0).sum())
    if broken:
        raise PanoramaError(
            f"panorama {name}: {broken} values are negative or not finite; mend it or use another"
        )
    return pixels
