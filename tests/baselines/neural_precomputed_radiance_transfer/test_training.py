"""The networks learn light that they are told of, and repeat to the bit."""

from __future__ import annotations

import numpy as np
import torch

from gibench.baselines.neural_precomputed_radiance_transfer.network import TransferNetwork
from gibench.baselines.neural_precomputed_radiance_transfer.training import RadianceTransfer
from gibench.baselines.relighting.examples import Seen
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.loop import train
from gibench.baselines.training.reproducible import seeded
from tests.baselines.neural_free_viewpoint_relighting.made import Made


class Pictures(Made):
    """The same surfaces under even light of some colour, which they reflect by half of their albedo."""

    def __init__(self, count=4, first=0):
        super().__init__(count, pixels=50, first=first)
        random = np.random.default_rng(first)
        frames = []
        for seen, _ in self.frames:
            color = random.uniform(0.2, 2.0, 3).astype(np.float32)
            picture = np.broadcast_to(color[:, None, None], (3, 128, 256)).copy()
            truth = 0.5 * torch.from_numpy(color) * seen.material[:, 7:10]
            frames.append((seen._replace(truth=truth), picture))
        self.frames = frames


def learnt(steps):
    with seeded(3):
        network = TransferNetwork()
    learner = RadianceTransfer(network, Pictures(), Pictures(2, first=100), 64, 3)
    return train(learner, learner.batches(), Budget(steps=steps, look_every=steps), seed=3)


def test_it_learns_and_repeats_to_the_bit():
    first, again = learnt(25), learnt(25)
    assert first.best.error < 0.7 * first.curve[0].error
    for name, tensor in first.weights["network"].items():
        assert torch.equal(tensor, again.weights["network"][name]), name


def test_frames_that_see_nothing():
    learner = RadianceTransfer(TransferNetwork(), Pictures(1), Pictures(1), 64, 3)
    seen, picture = Pictures(1)[0]
    empty = Seen(*(part[:0] for part in seen))
    example = learner.draw((empty, picture), np.random.default_rng(0))
    assert not example.truth.any()
    assert not example.inputs[3].any()
    assert learner.judged((empty, picture)).truth.numel() == 0
