"""References of a scene: what a frame is scored against, and what is known of the truth behind it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench import metrics
from gibench.benchmarks.scenes import SceneFiles
from gibench.benchmarks.track import CHANNELS_OF, SAMPLES_OF
from gibench.datasets.exr import present_channels

Parts = dict[str, NDArray[np.float32]]
"""Images (H, W, 3) of linear radiance by part, those whose channels are stored."""


@dataclass(frozen=True, eq=False)
class Reference:
    """The two renderings of a frame. halves: as they are, denoised where the track says so. samples: as they were
    sampled, empty where that is not kept."""

    halves: tuple[Parts, Parts]
    samples: tuple[Parts, Parts]

    @property
    def parts(self) -> Parts:
        """What predictions are scored against: the mean of the two."""
        first, second = self.halves
        return {part: 0.5 * (image + second[part]) for part, image in first.items()}

    def truths(self, exposure: float) -> dict[str, metrics.Truth]:
        """What is known of the truth, by part; of parts without samples nothing is."""
        (a, b), (s, t) = self.halves, self.samples
        return {
            part: metrics.Truth(samples=(s[part], t[part]), halves=(a[part], b[part]), exposure=exposure)
            for part in a
            if part in s and part in t
        }


def read_reference(scene: SceneFiles, frame: int) -> Reference:
    """Both renderings of a frame with their samples; each file is read once."""
    found = [_parts_of(scene, which, frame, CHANNELS_OF, SAMPLES_OF) for which in (0, 1)]
    return Reference((found[0][0], found[1][0]), (found[0][1], found[1][1]))


def reference_parts(scene: SceneFiles, frame: int) -> Parts:
    """What predictions are scored against, without the samples."""
    return Reference((half_parts(scene, 0, frame), half_parts(scene, 1, frame)), ({}, {})).parts


def half_parts(scene: SceneFiles, which: int, frame: int) -> Parts:
    """The same of one of the two renderings of the reference."""
    return _parts_of(scene, which, frame, CHANNELS_OF)[0]


def _parts_of(scene: SceneFiles, which: int, frame: int, *tables: Mapping[str, Sequence[str]]) -> list[Parts]:
    """Sums of channels of one of the two renderings, of each table of parts and their channels.

    Parts whose channels are not all there are left out.
    """
    there = set(present_channels(scene.halves[which][frame]))
    found = [{part: names for part, names in table.items() if there.issuperset(names)} for table in tables]
    wanted = dict.fromkeys(name for parts in found for names in parts.values() for name in names)
    read = scene.half(which, frame, *wanted)
    return [{part: _sum([read[name] for name in names]) for part, names in parts.items()} for parts in found]


def _sum(images: Sequence[Any]) -> Any:
    total = images[0]
    for image in images[1:]:
        total = total + image
    return total
