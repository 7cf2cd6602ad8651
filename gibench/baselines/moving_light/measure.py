"""What numbers of a room are divided by, and light in units of what an area light gives off.

Light is linear: direct light, cues and prediction are divided by the radiance of the area light times its area, colour
by colour, so that a brighter, a redder or, from afar, a larger light is the same light to a network.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from gibench.baselines.image_to_image.frames import Frames, Images, spaced
from gibench.baselines.image_to_image.shading import in_units
from gibench.baselines.training.codes import LogCode
from gibench.baselines.training.errors import TrainingError
from gibench.rendering.lighting import AreaLight

CODE = LogCode(largest=1e4)
"""Of radiance in units of its mean over the training frames."""

MEASURED = 64
"""Training frames that decide what numbers are divided by."""

FARTHEST = 2.0
"""Of places, in half sizes of the room; beyond, encodings repeat themselves."""

BESIDE = 1.25
"""Half sizes of the room over those of the box of cameras and lights, which keep off its walls."""

THINNEST = 0.1
"""Least half size of the room, of its largest one: where cameras and lights lie in a plane."""

HELD_OUT, JUDGED = 0.05, 32
"""Share of the training frames that is held out, and how many of these are looked at."""


@dataclass(frozen=True)
class Measure:
    """What numbers of a room are divided by.

    centre, half: of a box around all places of cameras and lights, m. Places that are seen say little of the room: a
    window shows ground that lies a kilometre away. direct, indirect: mean of `per_flux`.
    """

    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    direct: float
    indirect: float

    def facts(self) -> dict[str, float]:
        """As numbers by name, to be kept with the weights."""
        places = {f"{name}_{k}": getattr(self, name)[k] for name in ("centre", "half") for k in range(3)}
        return {**places, "direct": self.direct, "indirect": self.indirect}

    def inside(self, points: Tensor) -> Tensor:
        """Places (3, H, W), m, in half sizes of the room from its middle, to FARTHEST at most."""
        centre, half = self._box(points)
        return ((points - centre) / half).clamp(-FARTHEST, FARTHEST)

    def nearest(self, points: Tensor) -> Tensor:
        """Places (3, H, W), m; those farther than FARTHEST half sizes are moved there."""
        centre, half = self._box(points)
        return torch.minimum(torch.maximum(points, centre - FARTHEST * half), centre + FARTHEST * half)

    def _box(self, points: Tensor) -> tuple[Tensor, Tensor]:
        centre, half = (points.new_tensor(side)[:, None, None] for side in (self.centre, self.half))
        return centre, half

    @staticmethod
    def of_facts(facts: Mapping[str, Any]) -> Measure:
        """The inverse. Raises KeyError, ValueError, TypeError."""
        centre, half = (tuple(float(facts[f"{name}_{k}"]) for k in range(3)) for name in ("centre", "half"))
        return Measure(centre, half, float(facts["direct"]), float(facts["indirect"]))  # type: ignore[arg-type]

    @staticmethod
    def of_frames(places: ArrayLike, frames: Sequence[tuple[Images, AreaLight]]) -> Measure:
        """From the places (N, 3) of all cameras and lights, m, and frames with direct and indirect light."""
        inside = np.asarray(places, np.float64)
        lowest, highest = inside.min(axis=0), inside.max(axis=0)
        half = BESIDE * (highest - lowest) / 2
        half = np.maximum(half, THINNEST * half.max()) if half.any() else np.ones(3)
        centre = (lowest + highest) / 2
        sums = torch.zeros(2, dtype=torch.float64)
        for images, area in frames:
            for number, kind in enumerate(("direct", "indirect")):
                light = images[f"{kind}_diffuse"] + images[f"{kind}_specular"]
                # Highlights of near-mirrors would set the scale alone.
                sums[number] += per_radiance(light, area).clamp(max=1).double().mean() / area.area
        means = [float(total) / max(len(frames), 1) or 1.0 for total in sums]
        return Measure(tuple(centre.tolist()), tuple(half.tolist()), *means)


def per_radiance(light: Tensor, area: AreaLight) -> Tensor:
    """Radiance (3, H, W) in units of that of an area light; 0 in colours that it has not."""
    return in_units(light, light.new_tensor(area.radiance)[:, None, None])


def per_flux(light: Tensor, area: AreaLight) -> Tensor:
    """Radiance (3, H, W) in units of the light's radiance times its area, m²: networks are not told how large it is."""
    return per_radiance(light, area) / area.area


def unit_of(area: AreaLight) -> Tensor:
    """(3, 1, 1): radiance of one unit of `per_flux`, W·m⁻²·sr⁻¹."""
    return torch.tensor(area.intensity, dtype=torch.float32)[:, None, None]


def area_of(frames: Frames, index: int) -> AreaLight:
    """The light of a frame. Raises TrainingError where no area light lights it."""
    area = frames.area_light(index)
    if area is None:
        raise TrainingError(
            f"training frame {frames.rows.iloc[index]['file']} is not lit by an area light: make the dataset with "
            "--lighting area-light"
        )
    return area


def unit_vectors(vectors: Tensor) -> Tensor:
    """(3, H, W) of unit length; 0 stays 0."""
    length = vectors.norm(dim=0, keepdim=True)
    return vectors / torch.where(length > 0, length, 1)


def measured(frames: Frames) -> Measure:
    """The measure of a room, by the places of all of its training frames and the light of MEASURED of them."""
    numbers = range(len(frames))
    places = [place for k in numbers for place in (frames.camera(k).position, area_of(frames, k).centre)]
    return Measure.of_frames(places, [(frames[k], area_of(frames, k)) for k in spaced(numbers, MEASURED)])
