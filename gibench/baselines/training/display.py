"""Radiance as networks that were trained on photographs see it."""

from __future__ import annotations

import torch
from torch import Tensor

LINEAR_END = 0.0031308
"""Of the sRGB transfer function, below which it is a line (IEC 61966-2-1)."""


def displayed(radiance: Tensor, exposure: float | Tensor) -> Tensor:
    """sRGB(min(exposure · L, 1)) in [0, 1], as the metrics see images; its gradient is finite everywhere."""
    linear = (radiance * exposure).clamp(0, 1)
    curve = 1.055 * linear.clamp(min=LINEAR_END) ** (1 / 2.4) - 0.055
    return torch.where(linear <= LINEAR_END, 12.92 * linear, curve)
