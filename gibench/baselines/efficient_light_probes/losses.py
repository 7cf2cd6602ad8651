"""Losses of the reconstruction network (Guo et al. 2022, equations 6 to 9)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from gibench.baselines.training.display import displayed

ABSOLUTE, PERCEPTUAL, TEMPORAL = 0.8, 0.03, 0.15
"""Weights of the three losses, λ (section 4.4)."""


def perceptual(network: nn.Module, output: Tensor, truth: Tensor, exposure: float) -> Tensor:
    """LPIPS of linear radiance (N, 3, H, W), tone-mapped first, since its network has seen photographs (equation 7).

    network: from `gibench.metrics.lpips_network.build_network("vgg")`.
    """
    distance: Tensor = network(2 * displayed(output, exposure) - 1, 2 * displayed(truth, exposure) - 1)
    return distance.mean()


def warped(image: Tensor, motion: Tensor) -> Tensor:
    """An earlier image (N, C, H, W) where its content is now; motion (N, 2, H, W): pixels to where it was then.

    Bilinear; what lies beyond an edge is what lies at it. Of gathers, since torch's own sampling of a grid has no
    gradient on a GPU that is the same every time.
    """
    height, width = image.shape[-2:]
    x, y = (place - 0.5 for place in _places(motion))
    left, top = x.floor(), y.floor()
    flat = image.flatten(2)
    total = torch.zeros_like(image)
    for i in (0, 1):
        for j in (0, 1):
            column, row = (left + i).clamp(0, width - 1).long(), (top + j).clamp(0, height - 1).long()
            index = (row * width + column).flatten(2).expand(-1, image.shape[1], -1)
            weight = (1 - (x - left - i).abs()) * (1 - (y - top - j).abs())
            total = total + weight * flat.gather(2, index).view_as(image)
    return total


def _places(motion: Tensor) -> tuple[Tensor, Tensor]:
    """Former positions of pixel centres, (N, 1, H, W) each, in pixels from the outer corner of the first one."""
    height, width = motion.shape[-2:]
    columns = torch.arange(width, dtype=motion.dtype, device=motion.device) + 0.5
    rows = torch.arange(height, dtype=motion.dtype, device=motion.device)[:, None] + 0.5
    return motion[:, :1] + columns, motion[:, 1:] + rows


def seen_before(motion: Tensor, valid: Tensor) -> Tensor:
    """Of the pixels that the earlier frame saw (valid, (N, 1, H, W)) those whose motion stays within the crop."""
    height, width = motion.shape[-2:]
    x, y = _places(motion)
    return valid * ((x >= 0) & (x <= width) & (y >= 0) & (y <= height))


def temporal(output: Tensor, before: Tensor, motion: Tensor, valid: Tensor) -> Tensor:
    """Mean absolute difference to the earlier output, warped, where the earlier frame saw the same (equation 8)."""
    mask = seen_before(motion, valid)
    difference = (output - warped(before, motion)).abs() * mask
    return difference.sum() / (output.shape[1] * mask.sum()).clamp(min=1)
