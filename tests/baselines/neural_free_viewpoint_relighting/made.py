"""A made-up scene in the unit cube, whose indirect light is known."""

from __future__ import annotations

import numpy as np
import torch

from gibench.baselines.relighting.examples import Seen
from gibench.baselines.wavelets.haar import haar
from gibench.baselines.wavelets.light import weights_of

FACES = 4


class Made:
    """Frames under environments of noise. Each point of a plane sends on a quarter of the light from above, more of it
    the farther it is along x.
    """

    def __init__(self, count=6, pixels=200, first=0):
        self.frames = []
        for seed in range(first, first + count):
            random = np.random.default_rng(seed)
            points = random.uniform(size=(pixels, 3)).astype(np.float32)
            points[:, 2] = 0.5
            faces = random.gamma(0.5, size=(6, FACES, FACES, 3))
            coefficients = haar(faces)
            above = weights_of(coefficients, np.array([4 * FACES**2]))[0]
            truth = 0.25 * points[:, :1] * above
            material = np.tile([0, 0, 1, 0, 0, 1, 1.0, 0.5, 0.5, 0.5, 0, 0, 0], (pixels, 1))
            arrays = (points, material, truth, np.abs(points[:, 0] - 0.5))
            seen = Seen(*(torch.tensor(part, dtype=torch.float32) for part in arrays))
            self.frames.append((seen, coefficients))

    def __len__(self):
        return len(self.frames)

    def __getitem__(self, index):
        return self.frames[index]

    def seen(self, index):
        return self.frames[index][0]
