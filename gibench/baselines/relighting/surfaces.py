"""Surfaces that pixels see, as networks are given them, from files and on the device alike."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
from torch import Tensor

from gibench.baselines.image_to_image.frames import Images
from gibench.rendering.camera import PinholeCamera

MATERIAL = {"normal": 3, "reflected": 3, "roughness": 1, "diffuse": 3, "specular": 3}
"""Channels of a surface beside its place, in this order: 13."""

MARGIN = 1e-3
"""Of the box of places, in half sizes: no place that training frames see is on its faces."""


@dataclass(frozen=True)
class Box:
    """A box in the world, metres. lowest: its corner; size: along x, y and z, each above 0."""

    lowest: tuple[float, float, float]
    size: tuple[float, float, float]

    @staticmethod
    def around(places: Iterable[Tensor]) -> Box:
        """The smallest one around places (N, 3) of several frames; of size 1 where there are none."""
        lowest, highest = torch.full((3,), torch.inf), torch.full((3,), -torch.inf)
        for found in (some for some in places if len(some)):
            lowest, highest = (
                torch.minimum(lowest, found.amin(dim=0)),
                torch.maximum(highest, found.amax(dim=0)),
            )
        if not (highest >= lowest).all():
            lowest, highest = torch.zeros(3), torch.ones(3)
        # A flat scene has no extent along an axis.
        size = (highest - lowest).clamp(min=1e-3) * (1 + MARGIN)
        corner = (lowest + highest - size) / 2
        return Box(tuple(corner.tolist()), tuple(size.tolist()))

    def inside(self, places: Tensor) -> Tensor:
        """Places (…, 3) in shares of the box, in [0, 1]; what is outside is on its faces."""
        return ((places - places.new_tensor(self.lowest)) / places.new_tensor(self.size)).clamp(0, 1)

    def facts(self) -> dict[str, float]:
        """As numbers by name, to be kept with the weights."""
        return {f"{name}_{k}": getattr(self, name)[k] for name in ("lowest", "size") for k in range(3)}

    @staticmethod
    def of_facts(facts: Mapping[str, Any]) -> Box:
        """The inverse. Raises KeyError, ValueError, TypeError."""
        lowest, size = (tuple(float(facts[f"{name}_{k}"]) for k in range(3)) for name in ("lowest", "size"))
        return Box(lowest, size)  # type: ignore[arg-type]


class Pixels(NamedTuple):
    """Surfaces. places: (…, 3), world, metres. material: (…, 13), `MATERIAL` as it is."""

    places: Tensor
    material: Tensor


def hit(images: Images) -> Tensor:
    """(H, W) whether a pixel sees a surface. images: SURFACE, (C, H, W)."""
    return (images["normal"] != 0).any(dim=0)


def surfaces(images: Images, camera: PinholeCamera, seen: Tensor) -> Pixels:
    """Those of the pixels that are `seen` (H, W), in row order. images: SURFACE, (C, H, W)."""
    place, normal, albedo, specular, roughness = (
        images[name][:, seen].T for name in ("position", "normal", "albedo", "specular_albedo", "roughness")
    )
    towards = torch.nn.functional.normalize(place - place.new_tensor(camera.position), dim=1)
    reflected = towards - 2 * (towards * normal).sum(dim=1, keepdim=True) * normal
    return Pixels(place, torch.cat([normal, reflected, roughness, albedo, specular], dim=1))
