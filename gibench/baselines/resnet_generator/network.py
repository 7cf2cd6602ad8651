"""A generator of residual blocks (Johnson et al. 2016; as in Zhu et al. 2017, appendix 7.2).

A 7 × 7 convolution, two that halve the image, nine residual blocks, two that double it, and a 7 × 7 convolution, with
borders mirrored and instances normalised. The last layer has no activation: it predicts the code of a radiance.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from gibench.baselines.training.padding import padded

WIDTH, BLOCKS = 64, 9
"""Channels at full resolution, and residual blocks: 11.38 M parameters from three channels to three."""

MULTIPLE = 4
"""Pixels that a side must be a multiple of; others are padded."""

SMALLEST = 8
"""Pixels along a side: a quarter of less has no border to mirror. Smaller images are padded."""


class Mirrored(nn.Module):
    """Pads each side with the mirror image of what lies at it. Of copies: torch's own has a gradient on a GPU that is
    not the same every time.
    """

    def __init__(self, margin: int) -> None:
        """margin: pixels."""
        super().__init__()
        self.margin = margin

    def forward(self, features: Tensor) -> Tensor:
        """(N, C, H, W), sides longer than the margin."""
        for dim in (-1, -2):
            last = features.shape[dim] - 1
            before, after = (
                features.narrow(dim, start, self.margin).flip(dim) for start in (1, last - self.margin)
            )
            features = torch.cat([before, features, after], dim=dim)
        return features


class ResidualBlock(nn.Module):
    """Two 3 × 3 convolutions whose result is added to what they were given."""

    def __init__(self, channels: int) -> None:
        """channels: in and out."""
        super().__init__()
        self.layers = nn.Sequential(
            Mirrored(1),
            nn.Conv2d(channels, channels, 3),
            nn.InstanceNorm2d(channels),
            nn.ReLU(),
            Mirrored(1),
            nn.Conv2d(channels, channels, 3),
            nn.InstanceNorm2d(channels),
        )

    def forward(self, features: Tensor) -> Tensor:
        """(N, channels, H, W)."""
        return features + self.layers(features)


class ResidualGenerator(nn.Module):
    """See the module."""

    def __init__(self, inputs: int, outputs: int = 3, width: int = WIDTH) -> None:
        """inputs, outputs: channels. width: channels at full resolution."""
        super().__init__()
        layers: list[nn.Module] = [Mirrored(3), *_normalised(nn.Conv2d(inputs, width, 7))]
        for count in (width, 2 * width):
            layers += _normalised(nn.Conv2d(count, 2 * count, 3, 2, padding=1))
        layers += [ResidualBlock(4 * width) for _ in range(BLOCKS)]
        for count in (4 * width, 2 * width):
            layers += _normalised(nn.ConvTranspose2d(count, count // 2, 3, 2, padding=1, output_padding=1))
        layers += [Mirrored(3), nn.Conv2d(width, outputs, 7)]
        self.layers = nn.Sequential(*layers)

    def forward(self, image: Tensor) -> Tensor:
        """(N, inputs, H, W) of any size to (N, outputs, H, W)."""
        height, width = image.shape[-2:]
        multiple = SMALLEST if min(height, width) < SMALLEST else MULTIPLE
        result: Tensor = self.layers(padded(image, multiple))
        return result[..., :height, :width]


def _normalised(convolution: nn.Conv2d | nn.ConvTranspose2d) -> list[nn.Module]:
    return [convolution, nn.InstanceNorm2d(convolution.out_channels), nn.ReLU()]
