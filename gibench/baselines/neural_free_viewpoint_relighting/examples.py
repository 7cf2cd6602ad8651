"""What a step learns from: pixels of a frame where it is worth looking, and wavelets of the light of that frame."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from gibench.baselines.image_to_image.frames import Frames
from gibench.baselines.neural_free_viewpoint_relighting import METHOD
from gibench.baselines.neural_free_viewpoint_relighting.inputs import MATERIAL, Box, Pixels, hit, surfaces
from gibench.baselines.training.codes import MuLaw
from gibench.baselines.training.errors import TrainingError
from gibench.baselines.training_set import TrainingSet
from gibench.baselines.wavelets.light import chosen_light, coefficients_of, light_at
from gibench.baselines.wavelets.selection import largest
from gibench.rendering.lighting import EnvironmentMap

CODE = MuLaw(mu=10.0)
"""Of exposed radiance, in which differences are taken (equation 8). The published ε was lost; 1 alone is continuous."""

CELLS = 64
"""Along each side of the grid in which light is compared between views."""

BLUR = 9
"""Pixels along the square that high frequencies are told from the rest by."""

KEPT = 1 << 30
"""Bytes of frames that are kept in memory, so that none is read and put together twice."""

ENVIRONMENTS = 1024
"""Of which the wavelets are kept."""


class Seen(NamedTuple):
    """The pixels of a frame that see a surface. points: (N, 3) in the unit cube. material: (N, 13). truth: (N, 3),
    exposed indirect radiance. detail: (N,), what of its code is of high frequency.
    """

    points: Tensor
    material: Tensor
    truth: Tensor
    detail: Tensor


class Example(NamedTuple):
    """Some pixels (N, …) as in `Seen`, and light: places (K,) and weights (K, 3) of wavelets, exposed as the truth."""

    points: Tensor
    material: Tensor
    truth: Tensor
    places: Tensor
    light: Tensor


class Examples:
    """Frames of a scene, by number; what of them was read is kept."""

    def __init__(self, views: TrainingSet, numbers: Sequence[int], box: Box, faces: int) -> None:
        """numbers: of the views that these are, lit by environments, with indirect light and SURFACE. faces: texels
        along a face of the cubemap.
        """
        self.views, self.numbers, self.box = views, list(numbers), box
        self.frames = Frames(views, METHOD.channels, self.numbers)
        self._kept: OrderedDict[int, Seen] = OrderedDict()
        self._bytes = 0
        self.coefficients = lru_cache(maxsize=ENVIRONMENTS)(lambda light: coefficients_of(light, faces))

    def __len__(self) -> int:
        """How many."""
        return len(self.numbers)

    def __getitem__(self, index: int) -> tuple[Seen, NDArray[np.float64]]:
        """A frame, and the exposed coefficients (6, S, S, 3) of its light."""
        light = self.coefficients(environment_at(self.views, self.numbers[index]))
        return self.seen(index), light * self.frames.exposure(index)

    def seen(self, index: int) -> Seen:
        """A frame, read or taken from memory."""
        if index not in self._kept:
            found = self._read(index)
            size = sum(part.numel() * part.element_size() for part in found)
            if self._bytes + size > KEPT:
                return found
            self._kept[index] = found
            self._bytes += size
        return self._kept[index]

    def _read(self, index: int) -> Seen:
        images = self.frames[index]
        seen = hit(images)
        pixels: Pixels = surfaces(images, self.frames.camera(index), seen)
        truth = (images["indirect_diffuse"] + images["indirect_specular"]) * self.frames.exposure(index)
        code = CODE.encode(truth).mean(dim=0, keepdim=True)
        detail = (code - _blurred(code)).abs()[0]
        halves = (pixels.material, truth[:, seen].T.clamp(max=3e4), detail[seen])
        return Seen(self.box.inside(pixels.places), *(part.half() for part in halves))


def environment_at(views: TrainingSet, number: int) -> EnvironmentMap:
    """The light of a frame. Raises TrainingError where no environment lights it."""
    frame = views[number]
    environment = frame.lighting.environment
    if environment is None:
        raise TrainingError(
            f"training frame {frame.row['file']} is not lit by an environment: make the dataset with "
            "--lighting environments"
        )
    return environment


def _blurred(code: Tensor) -> Tensor:
    return torch.nn.functional.avg_pool2d(code, BLUR, stride=1, padding=BLUR // 2, count_include_pad=False)


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

    pixels: how many. learned: how many wavelets, half of them the largest of the light, half of them any others.
    disagreement: None to look at all pixels alike; otherwise a quarter of them is drawn so, and a quarter each by
    disagreement, by detail, and by how much and how sharply a surface reflects.
    """

    pixels: int
    learned: int
    disagreement: Disagreement | None

    def __call__(self, example: tuple[Seen, NDArray[np.float64]], random: np.random.Generator) -> Example:
        """Of a frame and its light. One that sees no surface gives pixels that are black in truth."""
        seen, coefficients = example
        places = self._places(coefficients, random)
        light = light_at(coefficients, places)
        if not len(seen.points):
            seen = Seen(*(torch.zeros(1, *part.shape[1:]) for part in seen))
            light = light._replace(weights=np.zeros_like(light.weights))
        pixel = torch.from_numpy(self._drawn(seen, random))
        return Example(
            seen.points[pixel],
            seen.material[pixel].float(),
            seen.truth[pixel].float(),
            torch.from_numpy(light.places),
            torch.from_numpy(light.weights),
        )

    def _places(self, coefficients: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.int64]:
        count = coefficients[..., 0].size
        learned = min(self.learned, count)
        first = largest(coefficients, max(1, learned // 2))
        rest = np.setdiff1d(np.arange(count), first, assume_unique=True)
        return np.concatenate([first, random.choice(rest, learned - len(first), replace=False)])

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


def spread(example: tuple[Seen, NDArray[np.float64]], pixels: int, wavelets: int) -> Example:
    """Pixels of a frame, evenly, and the wavelets that a frame is made from: what a training is judged by."""
    seen, coefficients = example
    light = chosen_light(coefficients, wavelets, "area")
    count = min(pixels, len(seen.points))
    some = torch.arange(count) * len(seen.points) // max(count, 1)
    return Example(
        seen.points[some],
        seen.material[some].float(),
        seen.truth[some].float(),
        torch.from_numpy(light.places),
        torch.from_numpy(light.weights),
    )
