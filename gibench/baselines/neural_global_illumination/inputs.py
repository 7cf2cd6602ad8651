"""What the network is given of a frame (Gao et al. 2022, section 3.2), from files and on the device alike.

Light is linear: direct light, cues and prediction are divided by the radiance of the area light, colour by colour, so
that a brighter or a redder light is the same light to the network. Where a perfect mirror is seen, position, normal and
diffuse albedo are those of what it shows, and view and light direction start there; roughness 0, the mirror's own
reflectance and its cues say that it is one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from gibench.baselines.image_to_image.frames import Images
from gibench.baselines.training.codes import LogCode
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.channels import CUES
from gibench.rendering.lighting import AreaLight

LIGHT = ("direct_diffuse", "direct_specular", *CUES)
"""Channels of direct light."""

LIGHTING = ("all", "no-cues", "position")
"""How the network is told of the light: by all of section 3.2.1; without radiance cues; by the place of its centre."""

CODE = LogCode(largest=1e4)
"""Of radiance in units of its mean over the training frames."""

MIRROR_ROUGHNESS = 1e-3
"""GGX alpha below which a surface without diffuse albedo is a perfect mirror."""

FARTHEST = 2.0
"""Of places, in half sizes of the room; beyond, the encoding repeats itself."""


@dataclass(frozen=True)
class Measure:
    """What numbers of a room are divided by.

    centre, half: of the box of all places that training frames see, m. direct, indirect: mean radiance over that of the
    light.
    """

    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    direct: float
    indirect: float

    def facts(self) -> dict[str, float]:
        """As numbers by name, to be kept with the weights."""
        places = {f"{name}_{k}": getattr(self, name)[k] for name in ("centre", "half") for k in range(3)}
        return {**places, "direct": self.direct, "indirect": self.indirect}

    @staticmethod
    def of_facts(facts: dict[str, float]) -> Measure:
        """The inverse. Raises KeyError, ValueError, TypeError."""
        centre, half = (tuple(float(facts[f"{name}_{k}"]) for k in range(3)) for name in ("centre", "half"))
        return Measure(centre, half, float(facts["direct"]), float(facts["indirect"]))  # type: ignore[arg-type]

    @staticmethod
    def of_frames(frames: Sequence[tuple[Images, AreaLight]]) -> Measure:
        """From frames with SURFACE, LIGHT and indirect light."""
        lowest, highest = torch.full((3,), torch.inf), torch.full((3,), -torch.inf)
        sums = torch.zeros(2, dtype=torch.float64)
        for images, area in frames:
            for name in ("position", "reflected_position"):
                places = images[name].flatten(1)
                hit = (places != 0).any(dim=0)
                if hit.any():
                    lowest = torch.minimum(lowest, places[:, hit].amin(dim=1))
                    highest = torch.maximum(highest, places[:, hit].amax(dim=1))
            for number, kind in enumerate(("direct", "indirect")):
                light = images[f"{kind}_diffuse"] + images[f"{kind}_specular"]
                # Highlights of near-mirrors would set the scale alone.
                sums[number] += per_radiance(light, area).clamp(max=1).double().mean()
        empty = ~(highest > lowest).all()
        centre = torch.zeros(3) if empty else (lowest + highest) / 2
        half = torch.ones(3) if empty else ((highest - lowest) / 2).clamp(min=1e-3)
        means = [float(total) / max(len(frames), 1) or 1.0 for total in sums]
        return Measure(tuple(centre.tolist()), tuple(half.tolist()), *means)


def per_radiance(light: Tensor, area: AreaLight) -> Tensor:
    """Radiance (3, H, W) in units of that of an area light; 0 in colours that it has not."""
    unit = light.new_tensor(area.radiance)[:, None, None]
    return torch.where(unit > 0, light / torch.where(unit > 0, unit, 1), 0)


def assembled(
    images: Images, camera: PinholeCamera, area: AreaLight, measure: Measure, lighting: str
) -> Tensor:
    """The 34 channels of a frame, `network.INPUTS`, (34, H, W), finite. What the network is not told of is 0.

    images: SURFACE and LIGHT, (C, H, W), in world space. lighting: one of LIGHTING.
    """
    place, normal, albedo = images["position"], images["normal"], images["albedo"]
    hit = (normal != 0).any(dim=0, keepdim=True)
    shown = (images["reflected_normal"] != 0).any(dim=0, keepdim=True)
    mirror = hit & shown & (images["roughness"] < MIRROR_ROUGHNESS) & (albedo.amax(dim=0, keepdim=True) <= 0)
    eye = place.new_tensor(camera.position)[:, None, None]
    view = torch.where(mirror, place - images["reflected_position"], eye - place)
    place = torch.where(mirror, images["reflected_position"], place)
    normal = torch.where(mirror, images["reflected_normal"], normal)
    albedo = torch.where(mirror, images["reflected_albedo"], albedo)

    def inside(points: Tensor) -> Tensor:
        centre, half = (place.new_tensor(side)[:, None, None] for side in (measure.centre, measure.half))
        return ((points - centre) / half).clamp(-FARTHEST, FARTHEST)

    centre = place.new_tensor(area.centre)[:, None, None]
    parts = [inside(place), normal, albedo, images["specular_albedo"], images["roughness"], _unit(view)]
    direct = images["direct_diffuse"] + images["direct_specular"]
    lights = (direct, *(images[name] for name in CUES))
    coded = [CODE.encode(per_radiance(light, area) / measure.direct) for light in lights]
    told = {"all": 1 + len(CUES), "no-cues": 1, "position": 0}[lighting]
    parts += [part if number < told else torch.zeros_like(part) for number, part in enumerate(coded)]
    parts.append(inside(centre.expand_as(place)) if lighting == "position" else _unit(centre - place))
    return torch.where(hit, torch.cat(parts), 0)


def _unit(vectors: Tensor) -> Tensor:
    length = vectors.norm(dim=0, keepdim=True)
    return vectors / torch.where(length > 0, length, 1)
