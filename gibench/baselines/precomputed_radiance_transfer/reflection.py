"""What a surface reflects of light in spherical harmonics: by the cosine and by a GGX lobe, as products of degrees.

Both are kernels that are round about a direction, so convolving with them multiplies each degree by a number
(Ramamoorthi and Hanrahan 2001, section 4; Sloan et al. 2002, section 6.2).
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import eval_legendre
from torch import Tensor

from gibench.baselines.linearly_transformed_cosines.table import SIDE, SMALLEST_ALPHA, table

ROUGHS = 65
"""Roots of alpha in [0, 1] at which lobes are tabulated."""

QUANTILES = 4096
"""Of the half vectors of a lobe."""


def cosine_kernel(degree: int) -> NDArray[np.float64]:
    """(degree + 1,) of the clamped cosine: ∫ max(n·ω, 0) L(ω) dω is Σ kernel_l · L_lm · Y_lm(n).

    Ramamoorthi and Hanrahan 2001, equation 19: π, 2π/3, π/4, 0, −π/24, 0 …
    """
    found = np.zeros(degree + 1)
    for band in range(degree + 1):
        if band == 1:
            found[band] = 2 * math.pi / 3
        elif band % 2 == 0:
            half = band // 2
            found[band] = (
                2 * math.pi * (-1) ** (half - 1) / ((band + 2) * (band - 1)) * math.comb(band, half) / 2**band
            )
    return found


@cache
def lobe_kernels(degree: int) -> NDArray[np.float32]:
    """(ROUGHS, degree + 1) of GGX lobes of reflected directions, each of integral 1, by the root of alpha.

    Of the lobe at normal incidence, which is round about the mirrored direction: half vectors by their distribution
    (Walter et al. 2007, equation 35), as far as what they reflect is above the surface.
    """
    alpha = np.linspace(0, 1, ROUGHS)[:, None] ** 2
    # Quantiles of tan² of the angle of half vectors, up to 45°.
    share = (np.arange(QUANTILES) + 0.5) / QUANTILES / (1 + alpha**2)
    tangent2 = alpha**2 * share / (1 - share)
    cosine = (1 - tangent2) / (1 + tangent2)
    return np.stack([eval_legendre(band, cosine).mean(axis=1) for band in range(degree + 1)], axis=1).astype(
        np.float32
    )


def lobe_kernel(alpha: Tensor, degree: int) -> Tensor:
    """(N, degree + 1) of lobes of roughness alpha (N,), interpolated."""
    kernels = torch.from_numpy(lobe_kernels(degree)).to(alpha.device)
    place = alpha.clamp(0, 1).sqrt() * (ROUGHS - 1)
    first = place.long().clamp(max=ROUGHS - 2)
    return torch.lerp(kernels[first], kernels[first + 1], (place - first)[:, None])


def reflectance(specular: Tensor, alpha: Tensor, cosine: Tensor) -> Tensor:
    """(N, 3) share of even light that a GGX lobe reflects towards the viewer.

    specular: (N, 3), reflectance at normal incidence; 0 where there is no lobe. alpha, cosine: (N,), roughness, and
    cosine between view and normal. Schlick's approximation of Fresnel's equations, with the integrals of Mitsuba's GGX
    that linearly transformed cosines are fitted to.
    """
    smallest = math.sqrt(SMALLEST_ALPHA)
    rough = (alpha.clamp(SMALLEST_ALPHA, 1).sqrt() - smallest) / (1 - smallest)
    places = torch.stack([(1 - cosine.clamp(0, 1)).sqrt(), rough], dim=-1) * 2 - 1
    values = torch.from_numpy(table()[..., 4:6]).to(alpha.device).movedim(-1, 0)
    assert values.shape == (2, SIDE, SIDE)
    share, grazing = torch.nn.functional.grid_sample(
        values[None], places[None, None], align_corners=True, padding_mode="border"
    )[0, :, 0]
    found = specular * share[:, None] + (1 - specular) * grazing[:, None]
    return torch.where((specular > 0).any(dim=1, keepdim=True), found, 0).clamp(max=1)
