"""The networks of all parts of a room, side by side in the same tensors.

Ren et al. 2013, with the sizes of Gao et al. 2022, section 4.3: three hidden layers of 128, 64 and 32, 52 kB a part.
"""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import relu

PLACE, REST, FACING = 3, 16, 3
"""Inputs: place in the part; normal, direction to the viewer, centre of the light (3 each) and material (7); where the
light faces, for networks that are told it.
"""

WIDTHS = (128, 64, 32)
"""Of the hidden layers."""

CALM = 0.1
"""Of the first weights of the last layer: networks begin near the mean of their part."""

ROWS = 64
"""Points of one part that are computed together."""

AT_ONCE = 1 << 16
"""Points that are computed before others: what large frames need of memory."""


class CellNetworks(nn.Module):
    """A network for each cell, from so many numbers to a code of radiance."""

    def __init__(self, cells: int, inputs: int = PLACE + REST) -> None:
        """cells: how many. inputs: of each."""
        super().__init__()
        self.inputs = inputs
        widths = (inputs, *WIDTHS, 3)
        self.weights = nn.ParameterList()
        self.biases = nn.ParameterList()
        for layer, (before, after) in enumerate(pairwise(widths)):
            last = layer == len(widths) - 2
            bound = (6 / before) ** 0.5 * (CALM if last else 1)
            self.weights.append(nn.Parameter(torch.empty(cells, before, after).uniform_(-bound, bound)))
            self.biases.append(nn.Parameter(torch.zeros(cells, 1, after)))

    def begin_at(self, codes: Tensor) -> None:
        """Begin with the same code everywhere in a cell: the mean of what is to be learned. codes: (cells, 3)."""
        with torch.no_grad():
            self.biases[-1].copy_(codes[:, None])

    def forward(self, rows: Tensor, cells: Tensor | None = None) -> Tensor:
        """Codes (B, R, 3) of rows (B, R, inputs). cells: (B,), of which cell; all of them in order by default."""
        last = len(self.weights) - 1
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            if cells is not None:
                weight, bias = weight[cells], bias[cells]
            rows = torch.baddbmm(bias, rows, weight)
            if layer < last:
                rows = relu(rows)
        return rows

    def of_pairs(self, inputs: Tensor, cells: Tensor) -> Tensor:
        """Codes (P, 3) of single points (P, inputs), each of a cell (P,), in any order."""
        codes = inputs.new_zeros(len(inputs), 3)
        order = torch.argsort(cells, stable=True)
        for part in order.split(AT_ONCE):
            found, counts = torch.unique_consecutive(cells[part], return_counts=True)
            blocks = (counts + ROWS - 1) // ROWS
            # Where a point lies once each cell's points begin a block of their own.
            starts = (blocks.cumsum(0) - blocks) * ROWS
            before = counts.cumsum(0) - counts
            place = torch.arange(len(part), device=part.device) + (starts - before).repeat_interleave(counts)
            rows = inputs.new_zeros(int(blocks.sum()) * ROWS, self.inputs)
            rows[place] = inputs[part]
            out = self(rows.reshape(-1, ROWS, self.inputs), found.repeat_interleave(blocks))
            codes[part] = out.reshape(-1, 3)[place]
        return codes


def parameters_of_a_cell(inputs: int = PLACE + REST) -> int:
    """12,995 numbers, 51,980 bytes."""
    widths = (inputs, *WIDTHS, 3)
    return sum((before + 1) * after for before, after in pairwise(widths))
