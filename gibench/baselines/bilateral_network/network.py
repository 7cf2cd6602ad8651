"""A network of bilateral convolutions, after Xin et al. 2021.

They predict indirect light from direct light, normals and positions alone, by convolutions whose kernels stop where
surfaces end. Neither their layers nor their weights are public: those here are ours, and come out at the 3.95 M
parameters that Gai, Wang & Li report.

A bilateral convolution weighs each tap q of its kernel at p by how alike the surfaces are,

    w(p, q) = exp(−a |n_p − n_q|² − b |x_p − x_q|² / z_p²),

with a, b ≥ 0 of its own that are learned, and divides by the mean of the weights, so that a kernel at an edge has the
reach of one that lies on a wall. With a = b = 0 it is a convolution.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import avg_pool2d, conv2d, interpolate, leaky_relu, pad, softplus

from gibench.baselines.image_to_image.shading import GEOMETRY
from gibench.baselines.training.padding import padded

CHANNELS = (40, 80, 160, 288, 344)
"""Of the levels, from full resolution down, each of half the width and height of the one before."""

SLOPE = 0.1
"""Of Leaky ReLU below zero."""

FIRST = 1.0
"""a and b before they are learned."""

LEAST = 1e-6
"""Weight of a tap below which it is left out."""

SIDE = 3
"""Taps along a side of a kernel."""


class Surfaces:
    """What tells how alike pixels are: position and normal, and depth, at one resolution."""

    def __init__(self, geometry: Tensor) -> None:
        """geometry: (N, GEOMETRY, H, W)."""
        self.geometry = geometry
        position, normal, depth = geometry.split((3, 3, 1), dim=1)
        size = depth.square().clamp(min=1e-6)
        self.differences = []
        both = torch.cat([normal, position], dim=1)
        for there in _taps(both, "replicate"):
            n, x = (part.sum(1, keepdim=True) for part in (both - there).square().split(3, dim=1))
            self.differences.append((n, x / size))

    def halved(self) -> Surfaces:
        """At half the width and height."""
        return Surfaces(avg_pool2d(self.geometry, 2))


class BilateralConvolution(nn.Module):
    """See the module."""

    def __init__(self, inputs: int, outputs: int) -> None:
        """inputs, outputs: channels."""
        super().__init__()
        self.convolution = nn.Conv2d(inputs, outputs, SIDE, padding=SIDE // 2)
        nn.init.kaiming_uniform_(self.convolution.weight, SLOPE)
        nn.init.zeros_(self.convolution.bias)  # type: ignore[arg-type]
        # softplus(x) = FIRST
        self.strictness = nn.Parameter(torch.full((2,), FIRST).expm1().log())

    def forward(self, features: Tensor, surfaces: Surfaces) -> Tensor:
        """(N, inputs, H, W) to (N, outputs, H, W)."""
        a, b = softplus(self.strictness)
        weights = torch.cat([torch.exp(-a * n - b * x) for n, x in surfaces.differences], dim=1)
        # Denormals take a hundred times as long.
        weights = torch.where(weights > LEAST, weights, 0)
        weights = weights / weights.mean(dim=1, keepdim=True)
        kernels = self.convolution.weight.flatten(2).unbind(-1)
        total = self.convolution.bias[:, None, None]  # type: ignore[index]
        for kernel, weight, there in zip(kernels, weights.split(1, dim=1), _taps(features), strict=True):
            total = total + conv2d(there * weight, kernel[..., None, None])
        return total


class BilateralNetwork(nn.Module):
    """U-shaped: bilateral convolutions, means of 2 × 2 on the way down, and what was found on it on the way up."""

    INPUTS = 9

    def __init__(self, channels: tuple[int, ...] = CHANNELS) -> None:
        """channels: of the levels."""
        super().__init__()
        self.down = nn.ModuleList(
            BilateralConvolution(before, after) for before, after in pairwise((self.INPUTS, *channels))
        )
        self.up = nn.ModuleList(
            BilateralConvolution(below + skip, skip)
            for below, skip in zip(channels[:0:-1], channels[-2::-1], strict=True)
        )
        self.last = nn.Conv2d(channels[0], 3, 1)
        nn.init.xavier_uniform_(self.last.weight, 0.1)  # untrained: about as much indirect light as direct
        nn.init.zeros_(self.last.bias)  # type: ignore[arg-type]

    @property
    def multiple(self) -> int:
        """Pixels that a side must be a multiple of; others are padded."""
        return int(2 ** len(self.up))

    def forward(self, light: Tensor, geometry: Tensor) -> Tensor:
        """As a network of `image_to_image.shading.indirect`; of the light it takes the direct one, of the geometry
        normals and positions.
        """
        height, width = geometry.shape[-2:]
        assert geometry.shape[1] == GEOMETRY
        geometry = padded(geometry, self.multiple)
        features = torch.cat([padded(light[:, 0], self.multiple), geometry[:, : self.INPUTS - 3]], dim=1)
        surfaces = [Surfaces(geometry)]
        skips: list[Tensor] = []
        for level, down in enumerate(self.down):
            if level:
                features = avg_pool2d(features, 2)
                surfaces.append(surfaces[-1].halved())
            features = leaky_relu(down(features, surfaces[-1]), SLOPE)
            skips.append(features)
        features = skips.pop()
        for up, there in zip(self.up, surfaces[-2::-1], strict=True):
            larger = interpolate(features, scale_factor=2, mode="nearest")
            features = leaky_relu(up(torch.cat([larger, skips.pop()], dim=1), there), SLOPE)
        code: Tensor = self.last(features)
        return code[..., :height, :width]


def _taps(image: Tensor, beyond: str = "constant") -> Iterator[Tensor]:
    """What lies at each tap of a kernel, row by row, for all pixels. beyond: mode of `pad`; 0 unless it is given."""
    height, width = image.shape[-2:]
    wide = pad(image, (SIDE // 2,) * 4, mode=beyond)
    for row in range(SIDE):
        for column in range(SIDE):
            yield wide[..., row : row + height, column : column + width]
