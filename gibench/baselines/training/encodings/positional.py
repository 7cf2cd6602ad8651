"""Sines and cosines of rising frequency (Mildenhall et al. 2020)."""

from __future__ import annotations

import math

import torch
from torch import Tensor


def positional(values: Tensor, levels: int = 10, *, dim: int = -1) -> Tensor:
    """sin and cos of 2^(l−1) π x for l = 0 … levels − 1, which repeat themselves beyond [−2, 2].

    Of C numbers along `dim`, 2 · levels · C in the order (sin, cos), level, number. The lowest frequency tells the two
    ends of [−1, 1] apart. Neural Global Illumination has 10 levels.
    """
    dim = dim % values.dim()
    exponents = torch.arange(levels, device=values.device, dtype=values.dtype) - 1
    frequencies = (math.pi * 2**exponents).reshape(-1, *(1 for _ in range(values.dim() - dim)))
    angles = (values.unsqueeze(dim) * frequencies).flatten(dim, dim + 1)
    return torch.cat([angles.sin(), angles.cos()], dim=dim)
