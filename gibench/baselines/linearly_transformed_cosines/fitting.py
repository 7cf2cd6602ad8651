"""The table of linearly transformed cosines, fitted to Mitsuba's own GGX.

Heitz et al. 2016 ("Real-Time Polygonal-Light Shading with Linearly Transformed Cosines"), sections 3 and 4. Their
table is of a height-correlated masking, while Mitsuba's GGX has the separable one of Walter et al. 2007, so it is
fitted anew:

    python -m gibench.baselines.linearly_transformed_cosines.fitting

writes the file beside this module, in some minutes. What is fitted is Mitsuba's `MicrofacetDistribution`, whatever it
evaluates.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from gibench.baselines.linearly_transformed_cosines.table import FILE, SIDE, alphas, cosines
from gibench.rendering.backend import select_variant

SAMPLES = 24
"""Along each side of a stratified set of directions: one from the lobe, one from a broader lobe, one of all."""

BROADER = 4
"""Alpha of the broader lobe over that of the lobe, up to 1."""

EXPONENT = 3
"""Of absolute differences (Heitz et al. 2016, section 4: it keeps the peak)."""


PLAINNESS = 1e-3
"""Weight of a shear and a stretch without need: of a narrow lobe, the shear and the angle of Z do much the same, and
neighbours that divided it differently could not be interpolated."""


@dataclass(frozen=True)
class Lobe:
    """A GGX lobe with the reflectance 1 seen from one direction, whose azimuth is 0, at N directions.

    directions: (N, 3). values: of the lobe, cosine included, sr⁻¹. weights: 1 over density, over how many were drawn.
    schlick: (1 − wh·wi)⁵.
    """

    directions: NDArray[np.float64]
    values: NDArray[np.float64]
    weights: NDArray[np.float64]
    schlick: NDArray[np.float64]

    def mean(self, of: Any) -> Any:
        """∫ of · lobe, of: a number, (N,) or (N, K)."""
        weights = self.values * self.weights
        return weights.sum() * of if np.ndim(of) == 0 else weights @ of

    @property
    def angle(self) -> float:
        """Of the mean direction with the normal, away from the viewer, radians."""
        x, _, z = self.mean(self.directions)
        return float(np.arctan2(-x, z))


def lobes(alpha: float, cosines: NDArray[np.float64]) -> list[Lobe]:
    """Mitsuba's GGX lobes of a roughness, one for each cosine of the view's angle with the normal.

    Needs a vectorised variant.
    """
    grid = (np.arange(SAMPLES) + 0.5) / SAMPLES
    u, v = (np.tile(side.ravel(), len(cosines)) for side in np.meshgrid(grid, grid))
    points = mi.Point2f(u.astype(np.float32), v.astype(np.float32))
    each = np.repeat(cosines, SAMPLES**2)
    wi = mi.Vector3f(*(c.astype(np.float32) for c in (np.sqrt(1 - each**2), 0 * each, each)))
    # Opaque, so that all rows share their kernels.
    narrow, broad = (
        mi.MicrofacetDistribution(mi.MicrofacetType.GGX, dr.opaque(mi.Float, value))
        for value in (alpha, min(BROADER * alpha, 1.0))
    )
    drawn = [mi.reflect(wi, mi.Vector3f(lobe.sample(wi, points)[0])) for lobe in (narrow, broad)]
    drawn.append(mi.warp.square_to_uniform_hemisphere(points))
    columns: list[list[NDArray[Any]]] = []
    for wo in drawn:
        half = dr.normalize(wi + wo)
        above, towards = wo.z > 0, dr.dot(wi, half)
        value = narrow.eval(half) * narrow.G(wi, wo, half) / (4 * wi.z)
        density = (narrow.pdf(wi, half) + broad.pdf(wi, half)) / (4 * dr.maximum(towards, 1e-6))
        density += 0.5 * dr.inv_pi
        arrays = (wo.x, wo.y, wo.z, dr.select(above, value, 0), 3 / density, 1 - towards, mi.Float(above))
        columns.append([np.array(a, dtype=np.float64).reshape(len(cosines), -1) for a in arrays])
    joined = [np.concatenate(parts, axis=1) for parts in zip(*columns, strict=True)]
    found = []
    for x, y, z, value, weight, towards, above in zip(*joined, strict=True):
        kept = above > 0
        directions = np.stack([x, y, z], axis=1)[kept]
        weights = weight[kept] / (3 * SAMPLES**2)
        found.append(Lobe(directions, value[kept], weights, np.clip(towards[kept], 0, 1) ** 5))
    return found


def transformed_cosine(parameters: NDArray[Any], angle: float, directions: NDArray[Any]) -> NDArray[Any]:
    """Density (N,) of a linearly transformed cosine in directions (N, 3), sr⁻¹.

    parameters: m11, m22, m13 of the matrix, in the frame of the mean direction, which is at that angle.
    """
    m11, m22, m13 = parameters
    sine, cosine = np.sin(angle), np.cos(angle)
    across = cosine * directions[:, 0] + sine * directions[:, 2]
    along = -sine * directions[:, 0] + cosine * directions[:, 2]
    x, y, z = (across - m13 * along) / m11, directions[:, 1] / m22, along
    length = x**2 + y**2 + z**2
    return np.maximum(z, 0) / (np.pi * np.abs(m11 * m22) * length**2)


def share_above(parameters: NDArray[Any], angle: float) -> float:
    """Share of a linearly transformed cosine that is above the surface, in [0, 1].

    The half-space above becomes another one under the inverse of the matrix, and a cosine of which a half-space keeps
    the part within 90° of a direction at an angle β keeps (1 + cos β) / 2 of its integral.
    """
    m11, _, m13 = parameters
    up = np.array([m11 * np.sin(angle), np.cos(angle) + m13 * np.sin(angle)])
    return float(0.5 * (1 + up[1] / np.hypot(*up)))


def fitted(lobe: Lobe, alpha: float, start: NDArray[Any]) -> NDArray[Any]:
    """m11/α, m22/α, m13 and angle of the cosine that is most like a lobe. start: the same of a neighbour."""
    total, peak = lobe.mean(1.0), lobe.values.max()
    weight = np.sqrt(lobe.weights * peak / total)

    def unpacked(x: NDArray[Any]) -> tuple[NDArray[Any], float]:
        return np.array([np.exp(x[0]) * alpha, np.exp(x[1]) * alpha, x[2]]), float(x[3])

    def residuals(x: NDArray[Any]) -> NDArray[Any]:
        parameters, angle = unpacked(x)
        scale = total / max(share_above(parameters, angle), 1e-3)
        difference = (scale * transformed_cosine(parameters, angle, lobe.directions) - lobe.values) / peak
        # Squared by the solver: the sum is then of |difference| to the power of EXPONENT.
        rooted = np.sign(difference) * np.abs(difference) ** (EXPONENT / 2)
        return np.append(rooted * weight, PLAINNESS * np.array([x[2], x[0] - x[1]]))

    first = np.array([np.log(start[0]), np.log(start[1]), start[2], start[3]])
    found = least_squares(residuals, first, max_nfev=200).x
    return np.array([np.exp(found[0]), np.exp(found[1]), found[2], found[3]])


def fit() -> NDArray[np.float32]:
    """The table, (SIDE, SIDE, 6), from rough to smooth at normal incidence, from there to grazing angles."""
    values = np.zeros((SIDE, SIDE, 6))
    start = np.array([2.0, 2.0, 0.0, 0.0])
    for row in reversed(range(SIDE)):
        alpha = alphas()[row]
        seen = lobes(alpha, cosines())
        found = start
        for column, lobe in enumerate(seen):
            moved = lobe.angle - seen[column - 1].angle if column else 0.0
            found = fitted(lobe, alpha, found + np.array([0, 0, 0, moved]))
            if column == 0:
                start = found
            above = share_above(found[:3] * [alpha, alpha, 1], found[3])
            values[row, column] = [*found, lobe.mean(1.0) / above, lobe.mean(lobe.schlick) / above]
    return values.astype(np.float32)


def main() -> None:
    """Fit the table and write it beside this module."""
    select_variant()
    np.save(Path(__file__).with_name(FILE), fit(), allow_pickle=False)


if __name__ == "__main__":
    main()
