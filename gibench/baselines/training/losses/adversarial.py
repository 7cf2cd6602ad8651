"""A discriminator of made and true images, patch by patch (Isola et al. 2017, PatchGAN)."""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import softplus

from gibench.baselines.training.errors import TrainingError

CHANNELS = (64, 128, 256, 512)
"""Of the layers: each output then sees 70 × 70 pixels."""

SLOPE = 0.2
"""Of Leaky ReLU below zero."""

SMALLEST = 24
"""Pixels along a side: below, a layer has a single pixel, which has no spread to be normalised by."""


class PatchGan(nn.Module):
    """4 × 4 convolutions with strides 2, 2, 2, 1, 1 to one number a patch: the logit of its being true.

    Instances are normalised, which is what the paper's batches of one come to, but for the first and last layer.
    """

    def __init__(self, inputs: int) -> None:
        """inputs: channels of the condition and the image together; 2.77 M parameters where they are 6."""
        super().__init__()
        layers: list[nn.Module] = [nn.Conv2d(inputs, CHANNELS[0], 4, 2, padding=1), nn.LeakyReLU(SLOPE)]
        for (before, after), stride in zip(pairwise(CHANNELS), (2, 2, 1), strict=True):
            layers += [
                nn.Conv2d(before, after, 4, stride, padding=1, bias=False),
                nn.InstanceNorm2d(after, affine=True),
                nn.LeakyReLU(SLOPE),
            ]
        layers.append(nn.Conv2d(CHANNELS[-1], 1, 4, 1, padding=1))
        self.layers = nn.Sequential(*layers)

    def forward(self, condition: Tensor, image: Tensor) -> Tensor:
        """Logits (N, 1, h, w) of images (N, C, H, W) under what they were made from."""
        height, width = image.shape[-2:]
        if min(height, width) < SMALLEST:
            raise TrainingError(
                f"a PatchGAN takes {SMALLEST} pixels along each side at least, not {width} × {height}"
            )
        logits: Tensor = self.layers(torch.cat([condition, image], dim=1))
        return logits


def judging(of_true: Tensor, of_made: Tensor) -> Tensor:
    """Mean cross entropy of the discriminator's logits (Goodfellow et al. 2014); ln 2 where it cannot tell."""
    return 0.5 * (softplus(-of_true).mean() + softplus(of_made).mean())


def fooling(of_made: Tensor) -> Tensor:
    """Loss of the generator: that its images are taken for true ones."""
    return softplus(-of_made).mean()
