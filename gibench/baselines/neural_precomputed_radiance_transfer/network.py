"""The networks of Neural Precomputed Radiance Transfer (Rainer et al. 2022, as Raghavan et al. 2023 compare with it).

A convolutional encoder makes a code of 64 numbers of the environment. A transport network with sines makes another 64
of a surface, and a decoder makes radiance of both. With two branches, one is told what diffuse light depends on and one
what specular light does; their sum is weighted by the two reflectances.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from gibench.baselines.relighting.surfaces import MATERIAL

CODE = 64
"""Numbers of the code of the light, and of that of the transport."""

CHANNELS = 32
"""Of the encoder's convolutions."""

SIDES = (8, 16)
"""Of the picture after four convolutions of stride 2 over 128 × 256."""

FREQUENCY = 30.0
"""Of the first layer of sines (Sitzmann et al. 2020, section 3.2)."""

BRANCH_WIDTH, ONE_WIDTH = 174, 256
"""Of hidden layers. 256 is published for one branch; with two, 174 gives 194,840 parameters, and no width gives the
published 194,226.
"""

AT_ONCE = 1 << 15
"""Pixels of a frame that are computed together."""


class LightEncoder(nn.Module):
    """From a picture of light (…, 3, 128, 256) to its code (…, 64): 290,848 parameters."""

    def __init__(self) -> None:
        """Untrained."""
        super().__init__()
        layers: list[nn.Module] = []
        for before in (3, CHANNELS, CHANNELS, CHANNELS):
            layers += [nn.Conv2d(before, CHANNELS, 3, stride=2, padding=1), nn.ReLU()]
        self.convolutions = nn.Sequential(*layers)
        self.last = nn.Linear(CHANNELS * SIDES[0] * SIDES[1], CODE)

    def forward(self, picture: Tensor) -> Tensor:
        """(N, 3, 128, 256), each colour of each divided by its own mean radiance, to (N, 64)."""
        # Lamps are thousands of times brighter than walls.
        code: Tensor = self.last(self.convolutions(torch.log1p(picture)).flatten(1))
        return code


class Branch(nn.Module):
    """Transport network and decoder."""

    def __init__(self, inputs: int, width: int) -> None:
        """inputs: numbers of a surface. width: of all hidden layers."""
        super().__init__()
        self.first, self.second = nn.Linear(inputs, width), nn.Linear(width, width)
        self.transport = nn.Linear(width, CODE)
        self.decoder = nn.Sequential(
            nn.Linear(2 * CODE, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU(), nn.Linear(width, 3)
        )
        with torch.no_grad():
            self.first.weight.uniform_(-1 / inputs, 1 / inputs)
            bound = math.sqrt(6 / width) / FREQUENCY
            self.second.weight.uniform_(-bound, bound)

    def forward(self, surface: Tensor, light: Tensor) -> Tensor:
        """Surfaces (…, N, inputs) under a code of light (…, 64) to (…, N, 3)."""
        hidden = torch.sin(FREQUENCY * self.first(surface))
        hidden = torch.sin(FREQUENCY * self.second(hidden))
        transport = self.transport(hidden)
        both = torch.cat([transport, light[..., None, :].expand(*transport.shape[:-1], CODE)], dim=-1)
        found: Tensor = self.decoder(both)
        return found


class TransferNetwork(nn.Module):
    """See the module."""

    def __init__(self, *, separated: bool = True) -> None:
        """separated: whether there are two branches."""
        super().__init__()
        self.encoder = LightEncoder()
        if separated:
            self.diffuse, self.specular = Branch(9, BRANCH_WIDTH), Branch(16, BRANCH_WIDTH)
        else:
            self.together = Branch(19, ONE_WIDTH)
        self.separated = separated

    def decoded(self, points: Tensor, material: Tensor, eye: Tensor, light: Tensor) -> Tensor:
        """Radiance (…, N, 3) in units of the mean radiances of the environment, whose code is light (…, 64).

        points: (…, N, 3) in the unit cube. material: (…, N, 13). eye: (…, N, 3), directions towards it.
        """
        normal, reflected, roughness, diffuse, specular = material.split(list(MATERIAL.values()), dim=-1)
        place = 2 * points - 1
        if not self.separated:
            parts = [place, eye, reflected, normal, diffuse, specular, roughness]
            return self.together(torch.cat(parts, dim=-1), light)
        matt = self.diffuse(torch.cat([place, normal, diffuse], dim=-1), light)
        glossy = [place, normal, specular, eye, reflected, roughness]
        found: Tensor = diffuse * matt + specular * self.specular(torch.cat(glossy, dim=-1), light)
        return found

    def forward(self, points: Tensor, material: Tensor, picture: Tensor, mean: Tensor) -> Tensor:
        """Radiance (N, P, 3), signed. picture: (N, 3, 128, 256) in units of `mean` (N, 3), the environment's radiance.

        It is linear in the means.
        """
        return self.lit(points, material, self.encoder(picture), mean)

    def lit(self, points: Tensor, material: Tensor, light: Tensor, mean: Tensor) -> Tensor:
        """As `forward`, under codes of light (N, 64)."""
        return self.decoded(points, material, towards_eye(material), light) * mean[:, None]

    @torch.inference_mode()
    def frame(self, points: Tensor, material: Tensor, light: Tensor, mean: Tensor) -> Tensor:
        """As `forward` of one frame (P, 3) of any size, in bounded memory. light: the code (64,). mean: (3,)."""
        radiance = points.new_zeros(len(points), 3)
        if mean.any():
            for start in range(0, len(points), AT_ONCE):
                some = slice(start, start + AT_ONCE)
                few = material[some]
                radiance[some] = mean * self.decoded(points[some], few, towards_eye(few), light)
        return radiance


def towards_eye(material: Tensor) -> Tensor:
    """Unit directions (…, 3) towards the eye: the reflected ones of material (…, 13), mirrored at the normal."""
    normal, reflected = material[..., :3], material[..., 3:6]
    return 2 * (reflected * normal).sum(dim=-1, keepdim=True) * normal - reflected
