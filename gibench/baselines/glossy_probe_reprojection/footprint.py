"""How widely a rough surface spreads a point that it reflects over the image.

Rodriguez et al. 2020, section 6.1: a camera looks straight at a plane which reflects a point on the camera's axis. The
GGX lobe, evaluated at every place of the image, is fitted with a Gaussian by its covariance. All of it depends on the
two distances by their ratio alone, so the table has two dimensions where the paper's has three, and holds for scenes of
any size.

The image here is the plane at unit distance before the camera: coordinates are tangents, times a focal length pixels.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

ROUGHEST = 0.5
"""GGX alpha at the end of the table (section 6.1); beyond, the ratio to alpha stays as it is there."""

SMOOTHEST = 1e-3
"""At its other end."""

SIZE = 32
"""Bins along roughness and along the ratio of the distances (section 6.1)."""

POWER = 3.0
"""Of the spacing: bins lie denser towards smooth surfaces and near reflections. The paper gives no exponent."""

FIELD = 1.0
"""Tangent of half the field of view in which the lobe is seen. Its tails are so long that the covariance grows without
end as the field does; the paper says that it is fixed, and not how wide."""

RINGS = 4096
"""Radii at which a lobe is evaluated."""

REDUCED = 0.5
"""Roughness of the materials when probes are rendered, over their own (section 6.1)."""


def lobe(alpha: Any, share: Any, radius: Any) -> Any:
    """GGX lobe at places of the image, without Fresnel's factor.

    alpha: roughness. share: d_r / (d_c + d_r), of the distances from the plane to the point and to the camera, in
    (0, 1]. radius: tangent of the angle to the image's centre. Walter et al. 2007, equations 20, 33 and 34.
    """
    to_camera = np.arctan(radius)
    to_point = np.arctan(radius * (1 - share) / share)
    half = np.cos(0.5 * (to_camera + to_point))  # both lean to the same side
    density = alpha**2 / (np.pi * (half**2 * (alpha**2 - 1) + 1) ** 2)

    def seen(angle):
        return 2 / (1 + np.sqrt(1 + alpha**2 * np.tan(angle) ** 2))

    cosines = np.cos(to_camera) * np.cos(to_point)
    return density * seen(to_camera) * seen(to_point) / (4 * cosines)


def deviation(alpha: Any, share: Any) -> NDArray[np.float64]:
    """Standard deviation of the fitted Gaussian along any line through the centre: tangents. Arrays broadcast."""
    alpha, share = np.broadcast_arrays(
        np.asarray(alpha, float)[..., None], np.asarray(share, float)[..., None]
    )
    # Rings that lie as dense as the lobe asks for: equal steps of the logarithm, from well inside of it.
    first = np.minimum(1e-3 * alpha * share, 1e-3)
    steps = np.linspace(0, 1, RINGS)
    radius = first * (FIELD / first) ** steps
    weight = lobe(alpha, share, radius) * radius**2  # one radius for the ring, one for the step
    squared = np.trapezoid(weight * radius**2, steps, axis=-1) / np.trapezoid(weight, steps, axis=-1)
    return np.sqrt(0.5 * squared)


@cache
def table() -> NDArray[np.float32]:
    """(SIZE, SIZE): deviation over alpha · share, by roughness and share. It changes slowly, whatever these are."""
    steps = np.linspace(0, 1, SIZE) ** POWER
    alpha = SMOOTHEST + (ROUGHEST - SMOOTHEST) * steps
    share = np.maximum(steps, 1e-6)
    return (deviation(alpha[:, None], share) / (alpha[:, None] * share)).astype(np.float32)


class Footprint:
    """The table on the device. arrays: what a `Replay` must hold."""

    def __init__(self) -> None:
        """Under the current variant."""
        self.arrays = {"table": mi.Float(table().ravel())}
        dr.make_opaque(self.arrays)

    def deviation(self, roughness: Any, share: Any) -> Any:
        """As the function, interpolated: mi.Float. roughness: GGX alpha ≥ 0. share: in [0, 1]."""
        alpha = dr.clip(roughness, SMOOTHEST, ROUGHEST)
        row = SIZE_STEPS * _root((alpha - SMOOTHEST) / (ROUGHEST - SMOOTHEST))
        column = SIZE_STEPS * _root(dr.clip(share, 0, 1))
        top, left = (dr.minimum(mi.UInt32(at), SIZE - 2) for at in (row, column))
        down, right = row - mi.Float(top), column - mi.Float(left)

        def at(i, j):
            return dr.gather(mi.Float, self.arrays["table"], (top + i) * SIZE + left + j)

        ratio = dr.lerp(dr.lerp(at(0, 0), at(0, 1), right), dr.lerp(at(1, 0), at(1, 1), right), down)
        return ratio * roughness * share


SIZE_STEPS = SIZE - 1.0


def _root(value: Any) -> Any:
    return dr.power(dr.maximum(value, 0), 1 / POWER)


@dataclass
class Covariance:
    """Symmetric 2 × 2 matrices, mi.Float each: x along the rows of an image, y down its columns."""

    xx: Any
    xy: Any
    yy: Any

    def __sub__(self, other: Covariance) -> Covariance:
        """Equation 3."""
        return Covariance(self.xx - other.xx, self.xy - other.xy, self.yy - other.yy)

    def principal(self) -> tuple[Any, Any, Any]:
        """Variances along the first and second principal direction, negative ones as 0, and the unit first direction.

        The first variance is the larger one. The second direction is the first, turned by a right angle.
        """
        mean, half = 0.5 * (self.xx + self.yy), 0.5 * (self.xx - self.yy)
        root = dr.sqrt(dr.square(half) + dr.square(self.xy))
        angle = dr.select(root > 0, 0.5 * dr.atan2(self.xy, half), 0)
        sine, cosine = dr.sincos(angle)
        return dr.maximum(mean + root, 0), dr.maximum(mean - root, 0), mi.Vector2f(cosine, sine)


def slanted(variance: Any, slant: Any, along: Any, across: Any) -> Covariance:
    """The covariance of a lobe seen at an angle.

    variance: as seen straight. slant: unit mi.Vector2f, the normal projected into the image. along, across: factors of
    the variance along the slant and across it.
    """
    along, across = variance * along, variance * across
    return Covariance(
        along * dr.square(slant.x) + across * dr.square(slant.y),
        (along - across) * slant.x * slant.y,
        along * dr.square(slant.y) + across * dr.square(slant.x),
    )
