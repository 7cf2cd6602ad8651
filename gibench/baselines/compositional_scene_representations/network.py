"""The networks of Granskog et al. 2020: an encoder of observations, and a generator of pixels.

The layers are those of the authors' public code (jonathangranskog/shading-scene-representations): the pooled tower of
generative query networks (Eslami et al. 2018), of 2.00 M parameters, and ten layers a pixel, each of which is given all
inputs again.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn.functional import leaky_relu

OBSERVATIONS, SIDE = 3, 64
"""Images that tell of the light, and pixels along a side of each (Gao et al. 2022, section 4.3)."""

OBSERVED = 10
"""Channels of an observation: light, albedo, normal (3 each), distance."""

POSE = 16
"""Numbers of a camera: a matrix of 4 × 4."""

PIXEL = 16
"""Channels of a pixel: position, normal, view (3 each), material (7)."""

LAYERS = 10
"""Of the generator."""

CALM = 0.1
"""Of the first weights of its last layer: the network begins near the mean light."""


@dataclass(frozen=True)
class Size:
    """How large the networks are. represented: numbers that stand for the light. width: of the generator's layers."""

    represented: int
    width: int


FULL = Size(256, 512)
SMALL = Size(64, 128)


class Encoder(nn.Module):
    """An observation, as numbers."""

    def __init__(self, size: Size) -> None:
        """size: of the network."""
        super().__init__()
        wide, half = size.represented, size.represented // 2
        self.halved = nn.Conv2d(OBSERVED, wide, 2, 2)
        self.around = nn.Conv2d(wide, wide, 2, 2)
        self.first = nn.Conv2d(wide, half, 3, padding=1)
        self.second = nn.Conv2d(half, wide, 2, 2)
        self.beside = nn.Conv2d(wide + POSE, wide, 3, padding=1)
        self.third = nn.Conv2d(wide + POSE, half, 3, padding=1)
        self.fourth = nn.Conv2d(half, wide, 3, padding=1)
        self.last = nn.Conv2d(wide, wide, 1)

    def forward(self, images: Tensor, poses: Tensor) -> Tensor:
        """(N, OBSERVED, SIDE, SIDE) and (N, POSE) to (N, represented)."""
        x = leaky_relu(self.halved(images))
        x = leaky_relu(self.second(leaky_relu(self.first(x)))) + leaky_relu(self.around(x))
        x = torch.cat([x, poses[:, :, None, None].expand(-1, -1, *x.shape[-2:])], dim=1)
        x = leaky_relu(self.fourth(leaky_relu(self.third(x)))) + leaky_relu(self.beside(x))
        found: Tensor = leaky_relu(self.last(x)).mean(dim=(2, 3))
        return found


class Generator(nn.Module):
    """Light of a pixel, from what it shows and what stands for the light: log1p of radiance."""

    def __init__(self, size: Size) -> None:
        """size: of the network."""
        super().__init__()
        given = PIXEL + size.represented
        befores = [given] + [given + size.width] * (LAYERS - 1)
        self.layers = nn.ModuleList(nn.Linear(before, size.width) for before in befores)
        self.last = nn.Linear(size.width, 3)
        with torch.no_grad():
            self.last.weight *= CALM

    def begin_at(self, code: Tensor) -> None:
        """Begin with about the same code (3,) everywhere: the mean of what is to be learned."""
        with torch.no_grad():
            self.last.bias.copy_(code)

    def forward(self, pixels: Tensor, represented: Tensor) -> Tensor:
        """(N, PIXEL, H, W) and (N, represented) to (N, 3, H, W)."""
        pixels = pixels.movedim(1, -1)
        everywhere = represented[:, None, None].expand(-1, *pixels.shape[1:3], -1)
        x = given = torch.cat([pixels, everywhere], dim=-1)
        for number, layer in enumerate(self.layers):
            x = leaky_relu(layer(x if number == 0 else torch.cat([x, given], dim=-1)))
        found: Tensor = self.last(x)
        return found.movedim(-1, 1)


class Represented(nn.Module):
    """Both, and what observations show that stays the same under every light."""

    fixed: Tensor
    poses: Tensor

    def __init__(self, size: Size, fixed: Tensor | None = None, poses: Tensor | None = None) -> None:
        """fixed: (OBSERVATIONS, OBSERVED − 3, SIDE, SIDE), what they show beside light. poses: (OBSERVATIONS, POSE)."""
        super().__init__()
        self.encoder, self.generator = Encoder(size), Generator(size)
        shape = (OBSERVATIONS, OBSERVED - 3, SIDE, SIDE)
        self.register_buffer("fixed", torch.zeros(shape) if fixed is None else fixed)
        self.register_buffer("poses", torch.zeros(OBSERVATIONS, POSE) if poses is None else poses)

    def represented(self, light: Tensor) -> Tensor:
        """What observed light (N, OBSERVATIONS, 3, SIDE, SIDE), log1p, stands for: (N, represented), a mean."""
        count = len(light)
        images = torch.cat([light, self.fixed.expand(count, *self.fixed.shape)], dim=2)
        poses = self.poses.expand(count, *self.poses.shape)
        found: Tensor = self.encoder(images.flatten(0, 1), poses.flatten(0, 1))
        return found.reshape(count, OBSERVATIONS, -1).mean(dim=1)

    def forward(self, light: Tensor, pixels: Tensor) -> Tensor:
        """log1p of radiance, (N, 3, H, W)."""
        found: Tensor = self.generator(pixels, self.represented(light))
        return found
