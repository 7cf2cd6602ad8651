"""Answers that are known: closed forms, quadratures in float64, and the statistics that a comparison rests on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, t

from gibench.rendering.render import RenderedFrame
from gibench.stress.registry import Check

Float64 = NDArray[np.float64]

CHANCE = 1e-5
"""Probability that a right estimate is called wrong, of one check whatever its number of pixels."""

ROUNDING = 2.0**-24 * 512
"""Relative rounding of a path in float32: at most 512 operations that round alike."""

RAY_OFFSET = 2.0**-24 * 1500
"""Mitsuba starts a ray this share of 1 m + |p|∞ off its surface, along the normal, so that it does not hit it again."""

WEAKEST = 0.05
"""Largest relative bound that still says something; a check that statistics leave wider than this is no check."""


class UndecidedError(AssertionError):
    """An estimate too noisy to tell right from wrong: the case needs more samples."""


def mean_check(
    part: str, what: str, frame: RenderedFrame, answer: float, source: str, *, known: str = ""
) -> Check:
    """Compare the mean of a grey frame's color, all of whose pixels have the same answer, with it.

    frame: with color and color_se, of at least 2000 samples in all. answer: > 0. The bound is what noise may do with
    a chance of CHANCE, and rounding.
    """
    color, error = frame.arrays["color"].astype(np.float64), frame.arrays["color_se"].astype(np.float64)
    # The components of grey light share their samples, so their errors are one error.
    spread = np.sqrt(np.square(error.mean(axis=-1)).sum()) / error[..., 0].size
    bound = norm.isf(CHANCE / 2) * spread / answer + ROUNDING
    if bound > WEAKEST:
        raise UndecidedError(f"{what}: noise leaves {bound:.1%} of the answer open")
    return Check(part, what, abs(float(color.mean()) / answer - 1), float(bound), source, known)


def worst(checks: list[Check]) -> Check:
    """The check that uses up most of its bound."""
    return max(checks, key=lambda check: check.error / check.bound if check.bound else np.inf)


def largest_z(count: int, freedom: float = np.inf) -> float:
    """Bound on the largest of `count` right z-scores, exceeded with a probability of CHANCE (Bonferroni).

    freedom: degrees of freedom, where standard errors are estimated.
    """
    return float(
        t.isf(CHANCE / (2 * count), freedom) if np.isfinite(freedom) else norm.isf(CHANCE / (2 * count))
    )


def not_finite(arrays: dict[str, NDArray[Any]]) -> int:
    """Number of values of a frame that are NaN or infinite."""
    return int(sum((~np.isfinite(values)).sum() for values in arrays.values()))


def parallel_rectangle(half_x: float, half_y: float, height: float, x: float = 0.0, y: float = 0.0) -> float:
    """Form factor from a point to a parallel rectangle above it (Howell's catalogue, B-3, corner by corner).

    half_x, half_y: of its sides; x, y: of its centre beside the point; metres.
    """

    def corner(u: float, v: float) -> float:
        a, b = np.hypot(u, height), np.hypot(v, height)
        return float(u / a * np.arctan(v / a) + v / b * np.arctan(u / b)) / (2 * np.pi)

    x0, x1, y0, y1 = x - half_x, x + half_x, y - half_y, y + half_y
    return corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)


def perpendicular_rectangle(half_width: float, length: float, gap: float) -> float:
    """Form factor from a point of a wall to a rectangle that stands out from it.

    The rectangle's plane is perpendicular to the wall, `gap` above the point; it is 2·half_width wide along the wall
    and reaches `length` into the room (Howell's catalogue, B-5, twice).
    """
    x, y = half_width / length, gap / length
    root = np.sqrt(1 + y * y)
    return float(2 * (np.arctan2(x, y) - y / root * np.arctan(x / root)) / (2 * np.pi))


def fresnel(cosine: Any, index: float) -> Any:
    """Reflectance of a smooth dielectric for unpolarized light from outside; cosine: in [0, 1], of any shape."""
    inside = np.sqrt(1 - (1 - cosine**2) / index**2)
    parallel = (index * cosine - inside) / (index * cosine + inside)
    across = (cosine - index * inside) / (cosine + index * inside)
    return 0.5 * (parallel**2 + across**2)


def ggx_albedo(alpha: float, angle: float, *, index: float | None = None, steps: int = 1500) -> float:
    """Share of uniform light that rough facets reflect towards `angle` (radians from the normal) in one scattering.

    GGX with the separable Smith term, integrated in float64 over the slopes of the facets (Walter et al. 2007,
    sections 5.1 and 5.3): ∫ P₂₂(m) · F · max(0, ω_o·m / m_z) · G₁(ω_o) · G₁(ω_i) dm / cos θ_o. index: of the
    dielectric that gives the Fresnel factor; without it the facets are perfect mirrors.
    """
    u = (np.arange(steps) + 0.5) / steps
    azimuth = 2 * np.pi * u[None, :]
    # Slopes are drawn from P₂₂ itself; the tail is stretched, since there is much of it at grazing angles.
    share, density = 1 - (1 - u[:, None]) ** 3, 3 * (1 - u[:, None]) ** 2
    slope = alpha * np.sqrt(share / (1 - share))
    cosine, upright = np.cos(angle), 1 / np.sqrt(1 + slope**2)
    along = np.maximum(cosine - slope * np.cos(azimuth) * np.sin(angle), 0)  # ω_o·m / m_z
    reflected = 2 * along * upright**2 - cosine
    above = reflected > 0

    def masking(z: Any) -> Any:
        return 2 / (1 + np.sqrt(1 + alpha**2 * (1 / z**2 - 1)))

    value = density * along * masking(cosine) * masking(np.where(above, np.minimum(reflected, 1), 1)) / cosine
    if index is not None:
        value = value * fresnel(np.minimum(along * upright, 1), index)
    return float(np.where(above, value, 0).mean())
