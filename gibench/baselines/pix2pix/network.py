"""The U-Net of pix2pix (Isola et al. 2017, section 3.2 and appendix 6.1).

4 × 4 convolutions that halve the image level by level, transposed ones back up, each joined with what was found on the
way down. Instances are normalised, which is what the paper's batches of one come to, except at both ends and at the
bottom; where nothing is normalised there is a bias. The last layer has no activation: what is predicted is the code of
a radiance, not a photograph.
"""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import dropout, leaky_relu, relu

from gibench.baselines.training.padding import at_least

CHANNELS = (64, 128, 256, 512, 512, 512, 512)
"""Of the levels below full resolution: 41.83 M parameters, as Gai, Wang & Li report."""

SLOPE = 0.2
"""Of Leaky ReLU below zero, on the way down."""

DROPOUT, DROPPED = 0.5, 3
"""Share of features that is dropped while training, and in how many of the first levels on the way up."""

SPREAD = 0.02
"""Standard deviation of the first weights."""


class UNet(nn.Module):
    """See the module."""

    def __init__(
        self, inputs: int, outputs: int = 3, channels: tuple[int, ...] = CHANNELS, *, dropped: int = DROPPED
    ) -> None:
        """channels: of the levels; a halving of the image each. dropped: levels with dropout."""
        super().__init__()
        last = len(channels) - 1
        self.down = nn.ModuleList(
            nn.Conv2d(before, after, 4, 2, padding=1, bias=level in (0, last))
            for level, (before, after) in enumerate(pairwise((inputs, *channels)))
        )
        self.down_norms = nn.ModuleList(nn.InstanceNorm2d(count, affine=True) for count in channels[1:-1])
        # Below the deepest level there is no skip: what comes up from it is alone.
        below = (channels[-1], *(2 * count for count in channels[-2::-1]))
        above = (*channels[-2::-1], outputs)
        self.up = nn.ModuleList(
            nn.ConvTranspose2d(before, after, 4, 2, padding=1, bias=level == last)
            for level, (before, after) in enumerate(zip(below, above, strict=True))
        )
        self.up_norms = nn.ModuleList(nn.InstanceNorm2d(count, affine=True) for count in channels[-2::-1])
        self.dropped = dropped
        for layer in (*self.down, *self.up):
            nn.init.normal_(layer.weight, 0, SPREAD)
            if layer.bias is not None:
                nn.init.zeros_(layer.bias)

    @property
    def smallest(self) -> int:
        """Pixels that a side must have; shorter ones are padded."""
        return int(2 ** len(self.down))

    def forward(self, image: Tensor) -> Tensor:
        """(N, inputs, H, W) of any size to (N, outputs, H, W)."""
        height, width = image.shape[-2:]
        features = at_least(image, self.smallest)
        skips: list[Tensor] = []
        sizes: list[list[int]] = []
        for level, down in enumerate(self.down):
            sizes.append(list(features.shape[-2:]))
            features = down(leaky_relu(features, SLOPE) if level else features)
            if 0 < level < len(self.down) - 1:
                features = self.down_norms[level - 1](features)
            skips.append(features)
        features = skips.pop()
        for level, up in enumerate(self.up):
            # Of two sizes with the same half it is the one that was halved.
            features = up(relu(features), output_size=sizes.pop())
            if skips:
                features = self.up_norms[level](features)
                if level < self.dropped:
                    features = dropout(features, DROPOUT, self.training)
                features = torch.cat([features, skips.pop()], dim=1)
        return features[..., :height, :width]
