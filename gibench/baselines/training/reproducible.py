"""Equal bits for equal seeds."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch

LANE = 1
"""Of the random numbers of steps, apart from what a method draws from the same seed."""


@contextmanager
def deterministic() -> Iterator[None]:
    """Only algorithms of torch that give the same bits every time; one that has none raises RuntimeError."""
    before = torch.are_deterministic_algorithms_enabled()
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    torch.use_deterministic_algorithms(True)
    try:
        yield
    finally:
        torch.use_deterministic_algorithms(before)


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """Torch draws from this seed, and what others draw afterwards is as if it had not."""
    with torch.random.fork_rng(devices=range(torch.cuda.device_count())):
        torch.manual_seed(seed)
        yield


def random_of_step(seed: int, number: int) -> np.random.Generator:
    """The random numbers of a step; torch's own are seeded from the same."""
    sequence = np.random.SeedSequence(seed, spawn_key=(LANE, number))
    drawn = int(sequence.generate_state(1, np.uint64)[0])
    # `torch.manual_seed` keeps a traceback for every kind of device that is not there: 5 ms a step, and never freed.
    torch.default_generator.manual_seed(drawn)
    if torch.cuda.is_initialized():
        torch.cuda.manual_seed_all(drawn)
    return np.random.default_rng(sequence)
