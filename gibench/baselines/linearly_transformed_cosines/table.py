"""The fitted table: for a roughness and a view, the matrix that makes the lobe of a cosine, and how much it reflects.

The matrix is M = [X Y Z] · [[m11, 0, m13], [0, m22, 0], [0, 0, 1]] (Heitz et al. 2016, section 3), Z along the lobe, in
the plane of the view, Y square to that plane. Kept are m11/α, m22/α, m13 and the angle of Z, which change little from
one entry to the next even at a mirror, where entries of the inverse grow beyond all bounds.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

FILE = "ggx.npy"
"""Beside this module: (SIDE, SIDE, 6) float32, by roughness and angle of view: m11/α, m22/α, m13, angle of Z with the
normal (radians), reflected share of white light, and the part of it that is at grazing angles."""

SIDE = 64

SMALLEST_ALPHA = 1e-3
"""GGX alpha of the first row. A rough lobe that is smoother has this one; perfect mirrors are followed by a ray."""

SMALLEST_COSINE = 1e-3
"""Between view and normal, of the last column."""


def alphas() -> NDArray[np.float64]:
    """Roughness (GGX alpha) of the rows; its root grows evenly."""
    smallest = np.sqrt(SMALLEST_ALPHA)
    return np.asarray(np.linspace(smallest, 1, SIDE) ** 2)


def cosines() -> NDArray[np.float64]:
    """Cosine between view and normal of the columns; √(1 − cosine) grows evenly."""
    return np.maximum(1 - np.linspace(0, 1, SIDE) ** 2, SMALLEST_COSINE)


@cache
def table() -> NDArray[np.float32]:
    """FILE, as it ships with gibench."""
    with resources.files(__package__).joinpath(FILE).open("rb") as file:
        values: NDArray[np.float32] = np.load(file, allow_pickle=False)
    return values


@dataclass
class Transform:
    """Lobes that are transformed cosines, a lane each, mi.Float.

    m11, m22, m13: of the matrix. sine, cosine: of the angle of Z with the normal, away from the viewer. share: what a
    lobe of the reflectance 1 reflects of white light, grazing: the integral of lobe · (1 − wh·wi)⁵, both over the part
    of the cosine that is above the surface.
    """

    m11: Any
    m22: Any
    m13: Any
    sine: Any
    cosine: Any
    share: Any
    grazing: Any

    def inverse(self, vector: Any) -> Any:
        """M⁻¹ of a mi.Vector3f in the frame of the surface whose x is towards the viewer."""
        across = self.cosine * vector.x + self.sine * vector.z
        along = self.cosine * vector.z - self.sine * vector.x
        return type(vector)((across - self.m13 * along) / self.m11, vector.y / self.m22, along)


class TransformTable:
    """The table on the device. Needs a vectorised variant."""

    def __init__(self) -> None:
        """Load it."""
        self.values = mi.Float(table().ravel())
        dr.make_opaque(self.values)

    def transform(self, alpha: Any, cosine: Any) -> Transform:
        """Of mi.Float alpha ≥ 0 and cosine between view and normal ≥ 0, interpolated."""
        alpha = dr.clip(alpha, SMALLEST_ALPHA, 1)
        smallest = SMALLEST_ALPHA**0.5
        rough = (dr.sqrt(alpha) - smallest) / (1 - smallest)
        places = [rough * (SIDE - 1), dr.sqrt(1 - dr.clip(cosine, 0, 1)) * (SIDE - 1)]
        first = [mi.UInt32(dr.clip(place, 0, SIDE - 2)) for place in places]
        beyond = [place - mi.Float(at) for place, at in zip(places, first, strict=True)]
        columns = table().shape[-1]
        found = [mi.Float(0) for _ in range(columns)]
        for down in (0, 1):
            for right in (0, 1):
                weight = (beyond[0] if down else 1 - beyond[0]) * (beyond[1] if right else 1 - beyond[1])
                entry = ((first[0] + down) * SIDE + first[1] + right) * columns
                for column in range(columns):
                    found[column] += weight * dr.gather(mi.Float, self.values, entry + column)
        m11, m22, m13, angle, share, grazing = found
        sine, cosine = dr.sincos(angle)
        return Transform(m11 * alpha, m22 * alpha, m13, sine, cosine, share, grazing)
