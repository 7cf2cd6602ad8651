"""Differences of pixels, averaged over those that count."""

from __future__ import annotations

import torch
from torch import Tensor


def absolute(output: Tensor, truth: Tensor, mask: Tensor | None = None) -> Tensor:
    """Mean absolute difference. mask: weights ≥ 0 that fit (N, C, H, W), as in `averaged`."""
    return averaged((output - truth).abs(), mask)


def smooth_absolute(
    output: Tensor, truth: Tensor, mask: Tensor | None = None, *, bend: float = 1.0
) -> Tensor:
    """Mean of d²/2·bend where |d| < bend, of |d| − bend/2 elsewhere: L1 without its corner (Girshick 2015)."""
    difference = (output - truth).abs()
    small = difference < bend
    return averaged(torch.where(small, difference.square() * (0.5 / bend), difference - 0.5 * bend), mask)


def averaged(values: Tensor, mask: Tensor | None = None) -> Tensor:
    """Mean over all pixels and channels, each with the weight of its mask; 0 where nothing has any.

    mask: broadcast against values, such as (N, 1, H, W) for (N, C, H, W). What has the weight 0 may be anything, NaN
    included.
    """
    if mask is None:
        return values.mean()
    mask = mask.expand_as(values)
    total = mask.sum()
    kept = torch.where(mask > 0, values, 0) * mask
    return kept.sum() / torch.where(total > 0, total, 1)
