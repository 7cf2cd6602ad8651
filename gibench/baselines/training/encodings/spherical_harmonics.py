"""Real spherical harmonics of directions."""

from __future__ import annotations

import math

import torch
from torch import Tensor


def spherical_harmonics(direction: Tensor, degree: int) -> Tensor:
    """(…, 3) unit vectors to (…, (degree + 1)²), Y of l and m at l² + l + m, orthonormal over the sphere.

    With the Condon-Shortley phase, as in Sloan 2008 and most renderers: Y₁ is √(3/4π) · (−y, z, −x). Polynomials in x,
    y, z by recurrence (Sloan 2013), so there is no pole and any degree.
    """
    x, y, z = direction.unbind(-1)
    found: list[Tensor] = [z] * (degree + 1) ** 2
    cosine, sine = torch.ones_like(z), torch.zeros_like(z)  # of mφ, times sinᵐθ
    diagonal = math.sqrt(1 / (4 * math.pi))
    for m in range(degree + 1):
        if m:
            cosine, sine = x * cosine - y * sine, x * sine + y * cosine
            diagonal *= -math.sqrt((2 * m + 1) / (2 * m))
        before, now = torch.zeros_like(z), torch.full_like(z, diagonal)
        for band in range(m, degree + 1):
            if band > m:
                a = math.sqrt((4 * band**2 - 1) / (band**2 - m**2))
                b = math.sqrt(((band - 1) ** 2 - m**2) / (4 * (band - 1) ** 2 - 1))
                before, now = now, a * (z * now - b * before)
            middle = band**2 + band
            found[middle + m] = math.sqrt(2) * now * cosine if m else now
            if m:
                found[middle - m] = math.sqrt(2) * now * sine
    return torch.stack(found, dim=-1)
