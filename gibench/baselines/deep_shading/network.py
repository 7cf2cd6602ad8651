"""The network of Deep Shading (Nalbach et al. 2017, section 4), and three of it, one for each colour.

Six halvings by the maximum, 3 × 3 convolutions; back up by transposed convolutions that keep the channels, joined with
what was found at that size, and a convolution that halves them. Gai, Wang & Li compare themselves with the version that
has a network of its own for every colour. They report 7.75 M parameters; three of these have 7.73 M.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.functional import dropout, leaky_relu, max_pool2d

from gibench.baselines.training.padding import padded

CHANNELS = (8, 16, 32, 64, 128, 256)
"""Of the levels, from full resolution down."""

SLOPE = 0.01
"""Of Leaky ReLU below zero."""

DROPOUT, DROPPED = 0.5, 2
"""Share of features that is dropped while training, and in how many of the deepest levels on each side."""


class DeepShading(nn.Module):
    """One network. 2.58 M parameters."""

    def __init__(self, inputs: int, outputs: int = 1, channels: tuple[int, ...] = CHANNELS) -> None:
        """inputs, outputs: channels. channels: of the levels; a halving of the image each."""
        super().__init__()
        before = (inputs, *channels[:-1])
        self.down = nn.ModuleList(
            nn.Conv2d(one, other, 3, padding=1) for one, other in zip(before, channels, strict=True)
        )
        rising = channels[::-1]
        self.up = nn.ModuleList(nn.ConvTranspose2d(count, count, 4, 2, padding=1) for count in rising)
        after = (*rising[1:], outputs)
        self.mix = nn.ModuleList(
            nn.Conv2d(2 * one, other, 3, padding=1) for one, other in zip(rising, after, strict=True)
        )

    @property
    def multiple(self) -> int:
        """Pixels that a side must be a multiple of; others are padded."""
        return int(2 ** len(self.down))

    def forward(self, image: Tensor) -> Tensor:
        """(N, inputs, H, W) of any size to (N, outputs, H, W)."""
        height, width = image.shape[-2:]
        features = padded(image, self.multiple)
        skips: list[Tensor] = []
        for level, down in enumerate(self.down):
            features = leaky_relu(down(features), SLOPE)
            if level >= len(self.down) - DROPPED:
                features = dropout(features, DROPOUT, self.training)
            skips.append(features)
            features = max_pool2d(features, 2)
        for level, (up, mix) in enumerate(zip(self.up, self.mix, strict=True)):
            features = mix(torch.cat([leaky_relu(up(features), SLOPE), skips.pop()], dim=1))
            if skips:
                features = leaky_relu(features, SLOPE)
                if level < DROPPED:
                    features = dropout(features, DROPOUT, self.training)
        return features[..., :height, :width]


class OfEachColour(nn.Module):
    """Three networks, none of which sees another's colour."""

    def __init__(self, light: int, geometry: int, channels: tuple[int, ...] = CHANNELS) -> None:
        """light: channels of each colour, geometry: of what all three see. channels: of the levels."""
        super().__init__()
        self.colours = nn.ModuleList(DeepShading(light + geometry, 1, channels) for _ in range(3))

    def forward(self, light: Tensor, geometry: Tensor) -> Tensor:
        """(N, light, 3, H, W) and (N, geometry, H, W) to (N, 3, H, W)."""
        return torch.cat(
            [
                network(torch.cat([light[:, :, colour], geometry], dim=1))
                for colour, network in enumerate(self.colours)
            ],
            dim=1,
        )
