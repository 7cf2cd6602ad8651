"""What numbers of a room are divided by, and light in units of what an area light gives off.

Light is linear: direct light, cues and prediction are divided by the radiance of the area light times its area, colour
by colour, so that a brighter, a redder or, from afar, a larger light is the same light to a network.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from gibench.baselines.image_to_image.frames import Frames, Images, spaced
from gibench.baselines.training.codes import LogCode
from gibench.baselines.training.errors import TrainingError
from gibench.rendering.lighting import AreaLight

CODE = LogCode(largest=1e4)
"""Of radiance in units of its mean over the training frames."""

MEASURED = 64
"""Training frames that decide what numbers are divided by."""

FARTHEST = 2.0
"""Of places, in half sizes of the room; beyond, encodings repeat themselves."""

HELD_OUT, JUDGED = 0.05, 8
"""Share of the training frames that is held out, and how many of these are looked at."""


@dataclass(frozen=True)
class Measure:
    """What numbers of a room are divided by.

    centre, half: of the box of all places that training frames see, m. direct, indirect: mean of `per_flux`.
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
        centre, half = (points.new_tensor(side)[:, None, None] for side in (self.centre, self.half))
        return ((points - centre) / half).clamp(-FARTHEST, FARTHEST)

    @staticmethod
    def of_facts(facts: Mapping[str, Any]) -> Measure:
        """The inverse. Raises KeyError, ValueError, TypeError."""
        centre, half = (tuple(float(facts[f"{name}_{k}"]) for k in range(3)) for name in ("centre", "half"))
        return Measure(centre, half, float(facts["direct"]), float(facts["indirect"]))  # type: ignore[arg-type]

    @staticmethod
    def of_frames(frames: Sequence[tuple[Images, AreaLight]]) -> Measure:
        """From frames with positions, reflected ones where they have them, direct and indirect light."""
        lowest, highest = torch.full((3,), torch.inf), torch.full((3,), -torch.inf)
        sums = torch.zeros(2, dtype=torch.float64)
        for images, area in frames:
            for name in ("position", "reflected_position"):
                if name not in images:
                    continue
                places = images[name].flatten(1)
                hit = (places != 0).any(dim=0)
                if hit.any():
                    lowest = torch.minimum(lowest, places[:, hit].amin(dim=1))
                    highest = torch.maximum(highest, places[:, hit].amax(dim=1))
            for number, kind in enumerate(("direct", "indirect")):
                light = images[f"{kind}_diffuse"] + images[f"{kind}_specular"]
                # Highlights of near-mirrors would set the scale alone.
                sums[number] += per_radiance(light, area).clamp(max=1).double().mean() / area.area
        empty = ~(highest > lowest).all()
        centre = torch.zeros(3) if empty else (lowest + highest) / 2
        half = torch.ones(3) if empty else ((highest - lowest) / 2).clamp(min=1e-3)
        means = [float(total) / max(len(frames), 1) or 1.0 for total in sums]
        return Measure(tuple(centre.tolist()), tuple(half.tolist()), *means)


def per_radiance(light: Tensor, area: AreaLight) -> Tensor:
    """Radiance (3, H, W) in units of that of an area light; 0 in colours that it has not."""
    unit = light.new_tensor(area.radiance)[:, None, None]
    return torch.where(unit > 0, light / torch.where(unit > 0, unit, 1), 0)


def per_flux(light: Tensor, area: AreaLight) -> Tensor:
    """Radiance (3, H, W) in units of the light's radiance times its area, m²: networks are not told how large it is."""
    return per_radiance(light, area) / area.area


def unit_of(area: AreaLight) -> Tensor:
    """(3, 1, 1): radiance of one unit of `per_flux`, W·m⁻²·sr⁻¹."""
    return torch.tensor(area.radiance)[:, None, None] * area.area


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
    """The measure of a room, by MEASURED of its training frames."""
    some = spaced(range(len(frames)), MEASURED)
    return Measure.of_frames([(frames[k], area_of(frames, k)) for k in some])
