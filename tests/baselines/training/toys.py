"""Learners that are small enough to be trained in a test."""

from __future__ import annotations

import numpy as np
import torch
from torch import nn

from gibench.baselines.training.batches import batches
from gibench.baselines.training.learner import Learner
from gibench.baselines.training.reproducible import seeded
from gibench.baselines.training.schedule import half_cosine, set_rate


class Points(torch.utils.data.Dataset):
    """A curve, to be learned from noisy points."""

    def __init__(self, count=37):
        self.x = torch.linspace(-1, 1, count)[:, None]
        self.y = torch.sin(3 * self.x)

    def __len__(self):
        return len(self.x)

    def __getitem__(self, index):
        return self.x[index], self.y[index]


def noisy(example, random):
    x, y = example
    return x, y + 0.1 * torch.tensor(random.normal(size=y.shape), dtype=torch.float32)


def points(seed=5, size=4, processes=0):
    return batches(Points(), size, seed, draw=noisy, processes=processes)


class Fit(Learner):
    """One network, with dropout so that torch draws random numbers of its own, and a random number of the step."""

    def __init__(self, seed=1, rate=5e-2):
        with seeded(seed):
            network = nn.Sequential(nn.Linear(1, 16), nn.Tanh(), nn.Dropout(0.1), nn.Linear(16, 1))
        self.rate = rate
        super().__init__({"fit": network}, {"fit": torch.optim.Adam(network.parameters())})

    def step(self, batch, now):
        x, y = batch
        set_rate(self.optimisers["fit"], self.rate * half_cosine(now.progress))
        loss = (self.networks["fit"](x + 0.01 * float(now.random.normal())) - y).square().mean()
        self.descend("fit", loss, largest_gradient=1.0)
        return {"squared error": loss}

    def error(self):
        whole = Points()
        return (self.networks["fit"](whole.x) - whole.y).abs().mean()


class Duel(Learner):
    """A generator and a discriminator with an optimiser each; only the first is kept."""

    def __init__(self, seed=1):
        with seeded(seed):
            networks = {"generator": nn.Linear(1, 1), "discriminator": nn.Linear(1, 1)}
        super().__init__(
            networks,
            {name: torch.optim.Adam(net.parameters(), 1e-2) for name, net in networks.items()},
            product=("generator",),
        )

    def step(self, batch, now):
        x, y = batch
        made = self.networks["generator"](x)
        judge = self.networks["discriminator"]
        judged = (
            nn.functional.softplus(-judge(y)).mean() + nn.functional.softplus(judge(made.detach())).mean()
        )
        self.descend("discriminator", judged)
        fooled = (made - y).abs().mean() + 0.1 * nn.functional.softplus(-judge(made)).mean()
        self.descend("generator", fooled)
        return {"generator": fooled, "discriminator": judged}

    def error(self):
        whole = Points()
        return (self.networks["generator"](whole.x) - whole.y).abs().mean()


def flat(weights):
    """All numbers of a training in one vector."""
    return torch.cat([value.flatten() for one in weights.values() for value in one.values()])


def everything(learner):
    """The learner's own state as bytes, to compare bit by bit."""
    found = []

    def collect(value):
        if isinstance(value, torch.Tensor):
            found.append(np.asarray(value.detach()).tobytes())
        elif isinstance(value, dict):
            for key in sorted(value, key=str):
                collect(value[key])
        elif isinstance(value, (list, tuple)):
            for one in value:
                collect(one)
        else:
            found.append(repr(value).encode())

    collect(learner.state())
    return b"|".join(found)
