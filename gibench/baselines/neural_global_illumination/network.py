"""The network of Neural Global Illumination (Gao et al. 2022, section 3.3).

A U-Net looks at the whole screen, a perceptron at each pixel: at what the U-Net found there, at the pixel's inputs, and
at those encoded by sines and cosines. What it says is the code of indirect radiance (`LogCode`). The paper gives its
depth, width and size; the U-Net is that of pix2pix with half of the channels, which comes out at that size.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn.functional import relu

from gibench.baselines.pix2pix.network import UNet
from gibench.baselines.training.encodings.positional import positional

INPUTS = {
    "position": 3,
    "normal": 3,
    "diffuse": 3,
    "specular": 3,
    "roughness": 1,
    "view": 3,
    "direct": 3,
    "cues": 12,
    "light_direction": 3,
}
"""Channels of a pixel, in this order: 34 (section 3.2)."""

FACING = 3
"""Channels after them, of where the light faces, for a network that is told it; they are not encoded."""

JOINED = 4
"""Layer of the perceptron that is given its input again."""


@dataclass(frozen=True)
class Size:
    """How large the network is.

    levels: channels of the U-Net, a halving each; none for no U-Net. found: channels that it gives the perceptron.
    width, depth: of the perceptron's hidden layers. frequencies: of the encoding, 0 for none. encoded: names of the
    inputs that are encoded.
    """

    levels: tuple[int, ...]
    found: int
    width: int
    depth: int
    frequencies: int
    encoded: tuple[str, ...] = tuple(INPUTS)


FULL = Size((32, 64, 128, 256, 256, 256, 256, 256), 128, 256, 8, 10)
"""Of the paper: 14.65 M parameters, 55.9 MB of 2²⁰ bytes (section 4.1)."""

SMALL = Size((16, 32, 64, 128, 128), 32, 128, 6, 5, ("position", "normal", "view", "light_direction"))
"""For processors without a GPU. Directions and positions alone are encoded: of light, high frequencies mean nothing."""


CALM = 0.1
"""Of the first weights of the last layer. Those of encoded inputs are halved from frequency to frequency: networks that
begin smooth find what is smooth first, and need no steps to forget the grain that they began with."""


class NeuralGlobalIllumination(nn.Module):
    """See the module."""

    encoded: Tensor

    def __init__(self, size: Size = FULL, inputs: int = sum(INPUTS.values())) -> None:
        """inputs: channels of a pixel, fewer where some of INPUTS at their end are left out, more with FACING."""
        super().__init__()
        self.size = size
        self.register_buffer("encoded", _channels_of(size.encoded, inputs), persistent=False)
        # Fitting one room is a regression, in which nothing is dropped.
        self.screen = UNet(inputs, size.found, size.levels, dropped=0) if size.levels else None
        given = inputs + 2 * size.frequencies * len(self.encoded) + (size.found if size.levels else 0)
        widths = [given, *(size.width for _ in range(size.depth - 1))]
        self.hidden = nn.ModuleList(
            nn.Linear(before + (given if layer == JOINED else 0), size.width)
            for layer, before in enumerate(widths)
        )
        self.last = nn.Linear(size.width, 3)
        for layer in self.hidden:
            nn.init.kaiming_uniform_(layer.weight, nonlinearity="relu")  # type: ignore[arg-type]
            nn.init.zeros_(layer.bias)  # type: ignore[arg-type]
        with torch.no_grad():
            for number, before in ((0, 0), (JOINED, size.width)):
                if number < size.depth:
                    columns = slice(
                        before + inputs, before + inputs + 2 * size.frequencies * len(self.encoded)
                    )
                    self.hidden[number].weight[:, columns] *= self._calm()  # type: ignore[operator, index]
            self.last.weight *= CALM
            self.last.bias.zero_()

    def begin_at(self, code: Tensor) -> None:
        """Begin with the same code (3,) everywhere: the mean of what is to be learned."""
        with torch.no_grad():
            self.last.bias.copy_(code)

    def _calm(self) -> Tensor:
        """Factors of the first weights of encoded inputs, (2 · frequencies · encoded)."""
        levels = torch.arange(self.size.frequencies).repeat_interleave(len(self.encoded)).repeat(2)
        return 0.5**levels

    def forward(self, pixels: Tensor) -> Tensor:
        """(N, inputs, H, W) of any size, HDR among it compressed, to the code of radiance (N, 3, H, W)."""
        parts = [pixels]
        if self.size.frequencies and len(self.encoded):
            parts.append(positional(pixels[:, self.encoded], self.size.frequencies, dim=1))
        if self.screen is not None:
            parts.append(self.screen(pixels))
        # A row of numbers for each pixel: products of matrices are faster than convolutions of single pixels.
        given = features = torch.cat([part.movedim(1, -1) for part in parts], dim=-1)
        for layer, hidden in enumerate(self.hidden):
            if layer == JOINED:
                features = torch.cat([features, given], dim=-1)
            features = relu(hidden(features))
        code: Tensor = self.last(features)
        return code.movedim(-1, 1)


def _channels_of(names: tuple[str, ...], inputs: int) -> Tensor:
    found, at = [], 0
    for name, count in INPUTS.items():
        if name in names:
            found += [channel for channel in range(at, at + count) if channel < inputs]
        at += count
    return torch.tensor(found, dtype=torch.long)
