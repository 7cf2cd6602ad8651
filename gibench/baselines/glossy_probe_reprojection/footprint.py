"""Footprint in the image of a point that a rough surface reflects.

Rodriguez et al. 2020, section 6.1: a camera looks straight at a plane which reflects a point on the camera's axis. The
GGX lobe, evaluated at every place of the image, is fitted with a Gaussian. All of it depends on the two distances by
their ratio alone, so the table has two dimensions where the paper's has three, and holds for scenes of any size.

The fit is the one of least squares, height and width free. The covariance of the lobe itself, which the paper takes, is
that of its tails: it grows without end with the field of view, and a Gaussian of that width, up to six times too wide,
does not turn the lobe of half the roughness into the whole one. The best fit is the fixed point of a covariance that
the Gaussian itself weights, as widths of galaxies are measured (Bernstein and Jarvis 2002, Shapes and Shears, Stars and
Smears: adaptive weights).

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
"""Tangent of half the field of view in which the lobe is seen, for those that are wider than an image."""

RINGS = 1024
"""Radii at which a lobe is evaluated."""

STEPS = 40
"""Towards the fixed point. Each halves what is missing, and the first guess is within a factor of 3."""

REDUCED = 0.5
"""Roughness of the materials when probes are rendered, over their own (section 6.1)."""


def lobe(alpha: Any, share: Any, radius: Any) -> Any:
    """Reflection of a small lamp at the point by places of the image, by the GGX lobe without Fresnel's factor.

    The cosine and the lamp's distance are part of it: without them lobes swell where the point is near. Relative to the
    lamp's light at the centre. alpha: roughness. share: d_r / (d_c + d_r), of the distances from the plane to the point
    and to the camera, in (0, 1]. radius: tangent of the angle to the image's centre. Walter et al. 2007, equations 20,
    33 and 34.
    """
    to_camera = np.arctan(radius)
    to_point = np.arctan(radius * (1 - share) / share)
    half = np.cos(0.5 * (to_camera + to_point))  # both lean to the same side
    density = alpha**2 / (np.pi * (half**2 * (alpha**2 - 1) + 1) ** 2)

    def seen(angle):
        return 2 / (1 + np.sqrt(1 + alpha**2 * np.tan(angle) ** 2))

    bsdf = density * seen(to_camera) * seen(to_point) / (4 * np.cos(to_camera) * np.cos(to_point))
    return bsdf * np.cos(to_point) ** 3


def deviation(alpha: Any, share: Any) -> NDArray[np.float64]:
    """Standard deviation of the Gaussian that fits the lobe best, along any line through the centre: tangents.

    alpha, share: as for `lobe`, above 0. Arrays broadcast.
    """
    alpha, share = np.broadcast_arrays(
        np.asarray(alpha, float)[..., None], np.asarray(share, float)[..., None]
    )
    # In units of alpha · share; rings in equal steps of the logarithm, from well inside of the lobe to where the
    # Gaussian is 0 or the field ends.
    radius = np.geomspace(1e-3, np.minimum(10, FIELD / (alpha * share))[..., 0], RINGS, axis=-1)
    # One radius for the ring, one for the step.
    weight = lobe(alpha, share, alpha * share * radius) * radius**2
    squared = np.ones(alpha.shape)
    for _ in range(STEPS):
        seen = weight * np.exp(-0.5 * radius**2 / squared)
        squared = (seen * radius**2).sum(axis=-1, keepdims=True) / seen.sum(axis=-1, keepdims=True)
    found: NDArray[np.float64] = (np.sqrt(squared) * alpha * share)[..., 0]
    return found


@cache
def table() -> NDArray[np.float32]:
    """(SIZE, SIZE): deviation over alpha · share, by roughness and share: 1.3, and less towards wide lobes."""
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
