"""Batches: every example as often as any other, the same whoever loads, from any step on."""

from __future__ import annotations

import itertools
from collections import Counter

import pytest
import torch

from gibench.baselines.training.batches import batches, order
from gibench.baselines.training.errors import TrainingError
from tests.baselines.training.toys import Points, noisy, points


@pytest.mark.parametrize(("count", "size"), [(10, 2), (10, 3), (3, 10), (1, 1), (7, 7)])
def test_every_example_comes_once_before_any_comes_again(count, size):
    places = itertools.chain.from_iterable(itertools.islice(order(count, size, 1), 5 * count))
    found = [place.example for place in places]
    for number in range(0, len(found) - count, count):
        assert sorted(found[number : number + count]) == list(range(count))
    assert max(Counter(found).values()) - min(Counter(found).values()) <= 1


@pytest.mark.parametrize("first", [0, 1, 5, 23])
def test_it_can_begin_at_any_step(first):
    whole = list(itertools.islice(order(10, 3, 1), 30))
    assert list(itertools.islice(order(10, 3, 1, first), 30 - first)) == whole[first:]


def test_passes_and_seeds_differ():
    first, second = (
        [place.example for batch in itertools.islice(order(20, 20, 1, step), 1) for place in batch]
        for step in (0, 1)
    )
    assert first != second
    other = [place.example for place in next(order(20, 20, 2))]
    assert other != first


def test_what_is_drawn_depends_on_the_place_alone():
    alone = list(itertools.islice(points()(0), 12))
    beside = list(itertools.islice(points(processes=2)(0), 12))
    late = list(itertools.islice(points()(7), 5))
    for given, expected in ((beside, alone), (late, alone[7:])):
        assert all(
            torch.equal(a, b)
            for one, other in zip(given, expected, strict=True)
            for a, b in zip(one, other, strict=True)
        )
    assert not torch.equal(alone[0][1], next(points(seed=6)(0))[1])


def test_loading_leaves_the_random_numbers_of_others_alone():
    torch.manual_seed(3)
    expected = torch.rand(1)
    torch.manual_seed(3)
    next(iter(batches(Points(), 4, 0, draw=noisy)(0)))
    assert torch.rand(1) == expected


def test_without_drawing_examples_are_as_they_are():
    x, y = next(iter(batches(Points(4), 4, 0)(0)))
    assert torch.equal(x.sort(0).values, Points(4).x)
    assert torch.allclose(y, torch.sin(3 * x))


@pytest.mark.parametrize(("count", "size"), [(0, 2), (3, 0)])
def test_nothing_to_learn_from_is_named(count, size):
    with pytest.raises(TrainingError, match=f"batches of {size} from {count}"):
        next(order(count, size, 0))
