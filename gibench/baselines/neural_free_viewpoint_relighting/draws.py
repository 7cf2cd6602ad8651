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

from gibench.baselines.relighting.examples import CODE, KEPT, Example, Examples, Light, Seen, evenly, some_of
from gibench.baselines.relighting.surfaces import MATERIAL
from gibench.baselines.wavelets.light import chosen_light, light_at
from gibench.baselines.wavelets.selection import Weighting, largest

CELLS = 64
"""Along each side of the grid in which light is compared between views."""

WEIGHTING: Weighting = "area"
"""By which the largest wavelets of a step are chosen, and those of a frame by default."""

MOST_SUMS = KEPT // 4
"""Bytes of sums of chances that are kept."""

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


class Important:
    """Examples with where to look in each, worked out once a frame: three rows of sums of chances, from pixel to pixel,
    by disagreement, by detail, and by how much and how sharply a surface reflects.
    """

    def __init__(self, examples: Examples) -> None:
        """examples: all of which are looked at here, for what they disagree about."""
        self.examples = examples
        self.disagreement = Disagreement(examples.seen(index) for index in range(len(examples)))
        self._kept: dict[int, NDArray[np.float32]] = {}
        self._bytes = 0

    def __len__(self) -> int:
        """How many."""
        return len(self.examples)

    def __getitem__(self, index: int) -> tuple[Seen, Light, NDArray[np.float32]]:
        """A frame, its light, and sums (3, N) of chances; those that fit into MOST_SUMS bytes are kept."""
        seen, light = self.examples[index]
        if index in self._kept:
            return seen, light, self._kept[index]
        sums = self._sums(seen)
        if self._bytes + sums.nbytes <= MOST_SUMS:
            self._kept[index] = sums
            self._bytes += sums.nbytes
        return seen, light, sums

    def _sums(self, seen: Seen) -> NDArray[np.float32]:
        _, _, roughness, _, specular = seen.material.float().split(list(MATERIAL.values()), dim=1)
        gloss = specular.mean(dim=1) * (1 - roughness[:, 0]).clamp(min=0)
        return sums_of(np.stack([self.disagreement.at(seen.points), seen.detail.numpy(), gloss.numpy()]))


def sums_of(chances: NDArray[np.floating]) -> NDArray[np.float32]:
    """(K, N) sums of chances (K, N) ≥ 0 up to each pixel and with it, in shares of all, for `_by_chance`.

    A row in which all are 0 becomes that of equal chances.
    """
    sums = np.cumsum(chances, axis=1, dtype=np.float64)
    if not sums.size:
        return sums.astype(np.float32)
    nothing = ~(sums[:, -1] > 0)
    sums[nothing] = np.arange(1, sums.shape[1] + 1)
    return (sums / sums[:, -1:]).astype(np.float32)


@dataclass(frozen=True)
class Draw:
    """Draws what a step sees of a frame (section 5).

    pixels: how many. Where an example comes with sums of chances, a quarter of them is drawn from all alike, and a
    quarter by each row of those. learned: how many wavelets, half of them the largest of the light times their area, a
    quarter of them of the NEXT ones, a quarter any others. What is learned must explain all of the light of a frame,
    and light of low frequency is most of that of a matt surface: so what a step is told of must hold it.
    """

    pixels: int
    learned: int

    def __call__(
        self,
        example: tuple[Seen, Light] | tuple[Seen, Light, NDArray[np.float32]],
        random: np.random.Generator,
    ) -> Example:
        """Of a frame and its light. One that sees no surface gives pixels that are black in truth."""
        seen, coefficients, *sums = example
        light = light_at(coefficients, self._places(coefficients, random))
        if not len(seen.points):
            seen = Seen(*(torch.zeros(1, *part.shape[1:]) for part in seen))
            light = light._replace(weights=np.zeros_like(light.weights))
        drawn = self._drawn(len(seen.points), sums[0] if sums and sums[0].size else None, random)
        truth, *surface = some_of(seen, torch.from_numpy(drawn))
        return Example(truth, (*surface, *map(torch.from_numpy, light)))

    def _places(self, coefficients: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.int64]:
        count = coefficients[..., 0].size
        learned = min(self.learned, count)
        first = max(1, learned // 2)
        further = min((learned - first) // 2, count - first)
        in_order = largest(coefficients, min(first + max(NEXT, further), count), WEIGHTING)
        chosen = np.concatenate([in_order[:first], random.choice(in_order[first:], further, replace=False)])
        left = np.ones(count, bool)
        left[chosen] = False
        rest = np.flatnonzero(left)
        return np.concatenate([chosen, random.choice(rest, learned - len(chosen), replace=False)])

    def _drawn(
        self, count: int, sums: NDArray[np.float32] | None, random: np.random.Generator
    ) -> NDArray[np.int64]:
        if sums is None:
            return random.integers(count, size=self.pixels)
        share = self.pixels // (1 + len(sums))
        drawn = [random.integers(count, size=self.pixels - len(sums) * share)]
        drawn += [_by_chance(row, share, random) for row in sums]
        return np.concatenate(drawn)


def _by_chance(sums: NDArray[np.float32], size: int, random: np.random.Generator) -> NDArray[np.int64]:
    """(size,) numbers, as often as sums of `sums_of` (N,) say. No array of N is made: random numbers of another type
    would have the sums converted.
    """
    found = np.searchsorted(sums, random.random(size, dtype=np.float32), side="right")
    return np.minimum(found, len(sums) - 1)


def spread(example: tuple[Seen, Light], pixels: int, wavelets: int) -> Example:
    """Pixels of a frame, evenly, and the wavelets that a frame is made from: what a training is judged by."""
    seen, coefficients = example
    truth, *surface = some_of(seen, evenly(seen, pixels))
    return Example(truth, (*surface, *map(torch.from_numpy, chosen_light(coefficients, wavelets, WEIGHTING))))
