"""What a step learns from: pixels of a frame where it is worth looking, and wavelets of the light of that frame.

Inputs of an example are points, material, places (K,) of wavelets, and their weights (K, 3).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from gibench.baselines.relighting.examples import CODE, Example, Light, Seen, evenly, some_of
from gibench.baselines.relighting.surfaces import MATERIAL
from gibench.baselines.wavelets.light import chosen_light, light_at
from gibench.baselines.wavelets.selection import Weighting, largest

CELLS = 64
"""Along each side of the grid in which light is compared between views."""

WEIGHTING: Weighting = "area"
"""By which the largest wavelets of a step are chosen, and those of a frame by default."""

NEXT = 200
"""Wavelets that come after the largest ones of a step: of which frames of more wavelets than a step has are made."""


class Disagreement:
    """Where frames differ about the light of a place: variance of its code, in cells of the box.

    The mean of each frame is taken out first, so that a brighter environment is no disagreement.
    """

    def __init__(self, frames: Iterable[Seen]) -> None:
        """frames: all that there are."""
        self._sums = np.zeros((3, CELLS**3))
        for frame in frames:
            self.add(frame)

    def add(self, frame: Seen) -> None:
        """Count a frame in."""
        if not len(frame.points):
            return
        cells = _cells(frame.points)
        code = CODE.encode(frame.truth.float()).mean(dim=1).numpy().astype(np.float64)
        code -= code.mean()
        for number, values in enumerate((None, code, code**2)):
            self._sums[number] += np.bincount(cells, values, CELLS**3)

    def at(self, points: Tensor) -> NDArray[np.float64]:
        """(N,) variance at points (N, 3) of the unit cube, ≥ 0."""
        count, total, squares = self._sums[:, _cells(points)]
        count = np.maximum(count, 1)
        return np.asarray(np.maximum(squares / count - (total / count) ** 2, 0))


def _cells(points: Tensor) -> NDArray[np.int64]:
    x, y, z = (points.numpy() * CELLS).astype(np.int64).clip(0, CELLS - 1).T
    return np.asarray((x * CELLS + y) * CELLS + z)


@dataclass(frozen=True)
class Draw:
    """Draws what a step sees of a frame (section 5).

    pixels: how many. learned: how many wavelets, half of them the largest of the light times their area, a quarter of
    them of the NEXT ones, a quarter any others. What is learned must explain all of the light of a frame, and light of
    low frequency is most of that of a matt surface: so what a step is told of must hold it.
    disagreement: None to look at all pixels alike; otherwise a quarter of them is drawn so, and a quarter each by
    disagreement, by detail, and by how much and how sharply a surface reflects.
    """

    pixels: int
    learned: int
    disagreement: Disagreement | None

    def __call__(self, example: tuple[Seen, Light], random: np.random.Generator) -> Example:
        """Of a frame and its light. One that sees no surface gives pixels that are black in truth."""
        seen, coefficients = example
        light = light_at(coefficients, self._places(coefficients, random))
        if not len(seen.points):
            seen = Seen(*(torch.zeros(1, *part.shape[1:]) for part in seen))
            light = light._replace(weights=np.zeros_like(light.weights))
        truth, *surface = some_of(seen, torch.from_numpy(self._drawn(seen, random)))
        return Example(truth, (*surface, *map(torch.from_numpy, light)))

    def _places(self, coefficients: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.int64]:
        count = coefficients[..., 0].size
        learned = min(self.learned, count)
        first = max(1, learned // 2)
        further = min((learned - first) // 2, count - first)
        in_order = largest(coefficients, min(first + max(NEXT, further), count), WEIGHTING)
        chosen = np.concatenate([in_order[:first], random.choice(in_order[first:], further, replace=False)])
        rest = np.setdiff1d(np.arange(count), chosen, assume_unique=True)
        return np.concatenate([chosen, random.choice(rest, learned - len(chosen), replace=False)])

    def _drawn(self, seen: Seen, random: np.random.Generator) -> NDArray[np.int64]:
        count = len(seen.points)
        if self.disagreement is None:
            return random.integers(count, size=self.pixels)
        _, _, roughness, _, specular = seen.material.float().split(list(MATERIAL.values()), dim=1)
        gloss = specular.mean(dim=1) * (1 - roughness[:, 0]).clamp(min=0)
        chances = (self.disagreement.at(seen.points), seen.detail.numpy(), gloss.numpy())
        share = self.pixels // 4
        drawn = [random.integers(count, size=self.pixels - 3 * share)]
        drawn += [_by_chance(chance.astype(np.float64), share, random) for chance in chances]
        return np.concatenate(drawn)


def _by_chance(chance: NDArray[np.float64], size: int, random: np.random.Generator) -> NDArray[np.int64]:
    """(size,) numbers, as often as their chance ≥ 0 says; any where all are 0."""
    edges = np.cumsum(chance)
    if not edges[-1] > 0:
        return random.integers(len(chance), size=size)
    found = np.searchsorted(edges, random.random(size) * edges[-1], side="right")
    return np.minimum(found, len(chance) - 1)


def spread(example: tuple[Seen, Light], pixels: int, wavelets: int) -> Example:
    """Pixels of a frame, evenly, and the wavelets that a frame is made from: what a training is judged by."""
    seen, coefficients = example
    truth, *surface = some_of(seen, evenly(seen, pixels))
    return Example(truth, (*surface, *map(torch.from_numpy, chosen_light(coefficients, wavelets, WEIGHTING))))
