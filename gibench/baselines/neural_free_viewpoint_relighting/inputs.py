"""What the network is given of a surface (Raghavan et al. 2023, sections 4 and 5)."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from gibench.baselines.relighting.surfaces import MATERIAL
from gibench.baselines.training.encodings.spherical_harmonics import spherical_harmonics

ROUGHNESS_SCALE = 25.0
"""Of the logarithm that roughness is mapped by, so that near-mirrors are told apart (section 5)."""


def coded(material: Tensor, degree: int | None) -> Tensor:
    """(…, 13 + (degree + 1)²) as the network takes it, each number of order one.

    Directions and roughness come to [0, 1], reflectances to [−1, 1]; spherical harmonics of the reflected direction up
    to a degree stand behind them, none for None.
    """
    normal, reflected, roughness, diffuse, specular = material.split(list(MATERIAL.values()), dim=-1)
    parts = [
        (normal + 1) / 2,
        (reflected + 1) / 2,
        torch.log1p(ROUGHNESS_SCALE * roughness.clamp(min=0)) / math.log1p(ROUGHNESS_SCALE),
        2 * diffuse - 1,
        2 * specular - 1,
    ]
    if degree is not None:
        parts.append(spherical_harmonics(reflected, degree))
    return torch.cat(parts, dim=-1)
