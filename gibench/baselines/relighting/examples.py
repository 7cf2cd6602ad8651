"""Training frames of a scene under environments, pixel by pixel, for networks that look at one surface at a time."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import torch
from numpy.typing import NDArray
from torch import Tensor

from gibench.baselines.image_to_image.frames import Frames, spaced
from gibench.baselines.relighting import CHANNELS
from gibench.baselines.relighting.surfaces import Box, hit, surfaces
from gibench.baselines.training.codes import MuLaw
from gibench.baselines.training.errors import TrainingError
from gibench.baselines.training_set import TrainingSet
from gibench.rendering.lighting import EnvironmentMap

CODE = MuLaw(mu=10.0)
"""Of exposed radiance, in which what is held out is compared, whatever a method trains for (Raghavan et al. 2023,
section 5). The published ε was lost; 1 alone is continuous.
"""

BLUR = 9
"""Pixels along the square that high frequencies are told from the rest by."""

BRIGHTEST = 3e4
"""Exposed radiance that half precision still holds."""

KEPT = 1 << 30
"""Bytes of frames that are kept in memory, so that none is read and put together twice."""

ENVIRONMENTS = 512
"""Whose light is kept."""

MEASURED = 64
"""Training frames that say how large the scene is."""

Light = NDArray[Any]
"""Of an environment, as a method takes it; linear in radiance."""


class Seen(NamedTuple):
    """The pixels of a frame that see a surface. points: (N, 3) in the unit cube. material: (N, 13). truth: (N, 3),
    exposed indirect radiance. detail: (N,), what of its code is of high frequency.
    """

    points: Tensor
    material: Tensor
    truth: Tensor
    detail: Tensor


class Example(NamedTuple):
    """Some pixels of a frame. truth: (N, 3), exposed indirect radiance. inputs: of a network, points (N, 3) and
    material (N, 13) first, then the light, exposed too.
    """

    truth: Tensor
    inputs: tuple[Tensor, ...]

    def on(self, device: torch.device | str) -> Example:
        """The same on a device."""
        return Example(self.truth.to(device), tuple(part.to(device) for part in self.inputs))


class Examples:
    """Frames of a scene, by number; what of them was read is kept."""

    def __init__(
        self,
        views: TrainingSet,
        numbers: Sequence[int],
        box: Box,
        light_of: Callable[[EnvironmentMap], Light],
    ) -> None:
        """numbers: of the views that these are, with CHANNELS. light_of: what a method takes of an environment."""
        self.views, self.numbers, self.box = views, list(numbers), box
        self.frames = Frames(views, CHANNELS, self.numbers)
        self._kept: OrderedDict[int, Seen] = OrderedDict()
        self._bytes = 0
        self._light = lru_cache(maxsize=ENVIRONMENTS)(light_of)

    def __len__(self) -> int:
        """How many."""
        return len(self.numbers)

    def __getitem__(self, index: int) -> tuple[Seen, Light]:
        """A frame, and its exposed light."""
        light = self._light(environment_at(self.views, self.numbers[index]))
        return self.seen(index), light * self.frames.exposure(index)

    def read(self) -> None:
        """Read all that is kept in memory, and take the light of it: so that no clock is on while it is first read."""
        for index in range(len(self)):
            self[index]
            if index not in self._kept:
                break

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
        pixels = surfaces(images, self.frames.camera(index), seen)
        truth = (images["indirect_diffuse"] + images["indirect_specular"]) * self.frames.exposure(index)
        code = CODE.encode(truth).mean(dim=0, keepdim=True)
        detail = (code - _blurred(code)).abs()[0]
        halves = (pixels.material, truth[:, seen].T.clamp(max=BRIGHTEST), detail[seen])
        return Seen(self.box.inside(pixels.places), *(part.half() for part in halves))


def some_of(seen: Seen, pixel: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Truth, points and material of some pixels, by number, in single precision."""
    # `index_select` starts no threads for a few hundred rows; plain indexing does, and waits for them.
    truth, points, material = (
        part.index_select(0, pixel).float() for part in (seen.truth, seen.points, seen.material)
    )
    return truth, points, material


def evenly(seen: Seen, most: int) -> Tensor:
    """Numbers of pixels, `most` of them at most, spread over a frame."""
    return torch.tensor(spaced(range(len(seen.points)), most), dtype=torch.int64)


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


def box_of(views: TrainingSet, numbers: Sequence[int]) -> Box:
    """The box of the places that some of the frames see."""
    frames = Frames(views, ("position", "normal"), spaced(numbers, MEASURED))
    read = (frames[index] for index in range(len(frames)))
    return Box.around(images["position"][:, hit(images)].T for images in read)


def _blurred(code: Tensor) -> Tensor:
    return torch.nn.functional.avg_pool2d(code, BLUR, stride=1, padding=BLUR // 2, count_include_pad=False)
