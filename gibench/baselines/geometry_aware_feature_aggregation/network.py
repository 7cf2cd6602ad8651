"""The network of Geometry-Aware Feature Aggregation (Gai, Wang & Li, Geometry-Aware Global Feature Aggregation for
Real-Time Indirect Illumination, section 3.2).

A geometry encoder looks at positions, normals and depth; a shading generator makes indirect light from direct light and
albedo, one colour at a time with the same weights. At every level, down and up again, features of the geometry scale
and shift those of the light (equation 2), and at the bottleneck each place gathers from all others with weights that
come from geometry alone (equations 3 and 4). Scales, shifts and weights are made once a frame and shared by the
colours.

The paper gives numbers of parameters and no channels: those here are ours, and come out at its numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import dropout2d, interpolate, leaky_relu, softmax

from gibench.baselines.image_to_image.shading import GEOMETRY, LIGHT
from gibench.baselines.training.padding import padded

SLOPE = 0.2
"""Of Leaky ReLU below zero."""

DROPOUT = 0.1
"""Share of features that is dropped where the generator goes up. The paper drops some and does not say how many."""

LARGEST = 1 << 25
"""Numbers of an attention that exist at a time, but for those that a gradient needs: 128 MB.
"""

MODULATED = 3
"""Pixels along a side of the convolutions that make scales and shifts."""


@dataclass(frozen=True)
class Size:
    """How large a network is.

    light, geometry: channels of the levels, from full resolution down, each of half the width and height of the one
    before. heads: of the attention; they share the channels of the deepest level. query: channels of a head's queries
    and keys. colours: 1: each alone; 3: all together, in and out, which the paper calls normal.
    """

    light: tuple[int, ...]
    geometry: tuple[int, ...]
    heads: int = 8
    query: int = 60
    colours: int = 1


FULL = Size((32, 64, 192, 320, 448), (32, 48, 128, 192, 192))
"""The paper's 14.42 M parameters, .024 M of which a head's queries and keys have (section 5.3). Its Table 2 differs by
.019 M from head to head.
"""

MINI = Size((24, 48, 128, 256, 352), (24, 48, 96, 128, 192))
"""The paper's 8.76 M (Table 2)."""


class Modulation(nn.Module):
    """What geometry does to light at one level: γ(f, g) and β(f, g) of equation 2."""

    def __init__(self, geometry: int, light: int) -> None:
        """geometry, light: channels of either's features. Starts near the identity."""
        super().__init__()
        self.both = nn.Conv2d(geometry + GEOMETRY, 2 * light, MODULATED, padding=MODULATED // 2)
        _xavier(self.both)
        with torch.no_grad():
            self.both.bias[:light] += 1  # type: ignore[index]

    def forward(self, features: Tensor, inputs: Tensor) -> tuple[Tensor, Tensor]:
        """Scale and shift (N, C, h, w) from geometry features and the geometry itself at their size."""
        scale, shift = self.both(torch.cat([features, inputs], dim=1)).chunk(2, dim=1)
        return scale, shift


class Attention(nn.Module):
    """How much each place listens to each other one, head by head, from geometry (equation 3)."""

    def __init__(self, geometry: int, heads: int, query: int) -> None:
        """geometry: channels of its features at the bottleneck."""
        super().__init__()
        self.heads = heads
        self.queries, self.keys = (nn.Conv2d(geometry + GEOMETRY, heads * query, 1) for _ in "QK")
        _xavier(self.queries, self.keys)

    def forward(self, features: Tensor, inputs: Tensor) -> Iterator[Tensor]:
        """(N, heads, P, P) for P places, each row of which adds up to 1: blocks of rows, one after the other.

        A block holds LARGEST numbers at most, so that memory grows with the places and not with their square.
        """
        both = torch.cat([features, inputs], dim=1)
        queries, keys = (
            part(both).flatten(2).unflatten(1, (self.heads, -1)) for part in (self.queries, self.keys)
        )
        for some in queries.split(max(1, LARGEST // (len(keys) * self.heads * keys.shape[-1])), dim=-1):
            # The paper has no factor; without one the first products saturate the exponentials.
            scores = some.transpose(2, 3) @ keys / math.sqrt(keys.shape[2])
            yield softmax(scores, dim=-1)


class Aggregation(nn.Module):
    """Each place's features plus what it gathers from all others (equation 4).

    Heads are linear maps to a share of the channels each, put side by side, so that the sum fits the features.
    """

    def __init__(self, light: int, heads: int) -> None:
        """light: channels, a multiple of the heads."""
        super().__init__()
        self.values = nn.Conv2d(light, light, 1)
        _xavier(self.values)
        self.heads = heads

    def forward(self, features: Tensor, attention: Iterable[Tensor]) -> Tensor:
        """features (N, colours, C, h, w), attention (N, heads, P, P) in blocks of rows."""
        count, colours, _, height, width = features.shape
        values = self.values(features.flatten(0, 1)).reshape(count, colours, self.heads, -1, height * width)
        gathered = torch.cat([values @ rows.transpose(2, 3)[:, None] for rows in attention], dim=-1)
        return features + gathered.reshape(features.shape)


class GeometryEncoder(nn.Module):
    """A U-shaped network: features of each level on the way down and on the way up."""

    def __init__(self, channels: tuple[int, ...]) -> None:
        """channels: of the levels."""
        super().__init__()
        self.down = _down(GEOMETRY, channels)
        self.up = _up(channels)

    def forward(self, geometry: Tensor) -> tuple[list[Tensor], list[Tensor]]:
        """Of the levels from full resolution down, and of those above the deepest from there up."""
        falling: list[Tensor] = []
        features = geometry
        for down in self.down:
            features = leaky_relu(down(features), SLOPE)
            falling.append(features)
        rising = []
        for up, skip in zip(self.up, falling[-2::-1], strict=True):
            features = leaky_relu(up(torch.cat([_twice(features), skip], dim=1)), SLOPE)
            rising.append(features)
        return falling, rising


class GeometryAware(nn.Module):
    """The geometry encoder and the shading generator."""

    def __init__(self, size: Size = FULL) -> None:
        """size: see there."""
        super().__init__()
        light, geometry = size.light, size.geometry
        self.size = size
        self.geometry = GeometryEncoder(geometry)
        self.down = _down(LIGHT * size.colours, light)
        self.up = _up(light)
        self.falling = nn.ModuleList(Modulation(g, c) for g, c in zip(geometry, light, strict=True))
        self.rising = nn.ModuleList(
            Modulation(g, c) for g, c in zip(geometry[-2::-1], light[-2::-1], strict=True)
        )
        self.attention = Attention(geometry[-1], size.heads, size.query)
        self.aggregation = Aggregation(light[-1], size.heads)
        self.last = nn.Conv2d(light[0], size.colours, 3, padding=1)
        _xavier(self.last)
        with torch.no_grad():  # untrained, it says about as much indirect light as there is direct
            self.last.weight *= 0.1

    @property
    def multiple(self) -> int:
        """Pixels that a side must be a multiple of; others are padded."""
        return 2 ** (len(self.size.light) - 1)

    def forward(self, light: Tensor, geometry: Tensor) -> Tensor:
        """Logarithm of indirect light over albedo, (N, 3, H, W), any size.

        light: (N, 2, 3, H, W), compressed direct light over albedo, and albedo. geometry: (N, GEOMETRY, H, W), position
        relative to the camera, normal, depth, in units of the scene.
        """
        height, width = geometry.shape[-2:]
        light = padded(light.flatten(1, 2), self.multiple).unflatten(1, (LIGHT, 3))
        geometry = padded(geometry, self.multiple)
        falling, rising = self.geometry(geometry)
        inputs = [geometry]
        for _ in falling[1:]:
            inputs.append(nn.functional.avg_pool2d(inputs[-1], 2))
        colours = 3 // self.size.colours  # that go through by themselves
        features = light.transpose(1, 2).reshape(len(light), colours, -1, *light.shape[-2:])
        skips = []
        for down, modulate, condition, plain in zip(self.down, self.falling, falling, inputs, strict=True):
            features = _each(down, features)
            features = _modulated(leaky_relu(features, SLOPE), *modulate(condition, plain))
            skips.append(features)
        features = self.aggregation(skips.pop(), self.attention(falling[-1], inputs[-1]))
        for up, modulate, condition, plain in zip(self.up, self.rising, rising, inputs[-2::-1], strict=True):
            together = torch.cat([_each(_twice, features), skips.pop()], dim=2)
            features = _modulated(leaky_relu(_each(up, together), SLOPE), *modulate(condition, plain))
            features = _each(lambda part: dropout2d(part, DROPOUT, self.training), features)
        return _each(self.last, features).flatten(1, 2)[..., :height, :width]


def _each(part: object, features: Tensor) -> Tensor:
    """A layer for images, applied to each colour of (N, colours, C, H, W)."""
    result: Tensor = part(features.flatten(0, 1))  # type: ignore[operator]
    return result.unflatten(0, features.shape[:2])


def _modulated(features: Tensor, scale: Tensor, shift: Tensor) -> Tensor:
    return scale[:, None] * features + shift[:, None]


def _twice(features: Tensor) -> Tensor:
    return interpolate(features, scale_factor=2, mode="nearest")


def _down(inputs: int, channels: tuple[int, ...]) -> nn.ModuleList:
    layers = nn.ModuleList(
        nn.Conv2d(before, after, 3 if first else 4, 1 if first else 2, padding=1)
        for first, (before, after) in zip(
            (True, *(False for _ in channels[1:])), pairwise((inputs, *channels)), strict=True
        )
    )
    _xavier(*layers)
    return layers


def _up(channels: tuple[int, ...]) -> nn.ModuleList:
    layers = nn.ModuleList(
        nn.Conv2d(below + skip, skip, 3, padding=1)
        for below, skip in zip(channels[:0:-1], channels[-2::-1], strict=True)
    )
    _xavier(*layers)
    return layers


def _xavier(*layers: nn.Module) -> None:
    for layer in layers:
        nn.init.xavier_uniform_(layer.weight)  # type: ignore[arg-type]
        nn.init.zeros_(layer.bias)  # type: ignore[arg-type]
