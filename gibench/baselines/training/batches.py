"""Batches of examples in a random order that can begin at any step.

Every example comes once before any comes again. Order and what is drawn for an example (its crop, its exposure) depend
on the seed and the step alone, never on how many processes load.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, Protocol

import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset

from gibench.baselines.training.errors import TrainingError
from gibench.baselines.training.loop import Batches

ORDER_LANE, DRAW_LANE = 2, 3
"""Of random numbers: of the order of each pass, and of what is drawn for an example of a step."""


class Examples(Protocol):
    """Anything with a length and examples by number, such as a `torch.utils.data.Dataset`."""

    def __len__(self) -> int:
        """Number of examples."""

    def __getitem__(self, index: int, /) -> Any:
        """An example: tensors, numbers, tuples or dicts of them."""


Draw = Callable[[Any, np.random.Generator], Any]
"""An example as a step sees it: cropped, flipped, brighter or darker."""


class Place(NamedTuple):
    """A place in a batch: the number of its example, that of the step, and which of the batch it is."""

    example: int
    step: int
    which: int


def order(count: int, size: int, seed: int, first: int = 0) -> Iterator[list[Place]]:
    """The batches of step first, first + 1 … without end. count: of examples, size: of a batch.

    A batch may begin with the last examples of one pass and end with the first ones of the next.
    """
    if count < 1 or size < 1:
        raise TrainingError(f"batches of {size} from {count} examples: both must be above 0")
    number, at = divmod(first * size, count)
    permutation = _permutation(count, seed, number)
    step = first
    while True:
        places = []
        for which in range(size):
            if at == count:
                number, at = number + 1, 0
                permutation = _permutation(count, seed, number)
            places.append(Place(int(permutation[at]), step, which))
            at += 1
        yield places
        step += 1


def batches(
    examples: Examples, size: int, seed: int, *, draw: Draw | None = None, processes: int = 0, ahead: int = 2
) -> Batches:
    """Batches of examples for `train`, stacked as `torch.utils.data.default_collate` does.

    draw: what is done with each example, with the random numbers of its place. processes: that load beside the
    training, 0 for none; each reads that many batches ahead. They are spawned, since a renderer's threads do not
    survive a fork, so examples and draw must be things that can be pickled.
    """

    def begin(first: int) -> Iterator[Any]:
        loader = DataLoader(
            _Drawn(examples, seed, draw),
            batch_sampler=_BatchSampler(len(examples), size, seed, first),
            num_workers=processes,
            prefetch_factor=ahead if processes else None,
            multiprocessing_context="spawn" if processes else None,
            # Else the loader draws from the random numbers that are shared with everything else.
            generator=torch.Generator(),
        )
        yield from loader

    return begin


def _permutation(count: int, seed: int, number: int) -> Any:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(ORDER_LANE, number))).permutation(
        count
    )


class _BatchSampler:
    """`order` as the sampler that a loader begins anew."""

    def __init__(self, *how: int) -> None:
        self.how = how

    def __iter__(self) -> Iterator[list[Place]]:
        return order(*self.how)


class _Drawn(Dataset[Any]):
    def __init__(self, examples: Examples, seed: int, draw: Draw | None) -> None:
        self.examples, self.seed, self.draw = examples, seed, draw

    def __getitem__(self, place: Place) -> Any:
        example = self.examples[place.example]
        if self.draw is None:
            return example
        lane = np.random.SeedSequence(self.seed, spawn_key=(DRAW_LANE, place.step, place.which))
        return self.draw(example, np.random.default_rng(lane))
