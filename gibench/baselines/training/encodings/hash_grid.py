"""Learned features of positions, on grids of rising resolution (Müller et al. 2022, Instant NGP)."""

from __future__ import annotations

import math
from itertools import product

import torch
from torch import Tensor, nn

from gibench.baselines.training.errors import TrainingError

PRIMES = (1, 2654435761, 805459861)
"""Of the hash (equation 4); the first one keeps neighbours together."""

INITIAL = 1e-4
"""Features begin between −INITIAL and INITIAL (section 4)."""


class HashGrid(nn.Module):
    """Features at points of the unit cube, trilinear on each of several grids, side by side.

    Level l has ⌊base · growth^l⌋ cells along a side. Where all its corners fit the table each has an entry of its own;
    finer levels share entries by a hash of the corner, and what collides is left to training.
    """

    offsets: Tensor

    def __init__(
        self, *, levels: int = 16, features: int = 2, table: int = 2**19, base: int = 16, growth: float = 1.38
    ) -> None:
        """table: entries of a level at most, a power of 2. growth: of the resolution from level to level, ≥ 1."""
        super().__init__()
        if table < 1 or table & (table - 1) or table > 2**32:
            raise TrainingError(f"a hash table has a power of 2 of entries, up to 2³², not {table}")
        if levels < 1 or features < 1 or base < 1 or not growth >= 1:
            raise TrainingError(
                f"a hash grid of {levels} levels, {features} features, base {base}, growth {growth}: "
                "all must be 1 at least"
            )
        self.table, self.features = table, features
        self.resolutions = [math.floor(base * growth**level) for level in range(levels)]
        self.sizes = [min((cells + 1) ** 3, table) for cells in self.resolutions]
        starts = [sum(self.sizes[:level]) for level in range(levels)]
        self.register_buffer("offsets", torch.tensor(starts), persistent=False)
        self.entries = nn.Parameter(torch.empty(sum(self.sizes), features).uniform_(-INITIAL, INITIAL))

    @property
    def channels(self) -> int:
        """Features of a point."""
        return len(self.resolutions) * self.features

    def forward(self, points: Tensor) -> Tensor:
        """(…, 3) in [0, 1], clamped to it, to (…, levels · features)."""
        flat = points.reshape(-1, 3).clamp(0, 1)
        indices, weights = [], []
        for cells, offset, size in zip(self.resolutions, self.offsets, self.sizes, strict=True):
            scaled = flat * cells
            low = scaled.detach().floor().clamp(max=cells - 1)
            inside = scaled - low
            corner = low.long()
            index, weight = zip(
                *(self._corner(corner, inside, cells, size, at) for at in CORNERS), strict=True
            )
            indices.append(torch.stack(index, dim=-1) + offset)
            weights.append(torch.stack(weight, dim=-1))
        # One gather for all levels; where torch is to be deterministic its gradient adds in an order of its own.
        values = self.entries[torch.stack(indices, dim=1)]
        mixed = (torch.stack(weights, dim=1)[..., None] * values).sum(dim=2)
        return mixed.reshape(*points.shape[:-1], self.channels)

    def _corner(
        self, corner: Tensor, inside: Tensor, cells: int, size: int, at: tuple[int, ...]
    ) -> tuple[Tensor, Tensor]:
        """Entry of the corner of a cell, and its weight."""
        x, y, z = (corner[:, axis] + at[axis] for axis in range(3))
        shares = [inside[:, axis] if at[axis] else 1 - inside[:, axis] for axis in range(3)]
        if (cells + 1) ** 3 <= size:
            index = x + (cells + 1) * (y + (cells + 1) * z)
        else:
            # The low bits of a product are the same in 64 bits as in the 32 that overflow in the paper.
            index = (x * PRIMES[0] ^ y * PRIMES[1] ^ z * PRIMES[2]) & (self.table - 1)
        return index, shares[0] * shares[1] * shares[2]


CORNERS = tuple(product((0, 1), repeat=3))
"""Of a cell, along x, y and z."""
