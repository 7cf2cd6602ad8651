"""A generator of residual blocks (Johnson et al. 2016; as in Zhu et al. 2017, appendix 7.2).

A 7 × 7 convolution, two that halve the image, nine residual blocks, two that double it, and a 7 × 7 convolution, with
borders mirrored and instances normalised. The last layer has no activation: it predicts the code of a radiance.
"""

from __future__ import annotations

from torch import Tensor, nn

from gibench.baselines.training.padding import padded

WIDTH, BLOCKS = 64, 9
"""Channels at full resolution, and residual blocks: 11.38 M parameters from three channels to three."""

MULTIPLE = 4
"""Pixels that a side must be a multiple of; others are padded."""

SMALLEST = 8
"""Pixels along a side: a quarter of less has no border to mirror. Smaller images are padded."""


class ResidualBlock(nn.Module):
    """Two 3 × 3 convolutions whose result is added to what they were given."""

    def __init__(self, channels: int) -> None:
        """channels: in and out."""
        super().__init__()
        self.layers = nn.Sequential(
            nn.ReflectionPad2d(1),
            nn.Conv2d(channels, channels, 3),
            nn.InstanceNorm2d(channels),
            nn.ReLU(),
            nn.ReflectionPad2d(1),
            nn.Conv2d(channels, channels, 3),
            nn.InstanceNorm2d(channels),
        )

    def forward(self, features: Tensor) -> Tensor:
        """(N, channels, H, W)."""
        return features + self.layers(features)


class ResidualGenerator(nn.Module):
    """See the module."""

    def __init__(self, inputs: int, outputs: int = 3) -> None:
        """inputs, outputs: channels."""
        super().__init__()
        layers: list[nn.Module] = [nn.ReflectionPad2d(3), *_normalised(nn.Conv2d(inputs, WIDTH, 7))]
        for count in (WIDTH, 2 * WIDTH):
            layers += _normalised(nn.Conv2d(count, 2 * count, 3, 2, padding=1))
        layers += [ResidualBlock(4 * WIDTH) for _ in range(BLOCKS)]
        for count in (4 * WIDTH, 2 * WIDTH):
            layers += _normalised(nn.ConvTranspose2d(count, count // 2, 3, 2, padding=1, output_padding=1))
        layers += [nn.ReflectionPad2d(3), nn.Conv2d(WIDTH, outputs, 7)]
        self.layers = nn.Sequential(*layers)

    def forward(self, image: Tensor) -> Tensor:
        """(N, inputs, H, W) of any size to (N, outputs, H, W)."""
        height, width = image.shape[-2:]
        multiple = SMALLEST if min(height, width) < SMALLEST else MULTIPLE
        result: Tensor = self.layers(padded(image, multiple))
        return result[..., :height, :width]


def _normalised(convolution: nn.Conv2d | nn.ConvTranspose2d) -> list[nn.Module]:
    return [convolution, nn.InstanceNorm2d(convolution.out_channels), nn.ReLU()]
