"""The reconstruction network of Guo et al. 2022, section 4.4: a noisy image and clean G-buffers in, an image out.

Two encoders of 3 × 3 convolutions, one for the image, one for the G-buffers; at every level the second modulates what
the first has found (equation 5). A decoder of transposed convolutions goes back up, with skip connections. The channel
counts stand only in a figure of the paper: those here are ours.

The network adds to the logarithm of its input: a last layer of zeros hands the input through, so training starts
from the search's own image. The paper does not say whether its network does so.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import leaky_relu

from gibench.baselines.training.padding import padded

CHANNELS = (16, 24, 32, 48)
"""Of the levels, from full resolution down; each next one has half the width and height."""

GUIDES = 10
"""Channels of the G-buffers: depth 1, normal 3, albedo 3, reflected albedo 3."""

SLOPE = 0.1
"""Of Leaky ReLU below zero."""

STEEPNESS = 14.0
"""Of the compression: middle grey and white lie as far apart as sRGB puts them, and nothing is clipped above."""

BRIGHTEST = 40.0
"""Compressed value that outputs are held below: its radiance, 10¹⁶ times white, fits single precision."""


@dataclass(frozen=True)
class Scale:
    """Normalisation of a scene for a network: exposure (1 / radiance of white) and depth (m)."""

    exposure: float
    depth: float

    def compressed(self, radiance: Tensor) -> Tensor:
        """Logarithm of radiance ≥ 0; 0 stays 0."""
        return torch.log1p(radiance * (STEEPNESS * self.exposure))

    def radiance(self, compressed: Tensor) -> Tensor:
        """Inverse of `compressed`, for any values: finite and ≥ 0."""
        return torch.expm1(compressed.clamp(0, BRIGHTEST)) / (STEEPNESS * self.exposure)

    def guides(self, buffers: Tensor) -> Tensor:
        """G-buffers (…, GUIDES, H, W), depth in metres, as the network takes them."""
        depth, others = buffers.split((1, GUIDES - 1), dim=-3)
        return torch.cat([depth / self.depth, others], dim=-3)


class Modulation(nn.Module):
    """Features of the image, weighted and shifted pixel by pixel by those of the G-buffers (equation 5)."""

    def __init__(self, channels: int) -> None:
        """channels: of either features. Starts near the identity."""
        super().__init__()
        self.weight = nn.Conv2d(channels, channels, 1)
        self.shift = nn.Conv2d(channels, channels, 1)
        nn.init.ones_(self.weight.bias)  # type: ignore[arg-type]

    def forward(self, image: Tensor, guides: Tensor) -> Tensor:
        """Both (N, C, H, W)."""
        return self.weight(guides) * image + self.shift(guides)


class Concatenation(nn.Module):
    """The substitute for `Modulation` in the paper's figure 14 (a): both features, mixed by one convolution."""

    def __init__(self, channels: int) -> None:
        """channels: of either features."""
        super().__init__()
        self.mix = nn.Conv2d(2 * channels, channels, 1)

    def forward(self, image: Tensor, guides: Tensor) -> Tensor:
        """Both (N, C, H, W)."""
        return self.mix(torch.cat([image, guides], dim=1))


def _down(inputs: int, channels: tuple[int, ...]) -> nn.ModuleList:
    strides = (1, *(2 for _ in channels[1:]))
    return nn.ModuleList(
        nn.Conv2d(before, after, 3, stride, padding=1)
        for (before, after), stride in zip(pairwise((inputs, *channels)), strides, strict=True)
    )


FUSIONS = {"modulation": Modulation, "concatenation": Concatenation}
"""Ways in which features of the G-buffers act on those of the image, by name of the method's knob."""


class ReconstructionNetwork(nn.Module):
    """See the module."""

    def __init__(self, fusion: str = "modulation", channels: tuple[int, ...] = CHANNELS) -> None:
        """fusion: one of FUSIONS. channels: of the levels."""
        super().__init__()
        kind = FUSIONS[fusion]
        self.image, self.guides = _down(3, channels), _down(GUIDES, channels)
        self.fusions = nn.ModuleList(kind(count) for count in channels)
        # Below the deepest level there is no skip: what comes up from it is alone.
        deeper = (channels[-1], *(2 * count for count in channels[-2:0:-1]))
        self.up = nn.ModuleList(
            nn.ConvTranspose2d(below, count, 4, 2, padding=1)
            for below, count in zip(deeper, channels[-2::-1], strict=True)
        )
        self.last = nn.ConvTranspose2d(2 * channels[0], 3, 3, 1, padding=1)
        nn.init.zeros_(self.last.weight)
        nn.init.zeros_(self.last.bias)  # type: ignore[arg-type]
        # Convolutions of so few channels then take three quarters of the time.
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    @property
    def parameter_count(self) -> int:
        """Number of trained parameters."""
        return sum(parameter.numel() for parameter in self.parameters())

    def forward(self, image: Tensor, guides: Tensor) -> Tensor:
        """Compressed radiance (N, 3, H, W) and guides (N, GUIDES, H, W) of any size to compressed radiance."""
        height, width = image.shape[-2:]
        multiple = 2 ** len(self.up)
        features, conditions = padded(image, multiple), padded(guides, multiple)
        skips = []
        for down, condition, fuse in zip(self.image, self.guides, self.fusions, strict=True):
            features, conditions = (
                leaky_relu(down(features), SLOPE),
                leaky_relu(condition(conditions), SLOPE),
            )
            features = fuse(features, conditions)
            skips.append(features)
        features = skips.pop()
        for up in self.up:
            features = torch.cat([leaky_relu(up(features), SLOPE), skips.pop()], dim=1)
        return image + self.last(features)[..., :height, :width]
