"""A room in parts: a kd-tree over the surface points that training frames see.

Ren et al. 2013 split a part until its network errs little enough, which takes a training for each try. Here the part
whose indirect light varies most about its mean, over all of its points, is split next, at the median along its longest
side, until there are as many as asked for. Close to a splitting plane both sides count, with weights that add up to 1:
so what is blended has no seams.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

OVERLAP = 0.2
"""Width of the region where two parts are blended, in widths of the narrower one across the plane."""

FEWEST = 32
"""Points of a part."""


class Pairs(NamedTuple):
    """Points with the cells that they lie in, (P,) each. weight: in (0, 1], whose sum over a point's pairs is 1."""

    point: Tensor
    cell: Tensor
    weight: Tensor


@dataclass(frozen=True)
class Partition:
    """Nodes of a tree, the root first.

    axis, plane, margin: (N,) of the plane that splits a node, and how far to each side of it both count, m. below:
    (N, 2) nodes on the lower and the upper side, or −1 − the number of a cell. centre, half: (C, 3) of the boxes of the
    cells' points, m.
    """

    axis: Tensor
    plane: Tensor
    margin: Tensor
    below: Tensor
    centre: Tensor
    half: Tensor

    @property
    def cells(self) -> int:
        """How many."""
        return len(self.centre)

    def to(self, device: str | torch.device) -> Partition:
        """The same there."""
        return Partition(*(getattr(self, name).to(device) for name in self.__dataclass_fields__))

    def tensors(self) -> dict[str, Tensor]:
        """To be kept with weights."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}

    def pairs(self, points: Tensor) -> Pairs:
        """The cells that points (M, 3) lie in, one or a few each, in the order of the tree."""
        number = torch.arange(len(points), device=points.device)
        node, weight = torch.zeros_like(number), torch.ones_like(points[:, 0])
        done: list[Pairs] = []
        if not len(points) or not len(self.axis):
            return Pairs(number, node, weight)
        while len(number):
            place = points[number, self.axis[node]] - self.plane[node]
            margin = self.margin[node]
            upper = torch.where(margin > 0, 0.5 + place / (2 * margin).clamp(min=1e-30), (place > 0).float())
            upper = upper.clamp(0, 1)
            shares = torch.stack([1 - upper, upper])
            kept = shares > 0
            weight = torch.cat([(weight * share)[k] for share, k in zip(shares, kept, strict=True)])
            number = torch.cat([number[k] for k in kept])
            node = torch.cat([self.below[node, side][k] for side, k in enumerate(kept)])
            leaf = node < 0
            done.append(Pairs(number[leaf], -1 - node[leaf], weight[leaf]))
            number, node, weight = number[~leaf], node[~leaf], weight[~leaf]
        return Pairs(*(torch.cat(parts) for parts in zip(*done, strict=True)))


def partitioned(points: Tensor, codes: Tensor, cells: int) -> Partition:
    """The parts of a room: as many as asked for, or as its points allow.

    points: (M, 3), m. codes: of their indirect light, (M, 3). Without a point there is one part.
    """
    leaves: list[Tensor] = [torch.arange(len(points))]
    heap = [(-_variation(codes), 0)]
    rows: list[list[float]] = []  # axis, plane, margin
    below: list[list[int]] = []
    parent: dict[int, tuple[int, int]] = {}
    while len(leaves) < cells and heap:
        _, leaf = heapq.heappop(heap)
        found = _split(points[leaves[leaf]])
        if found is None:
            continue
        axis, plane, margin, upper = found
        node, other = len(rows), len(leaves)
        rows.append([axis, plane, margin])
        below.append([-1 - leaf, -1 - other])
        if leaf in parent:
            above, side = parent[leaf]
            below[above][side] = node
        parent[leaf], parent[other] = (node, 0), (node, 1)
        inside = leaves[leaf]
        leaves[leaf] = inside[~upper]
        leaves.append(inside[upper])
        for child in (leaf, other):
            heapq.heappush(heap, (-_variation(codes[leaves[child]]), child))
    table = torch.tensor(rows, dtype=torch.float64).reshape(-1, 3)
    boxes = [_box(points[inside]) for inside in leaves]
    return Partition(
        table[:, 0].long(),
        table[:, 1].float(),
        table[:, 2].float(),
        torch.tensor(below, dtype=torch.long).reshape(-1, 2),
        torch.stack([centre for centre, _ in boxes]),
        torch.stack([half for _, half in boxes]),
    )


def _variation(codes: Tensor) -> float:
    """Sum of squared differences from the mean."""
    return float((codes.double() - codes.double().mean(dim=0)).square().sum()) if len(codes) else 0.0


def _box(points: Tensor) -> tuple[Tensor, Tensor]:
    if not len(points):
        return torch.zeros(3), torch.ones(3)
    low, high = points.amin(dim=0), points.amax(dim=0)
    # What is flat has a box all the same: across it places differ by rounding alone.
    half = (high - low) / 2
    return (low + high) / 2, half.clamp(min=max(0.01 * float(half.max()), 1e-4))


def _split(points: Tensor) -> tuple[int, float, float, Tensor] | None:
    """Axis, plane, margin and which points (M, 3) are above; None where there are too few, or all at one place."""
    if len(points) < 2 * FEWEST:
        return None
    extent = points.amax(dim=0) - points.amin(dim=0)
    axis = int(extent.argmax())
    place = points[:, axis]
    plane = float(place.median())
    upper = place > plane
    if not upper.any():  # more than half of them at the upper end
        upper = place >= plane
    above = int(upper.sum())
    if min(above, len(points) - above) < FEWEST:
        return None
    low, high = place[~upper].max(), place[upper].min()
    plane = 0.5 * (float(low) + float(high))
    narrower = min(plane - float(place.min()), float(place.max()) - plane)
    return axis, plane, 0.5 * OVERLAP * narrower, upper
