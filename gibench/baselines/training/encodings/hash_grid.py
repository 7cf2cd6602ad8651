"""Learned features of positions, on grids of rising resolution (Müller et al. 2022, Instant NGP)."""

from __future__ import annotations

import math

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
    cells: Tensor
    steps: Tensor

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
        # Resolutions never fall, so levels whose corners all fit come before those that hash.
        self.dense = sum((cells + 1) ** 3 <= table for cells in self.resolutions)
        steps = [(1, cells + 1, (cells + 1) ** 2) for cells in self.resolutions[: self.dense]]
        steps += [PRIMES] * (levels - self.dense)
        starts = [sum(self.sizes[:level]) for level in range(levels)]
        self.register_buffer("offsets", torch.tensor(starts), persistent=False)
        self.register_buffer("cells", torch.tensor(self.resolutions)[:, None], persistent=False)
        self.register_buffer("steps", torch.tensor(steps), persistent=False)
        self.entries = nn.Parameter(torch.empty(sum(self.sizes), features).uniform_(-INITIAL, INITIAL))

    @property
    def channels(self) -> int:
        """Features of a point."""
        return len(self.resolutions) * self.features

    def forward(self, points: Tensor) -> Tensor:
        """(…, 3) in [0, 1], clamped to it, to (…, levels · features)."""
        scaled = points.reshape(-1, 1, 3).clamp(0, 1) * self.cells  # (N, levels, 3)
        low = torch.minimum(scaled.detach().floor(), self.cells - 1)
        inside = scaled - low
        # Of the lower corner and the upper, along each axis: (N, levels, 2) each.
        x, y, z = torch.stack([1 - inside, inside], dim=-1).unbind(dim=-2)
        weights = (x[..., :, None, None] * y[..., None, :, None] * z[..., None, None, :]).flatten(-3)
        # One gather for all levels; where torch is to be deterministic its gradient adds in an order of its own.
        values = self.entries[self._entries(low.long())]  # (N, levels, 8, features)
        mixed = (weights[..., None] * values).sum(dim=-2)
        return mixed.reshape(*points.shape[:-1], self.channels)

    def _entries(self, low: Tensor) -> Tensor:
        """Entries (N, levels, 8) of the corners of cells whose lowest corners are (N, levels, 3), x slowest."""
        lower = low * self.steps
        x, y, z = torch.stack([lower, lower + self.steps], dim=-1).unbind(dim=-2)  # (N, levels, 2) each
        x, y, z = x[..., :, None, None], y[..., None, :, None], z[..., None, None, :]
        own, shared = slice(self.dense), slice(self.dense, None)
        # The low bits of a product are the same in 64 bits as in the 32 that overflow in the paper.
        hashed = (x[:, shared] ^ y[:, shared] ^ z[:, shared]) & (self.table - 1)
        found = torch.cat([x[:, own] + y[:, own] + z[:, own], hashed], dim=1).flatten(-3)
        return found + self.offsets[:, None]
