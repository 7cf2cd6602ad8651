"""Directions on a rectangle of texels, and back.

Every mapping takes directions to continuous texel coordinates: (0, 0) is the outer corner of the first texel, x grows
with the column, y with the row. Neighbours across the edge of the map are the texels that touch there on the sphere.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

POLE = 1e-12
"""Squared distance from the axis, of a direction whose largest component is 1, below which it is the pole itself and
any azimuth will do."""

SMALLEST = 1.2e-38
"""The smallest normal float32."""


def _scaled(direction: Any) -> Any:
    """A direction of any length with a largest component of 1; 0, which leads from a probe to itself, stays 0."""
    largest = dr.maximum(dr.abs(direction.x), dr.maximum(dr.abs(direction.y), dr.abs(direction.z)))
    return direction / dr.maximum(largest, SMALLEST)


@dataclass(frozen=True)
class LatLong:
    """Equirectangular: row 0 looks up (+Z), the last row down; the middle column along +X, left of it is +Y.

    Seen from inside, the map is not mirrored; its left and right edge meet at −X. width, height: in texels.
    """

    width: int
    height: int

    name = "lat-long"

    def coordinates(self, direction: Any) -> Any:
        """mi.Point2f texel coordinates in [0, width] × [0, height] of a direction of any length; 0 is the pole."""
        d = _scaled(direction)
        flat = dr.square(d.x) + dr.square(d.y)
        azimuth = dr.select(flat > POLE, dr.atan2(d.y, d.x), 0)
        # The polar angle from both parts: acos alone is off by 3e-4 next to a pole.
        polar = dr.atan2(dr.sqrt(flat), d.z)
        return mi.Point2f(
            (0.5 - azimuth * dr.inv_two_pi) * dr.opaque(mi.Float, self.width),
            polar * dr.inv_pi * dr.opaque(mi.Float, self.height),
        )

    def direction(self, coordinates: Any) -> Any:
        """Unit mi.Vector3f of texel coordinates."""
        azimuth = (0.5 - coordinates.x / dr.opaque(mi.Float, self.width)) * dr.two_pi
        polar = coordinates.y / dr.opaque(mi.Float, self.height) * dr.pi
        sine, cosine = dr.sincos(polar)
        sine_azimuth, cosine_azimuth = dr.sincos(azimuth)
        return mi.Vector3f(sine * cosine_azimuth, sine * sine_azimuth, cosine)

    def clamped(self, coordinates: Any) -> Any:
        """Coordinates of the map: x around the sphere, y no further than a pole."""
        width, height = dr.opaque(mi.Float, self.width), dr.opaque(mi.Float, self.height)
        x = coordinates.x - width * dr.floor(coordinates.x / width)
        return mi.Point2f(dr.minimum(x, width), dr.clip(coordinates.y, 0, height))

    def wrapped(self, column: Any, row: Any) -> tuple[Any, Any]:
        """The texel that column and row (mi.Int32, at most one outside) stand for: over a pole, half way around."""
        width, height = dr.opaque(mi.Int32, self.width), dr.opaque(mi.Int32, self.height)
        over = (row < 0) | (row >= height)
        column = dr.select(over, column + width // 2, column)
        column = dr.select(column < 0, column + width, column)
        column = dr.select(column >= width, column - width, column)
        return column, dr.clip(row, 0, height - 1)

    def surrounded(self, image: NDArray[Any], margin: int) -> NDArray[Any]:
        """An image (height, width, C) with `margin` columns more at either side, those of the other end."""
        return np.concatenate([image[:, -margin:], image, image[:, :margin]], axis=1)


@dataclass(frozen=True)
class Octahedral:
    """The octahedron unfolded (Cigolle et al. 2014, "Survey of efficient representations for independent unit
    vectors"): the middle of the map looks up (+Z), its corners down, x grows along +X and y along +Y.

    width, height: in texels, equal for square texels.
    """

    width: int
    height: int

    name = "octahedral"

    def coordinates(self, direction: Any) -> Any:
        """mi.Point2f texel coordinates in [0, width] × [0, height] of a direction of any length; 0 is +Z."""
        d = _scaled(direction)
        d /= dr.maximum(dr.abs(d.x) + dr.abs(d.y) + dr.abs(d.z), SMALLEST)
        fold = mi.Point2f(
            dr.copysign(1 - dr.abs(d.y), d.x),
            dr.copysign(1 - dr.abs(d.x), d.y),
        )
        flat = dr.select(d.z >= 0, mi.Point2f(d.x, d.y), fold)
        return (flat * 0.5 + 0.5) * self._size

    def direction(self, coordinates: Any) -> Any:
        """Unit mi.Vector3f of texel coordinates."""
        flat = coordinates / self._size * 2 - 1
        z = 1 - dr.abs(flat.x) - dr.abs(flat.y)
        over = dr.maximum(-z, 0)
        return dr.normalize(
            mi.Vector3f(flat.x - dr.copysign(over, flat.x), flat.y - dr.copysign(over, flat.y), z)
        )

    @property
    def _size(self) -> Any:
        return mi.Vector2f(dr.opaque(mi.Float, self.width), dr.opaque(mi.Float, self.height))

    def clamped(self, coordinates: Any) -> Any:
        """Coordinates of the map: no further than its edges."""
        return dr.clip(coordinates, 0, self._size)

    def wrapped(self, column: Any, row: Any) -> tuple[Any, Any]:
        """The texel that column and row (mi.Int32, at most one outside) stand for: an edge is folded at its middle."""
        width, height = dr.opaque(mi.Int32, self.width), dr.opaque(mi.Int32, self.height)
        aside = (column < 0) | (column >= width)
        across = (row < 0) | (row >= height)
        folded_row = dr.select(aside, height - 1 - row, row)
        folded_column = dr.select(across, width - 1 - column, column)
        return dr.clip(folded_column, 0, width - 1), dr.clip(folded_row, 0, height - 1)

    def surrounded(self, image: NDArray[Any], margin: int) -> NDArray[Any]:
        """An image (height, width, C) with `margin` texels more all around, those that touch there on the sphere."""
        wide = np.concatenate([image[::-1, margin - 1 :: -1], image, image[::-1, : -margin - 1 : -1]], axis=1)
        return np.concatenate([wide[margin - 1 :: -1, ::-1], wide, wide[: -margin - 1 : -1, ::-1]], axis=0)


ADAPTIVE = "adaptive"
"""Equirectangular, with the texels of each probe moved to where they are needed (`adaptive`)."""

MAPPINGS: dict[str, type[LatLong] | type[Octahedral]] = {
    LatLong.name: LatLong,
    Octahedral.name: Octahedral,
    ADAPTIVE: LatLong,
}
