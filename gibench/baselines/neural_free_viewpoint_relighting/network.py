"""Transport of a scene in wavelets (Raghavan et al. 2023, equations 4 to 7).

A place x has features h(x), a wavelet k has features w(k). Their product, element by element, goes through a matrix U,
and what comes out is joined with the surface's material and the reflected direction; a perceptron makes of it how much
of the light in wavelet k leaves x towards the eye, in each colour. Radiance is the dot product with the light.

U and the first layer are linear, so one matrix for each wavelet takes h(x) to the first layer: it is made once a frame.
What of the first layer does not depend on the wavelet is computed once a pixel, and the last layer is summed over the
wavelets with the light in one product. All of this is exact, and training uses it too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn

from gibench.baselines.neural_free_viewpoint_relighting.inputs import coded
from gibench.baselines.relighting.surfaces import MATERIAL
from gibench.baselines.training.encodings.hash_grid import HashGrid

DEGREE = 3
"""Of the spherical harmonics of the reflected direction: 16 functions, with which the inputs are 93, and 96 with what
pads them to the published size.
"""

CALM = 0.1
"""Of the first weights of the last layer: the network begins with little light, whatever it is asked about."""

FIELD_PIXELS = 1 << 14
"""Pixels whose features are looked up at once: an index for each corner of each level is the largest of a frame."""

LARGEST = 1 << 19
"""Numbers of a hidden layer at once, whatever the resolution: what fits into the caches of a processor."""


@dataclass(frozen=True)
class Size:
    """How large the network is.

    levels, features: of the hash grid; their product is the number of products, M. growth: of the grid from level to
    level. mixed: rows of U. hidden: width of the perceptron's two hidden layers.
    """

    levels: int
    features: int
    growth: float
    mixed: int
    hidden: int

    @property
    def products(self) -> int:
        """M: numbers of h(x) and of w(k)."""
        return self.levels * self.features


FULL = Size(levels=32, features=2, growth=1.3, mixed=64, hidden=128)
"""Of the paper: 107 MB of hash grid with tables of 2¹⁹ entries, 6.1 MB of wavelets, 64 × 64, 124 KB (section 5)."""

SMALL = Size(levels=16, features=2, growth=1.2, mixed=32, hidden=64)
"""For processors without a GPU."""


class HashField(nn.Module):
    """Features of places in the unit cube.

    Those of a level are divided by the square root of its resolution, in cells of the coarsest one. Adam moves an entry
    that one pixel has seen as far as one that a thousand have: without this, fine levels are grain for as long as a
    processor has time to train. What can be learned is the same.
    """

    shares: Tensor

    def __init__(self, size: Size, table: int) -> None:
        """table: binary logarithm of the entries of a level."""
        super().__init__()
        self.grid = HashGrid(levels=size.levels, features=size.features, table=2**table, growth=size.growth)
        shares = size.growth ** (-0.5 * torch.arange(size.levels, dtype=torch.float32))
        self.register_buffer("shares", shares.repeat_interleave(size.features), persistent=False)

    def forward(self, points: Tensor) -> Tensor:
        """(…, 3) in [0, 1] to (…, M)."""
        features: Tensor = self.grid(points) * self.shares
        return features


class Folded(NamedTuple):
    """The network for certain wavelets under certain light. enter: (…, M, K·hidden), from features to the first layer.
    leave: (…, K·hidden, 3), from the second layer to radiance, and constant: (…, 1, 3), what comes on top of it.
    """

    enter: Tensor
    leave: Tensor
    constant: Tensor


class TransportNetwork(nn.Module):
    """See the module."""

    def __init__(self, field: nn.Module, size: Size, faces: int, *, encoding: bool = True) -> None:
        """field: from places to M features. faces: texels along a face of the cubemap."""
        super().__init__()
        self.size, self.degree = size, DEGREE if encoding else None
        given = sum(MATERIAL.values()) + ((DEGREE + 1) ** 2 if encoding else 0)
        self.field = field
        # Of order one: the features of places begin next to 0, and a product of two such numbers would learn nothing.
        self.wavelets = nn.Parameter(torch.randn(6 * faces**2, size.products))
        self.mixing = nn.Linear(size.products, size.mixed, bias=False)
        self.first = nn.Linear(size.mixed + given, size.hidden)
        self.second = nn.Linear(size.hidden, size.hidden)
        self.last = nn.Linear(size.hidden, 3)
        with torch.no_grad():
            for part in (self.last.weight, self.last.bias):
                part *= CALM

    def folded(self, places: Tensor, light: Tensor) -> Folded:
        """places: (…, K) of wavelets. light: (…, K, 3), their weights."""
        wavelets = self.wavelets[places]
        mixing = self.first.weight[:, : self.size.mixed] @ self.mixing.weight  # (hidden, M)
        enter = wavelets[..., None] * mixing.T  # (…, K, M, hidden)
        leave = light[..., None, :] * self.last.weight.T  # (…, K, hidden, 3)
        return Folded(
            enter.movedim(-3, -2).flatten(-2),
            leave.flatten(-3, -2),
            light.sum(dim=-2, keepdim=True) * self.last.bias,
        )

    def once(self, material: Tensor) -> Tensor:
        """What the first layer has of a pixel whatever the wavelet: material (…, 13) to (…, hidden)."""
        weight = self.first.weight[:, self.size.mixed :]
        return nn.functional.linear(coded(material, self.degree), weight, self.first.bias)

    def summed(self, features: Tensor, once: Tensor, folded: Folded) -> Tensor:
        """Radiance (…, N, 3) of pixels with features (…, N, M). once: (…, N, hidden)."""
        hidden = self.size.hidden
        first = (features @ folded.enter).unflatten(-1, (-1, hidden)) + once[..., None, :]
        second = self.second(first.relu()).relu()
        return second.flatten(-2) @ folded.leave + folded.constant

    def forward(self, points: Tensor, material: Tensor, places: Tensor, light: Tensor) -> Tensor:
        """Radiance (…, N, 3), signed, of pixels at points (…, N, 3), in the unit cube, under light (…, K, 3).

        It is linear in the light.
        """
        return self.summed(self.field(points), self.once(material), self.folded(places, light))

    @torch.inference_mode()
    def frame(
        self,
        points: Tensor,
        material: Tensor,
        places: Tensor,
        light: Tensor,
        *,
        precision: torch.dtype = torch.float32,
    ) -> Tensor:
        """As `forward`, of any number of pixels (N, 3) in bounded memory: no array but the result grows with it.

        precision: of what is multiplied once a wavelet. In bfloat16 radiance is off by half a percent, most of it alike
        in all of a frame.
        """
        radiance = points.new_zeros(len(points), 3)
        if not len(places):
            return radiance
        folded = self.folded(places, light)
        enter, leave = folded.enter.to(precision), folded.leave.to(precision)
        weight, bias = self.second.weight.to(precision), self.second.bias.to(precision)
        at_once = max(1, LARGEST // (len(places) * self.size.hidden))
        for start in range(0, len(points), FIELD_PIXELS):
            some = slice(start, start + FIELD_PIXELS)
            features, once = self.field(points[some]).to(precision), self.once(material[some]).to(precision)
            for first in range(0, len(features), at_once):
                few = slice(first, first + at_once)
                # As `summed`, without gradients: hidden layers are rectified where they lie.
                hidden = torch.mm(features[few], enter).view(-1, len(places), self.size.hidden)
                hidden.add_(once[few, None]).relu_()
                hidden = nn.functional.linear(hidden.view(-1, self.size.hidden), weight, bias).relu_()
                radiance[start:][few] = torch.mm(hidden.view(-1, leave.shape[0]), leave)
        return radiance.add_(folded.constant)
