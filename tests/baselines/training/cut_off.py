"""A training that is made twice, and once more cut off and resumed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from gibench.baselines.training.budget import Budget
from gibench.baselines.training.checkpoints import Checkpoint
from gibench.baselines.training.learner import Learner
from gibench.baselines.training.loop import Batches, train

STEPS, LAST = 8, 5
"""Of a whole training, and of one that is cut off."""


def repeats_also_where_it_was_cut_off(
    make: Callable[[], Learner], batches: Callable[[Learner], Batches], folder: Path, seed: int = 3
) -> None:
    """All three come to the same weights, to the bit. make: a new learner. batches: what it learns from."""
    budget = Budget(steps=STEPS, look_every=STEPS)
    begun = []

    def checkpoint():
        return Checkpoint(folder / "state", {"of": "test"}, every=0)

    def learnt(last=STEPS, checkpoint=None):
        learner = make()

        def drawn(first):
            begun.append(first)
            for number, batch in enumerate(batches(learner)(first), first):
                if number == last:
                    raise KeyboardInterrupt
                yield batch

        return train(learner, drawn, budget, seed=seed, checkpoint=checkpoint)

    whole, again = learnt(), learnt()
    with pytest.raises(KeyboardInterrupt):
        learnt(LAST, checkpoint())
    resumed = learnt(checkpoint=checkpoint())
    assert begun == [0, 0, 0, LAST]
    assert resumed.steps == whole.steps == STEPS
    assert whole.weights
    for network, tensors in whole.weights.items():
        for name, tensor in tensors.items():
            assert torch.equal(tensor, again.weights[network][name]), name
            assert torch.equal(tensor, resumed.weights[network][name]), name
