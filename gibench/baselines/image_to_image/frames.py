"""Training frames as tensors, channel by channel, none of whose numbers is other than finite."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import torch
from torch import Tensor

from gibench.baselines.training.errors import TrainingError
from gibench.baselines.training_set import TrainingSet
from gibench.datasets.cameras import camera_of
from gibench.datasets.lightings import lighting_of
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import AreaLight

Images = dict[str, Tensor]
"""Channel → (C, H, W) float32."""


class Frames:
    """Some of the frames of a training set, a map-style dataset of `Images`; whichever is read is charged for."""

    def __init__(
        self, views: TrainingSet, channels: Sequence[str], numbers: Sequence[int] | None = None
    ) -> None:
        """numbers: of the frames, all of them by default. Raises DatasetError where there are none."""
        self.channels = tuple(channels)
        self.rows = views.frames.iloc[list(range(len(views)) if numbers is None else numbers)]
        self._items = views.torch(self.channels, numbers)

    def __len__(self) -> int:
        """How many."""
        return len(self.rows)

    def __getitem__(self, index: int) -> Images:
        """Read one. Raises TrainingError for numbers that are not finite: with the file, the channel and the pixel."""
        images = self._items[index]
        for channel, image in images.items():
            # A sum is finite only of finite numbers, and found in a fraction of the time.
            if not image.sum().isfinite() and not torch.isfinite(image).all():
                place = (~torch.isfinite(image)).nonzero()[0].tolist()
                raise TrainingError(
                    f"training frame {self.rows.iloc[index]['file']} holds {image[tuple(place)].item()} in {channel}, "
                    f"pixel ({place[2]}, {place[1]}): `gibench dataset verify` finds all such frames; make them anew"
                )
        return images

    def camera(self, index: int) -> PinholeCamera:
        """Of a frame."""
        return camera_of({str(name): value for name, value in self.rows.iloc[index].items()})

    def area_light(self, index: int) -> AreaLight | None:
        """That lights a frame alone; None where it is lit by something else."""
        row = {str(name): value for name, value in self.rows.iloc[index].items()}
        return lighting_of(row, Path()).area if row.get("lighting") == "area-light" else None

    def exposure(self, index: int) -> float:
        """1 / radiance of white of a frame as it is shown; 1 where it is black."""
        exposure = float(self.rows.iloc[index]["exposure"])
        return exposure if 0 < exposure < float("inf") else 1.0


def held_out(views: TrainingSet, share: float, most: int) -> tuple[list[int], list[int]]:
    """Numbers of the frames to learn from, and of those that are held out.

    A share of the rooms is held out whole, the last ones, one at least; of these, `most` frames spread evenly are
    looked at. Of a single room it is a share of its views. Raises TrainingError where there are fewer than two frames.
    """
    if len(views) < 2:
        raise TrainingError(
            f"a network learns from one frame and is judged by another, but there are {len(views)}: "
            "ask for more `views` or `training_rooms` in the track's preset"
        )
    of_frame = _groups(views)
    kinds = sorted(set(of_frame))
    apart = set(kinds[-max(1, round(share * len(kinds))) :])
    learned = [number for number, kind in enumerate(of_frame) if kind not in apart]
    others = [number for number, kind in enumerate(of_frame) if kind in apart]
    return learned, spaced(others, most)


def spaced(numbers: Sequence[int], most: int) -> list[int]:
    """So many of some numbers, or all where there are fewer, spread evenly from the first one on."""
    count = min(most, len(numbers))
    return [numbers[k * len(numbers) // count] for k in range(count)]


def share_of(views: TrainingSet, numbers: Sequence[int], share: float) -> list[int]:
    """Those frames that are a share of some, one at least, spread evenly: whole rooms where there are several."""
    of_frame = _groups(views)
    groups = sorted({of_frame[number] for number in numbers})
    kept = set(spaced(groups, max(1, round(share * len(groups)))))
    return [number for number in numbers if of_frame[number] in kept]


def _groups(views: TrainingSet) -> list[int]:
    """Of each frame what is held out or left out as one: its room, or where there is but one the frame."""
    rooms: list[int] = views.frames["room"].tolist()
    return rooms if len(views.rooms) > 1 else list(range(len(views)))
