"""Learned features of positions, on grids of rising resolution (Müller et al. 2022, Instant NGP)."""

from __future__ import annotations

import math
from itertools import product
from typing import Any

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
        own = self.resolutions[: self.dense]
        steps: list[tuple[int, ...]] = [(1, cells + 1, (cells + 1) ** 2) for cells in own]
        # Of a product, the low bits are all that counts, and they are those of the product of low bits.
        steps += [tuple(prime % table for prime in PRIMES)] * (levels - self.dense)
        starts = [sum(self.sizes[:level]) for level in range(levels)]
        largest = max((self.resolutions[-1] + 1) * table, sum(self.sizes))
        whole = torch.int32 if largest < 2**31 else torch.int64
        self.register_buffer("offsets", torch.tensor(starts, dtype=whole)[:, None], persistent=False)
        self.register_buffer("cells", torch.tensor(self.resolutions)[:, None], persistent=False)
        self.register_buffer("steps", torch.tensor(steps, dtype=whole).T[..., None], persistent=False)
        self.entries = nn.Parameter(torch.empty(sum(self.sizes), features).uniform_(-INITIAL, INITIAL))

    @property
    def channels(self) -> int:
        """Features of a point."""
        return len(self.resolutions) * self.features

    def forward(self, points: Tensor) -> Tensor:
        """(…, 3) in [0, 1], clamped to it, to (…, levels · features)."""
        # Points come last, so that all that is done level by level and corner by corner runs along them.
        scaled = points.reshape(-1, 3).T[:, None].clamp(0, 1) * self.cells  # (3, levels, N)
        low = torch.minimum(scaled.detach().floor(), self.cells - 1)
        inside = scaled - low
        along_x, along_y, along_z = zip(1 - inside, inside, strict=True)
        weights = [xy * z for xy in (x * y for x in along_x for y in along_y) for z in along_z]
        found = _Interpolated.apply(self.entries, self._corners(low), torch.stack(weights, dim=-1))
        return found.movedim(0, 1).reshape(*points.shape[:-1], self.channels)

    def _corners(self, low: Tensor) -> Tensor:
        """Entries (levels, N, 8) of the corners of cells whose lowest corners are (3, levels, N), x slowest."""
        lower = low.to(self.steps.dtype) * self.steps
        own, shared = slice(self.dense), slice(self.dense, None)
        along_x, along_y, along_z = zip(lower, lower + self.steps, strict=True)
        found = []
        for x, y, z in product(along_x, along_y, along_z):
            hashed = (x[shared] ^ y[shared] ^ z[shared]) & (self.table - 1)
            found.append(torch.cat([x[own] + y[own] + z[own], hashed]) + self.offsets)
        return torch.stack(found, dim=-1)


class _Interpolated(torch.autograd.Function):
    """Sums of entries (E, F) by their numbers (L, N, 8) and weights (L, N, 8): (L, N, F).

    torch's own sum of bags of rows, without an array of all rows; its own gradient takes longer than the rest of a
    step of a small network.
    """

    @staticmethod
    def forward(ctx: Any, entries: Tensor, numbers: Tensor, weights: Tensor) -> Tensor:
        ctx.save_for_backward(entries, numbers, weights)
        found = nn.functional.embedding_bag(
            numbers.flatten(0, 1), entries, per_sample_weights=weights.flatten(0, 1), mode="sum"
        )
        return found.view(*numbers.shape[:2], entries.shape[1])

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, None, Tensor | None]:
        entries, numbers, weights = ctx.saved_tensors
        gradient = gradients[0][..., None, :]
        of_entries = of_weights = None
        if ctx.needs_input_grad[0]:
            features = entries.shape[1]
            places = numbers.long()[..., None] * features + torch.arange(features, device=numbers.device)
            shares = weights[..., None] * gradient
            of_entries = entries.new_zeros(entries.numel())
            of_entries = of_entries.scatter_add_(0, places.flatten(), shares.flatten()).view_as(entries)
        if ctx.needs_input_grad[2]:
            of_weights = (entries[numbers.long()] * gradient).sum(dim=-1)
        return of_entries, None, of_weights
