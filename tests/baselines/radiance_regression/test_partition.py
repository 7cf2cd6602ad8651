"""A room in parts: where they are split, and weights that add up to 1 everywhere."""

from __future__ import annotations

import pytest
import torch

from gibench.baselines.radiance_regression.partition import FEWEST, partitioned


def points(count=4000, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(count, 3, generator=generator) * torch.tensor([4.0, 3.0, 2.5])


def codes_of(place):
    """Detail in the corner at the origin."""
    return torch.sin(20 * place) * (place.norm(dim=1, keepdim=True) < 1)


def whole(pairs, count):
    return torch.zeros(count).index_add_(0, pairs.point, pairs.weight)


@pytest.mark.parametrize("cells", [1, 2, 7, 64])
def test_weights_add_up_to_one_wherever_a_point_is(cells):
    place = points()
    partition = partitioned(place, codes_of(place), cells)
    assert partition.cells == cells
    for where in (place, place[:0], points(500, 1) * 3 - 4, torch.zeros(1, 3), torch.full((1, 3), 1e9)):
        pairs = partition.pairs(where)
        torch.testing.assert_close(whole(pairs, len(where)), torch.ones(len(where)))
        assert (pairs.weight > 0).all()
        assert ((pairs.cell >= 0) & (pairs.cell < cells)).all()
    # Most points lie in one part alone, and no part is without any.
    pairs = partition.pairs(place)
    assert len(pairs.point) < 2 * len(place)
    assert torch.bincount(pairs.cell, minlength=cells).min() >= min(FEWEST, len(place))


def test_weights_are_continuous():
    place = points()
    partition = partitioned(place, codes_of(place), 16)
    way = torch.linspace(0, 1, 4001)[:, None] * torch.tensor([4.0, 3.0, 2.5])
    pairs = partition.pairs(way)
    weights = torch.zeros(len(way), partition.cells).index_put_((pairs.point, pairs.cell), pairs.weight)
    assert (weights[1:] - weights[:-1]).abs().max() < 0.05


def test_parts_are_smallest_where_light_varies_most():
    place = points(40_000)
    partition = partitioned(place, codes_of(place), 32)
    size = partition.half.prod(dim=1)
    near = partition.centre.norm(dim=1) < 1
    assert near.sum() > 10
    assert size[near].mean() < 0.2 * size[~near].mean()


def test_cells_hold_their_points():
    place = points()
    partition = partitioned(place, codes_of(place), 16)
    pairs = partition.pairs(place)
    own = pairs.weight >= 0.5
    local = (place[pairs.point] - partition.centre[pairs.cell]) / partition.half[pairs.cell]
    assert local[own].abs().max() <= 1 + 1e-4
    assert local.abs().max() < 2


@pytest.mark.parametrize("count", [0, 1, 1000])
def test_rooms_that_cannot_be_split_are_one_part(count):
    place = torch.ones(count, 3)
    partition = partitioned(place, torch.zeros_like(place), 64)
    assert partition.cells == 1
    pairs = partition.pairs(torch.tensor([[0.0, 5.0, 1.0], [1.0, 1.0, 1.0]]))
    assert pairs.weight.tolist() == [1, 1]
    assert pairs.cell.tolist() == [0, 0]
    assert torch.isfinite(partition.half).all()


def test_a_flat_room_and_one_with_most_points_at_its_end():
    flat = points()
    flat[:, 2] = 0
    partition = partitioned(flat, codes_of(flat), 16)
    assert partition.cells == 16
    assert not (partition.axis == 2).any()
    heap = points()
    heap[500:] = heap[:500].amax(dim=0)
    partition = partitioned(heap, codes_of(heap), 4)
    torch.testing.assert_close(whole(partition.pairs(heap), len(heap)), torch.ones(len(heap)))
    beside = torch.zeros(1000, 3)
    beside[:5, 0] = 1  # too few to be a part
    assert partitioned(beside, codes_of(beside), 4).cells == 1


def test_splits_repeat():
    place = points()
    first, again = (partitioned(place, codes_of(place), 32) for _ in range(2))
    for name, tensor in first.tensors().items():
        assert torch.equal(tensor, again.tensors()[name])
