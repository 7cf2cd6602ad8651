"""Structural similarity (Wang et al. 2004) as a loss."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import conv2d

SIDE, DEVIATION = 11, 1.5
"""Pixels along a side of the window, and of its Gaussian."""

K1, K2 = 0.01, 0.03


def dissimilarity(output: Tensor, truth: Tensor, *, span: float = 1.0) -> Tensor:
    """1 − SSIM of images (N, C, H, W), in [0, 2]: the mean over the places that a whole window fits.

    span: of the values. Images smaller than the window have a smaller one.
    """
    side = min(SIDE, *(length - (length + 1) % 2 for length in output.shape[-2:]))
    ticks = torch.arange(side, device=output.device, dtype=output.dtype) - side // 2
    weights = torch.exp(-0.5 * (ticks / DEVIATION).square())
    weights = weights / weights.sum()
    channels = output.shape[1]

    def blurred(image: Tensor) -> Tensor:
        across = weights.expand(channels, 1, 1, side)
        return conv2d(conv2d(image, across, groups=channels), across.transpose(2, 3), groups=channels)

    mean, true_mean = blurred(output), blurred(truth)
    variance = (blurred(output * output) - mean.square()).clamp(min=0)
    true_variance = (blurred(truth * truth) - true_mean.square()).clamp(min=0)
    covariance = blurred(output * truth) - mean * true_mean
    c1, c2 = (K1 * span) ** 2, (K2 * span) ** 2
    same = (2 * mean * true_mean + c1) * (2 * covariance + c2)
    same = same / ((mean.square() + true_mean.square() + c1) * (variance + true_variance + c2))
    return 1 - same.mean()
