"""What the network is given of a frame (Gao et al. 2022, section 3.2), from files and on the device alike.

Direct light and cues are divided by what the area light gives off (`moving_light.measure`). Where a perfect mirror is
seen, position, normal and diffuse albedo are those of what it shows, and view and light direction start there;
roughness 0, the mirror's own reflectance and its cues say that it is one.
"""

from __future__ import annotations

import torch
from torch import Tensor

from gibench.baselines.image_to_image.frames import Images
from gibench.baselines.moving_light.measure import CODE, Measure, per_flux, unit_vectors
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.channels import CUES
from gibench.rendering.lighting import AreaLight

LIGHT = ("direct_diffuse", "direct_specular", *CUES)
"""Channels of direct light."""

LIGHTING = ("all", "no-cues", "position", "facing")
"""How the network is told of the light: by all of section 3.2.1; without radiance cues; by the place of its centre; by
all, and by where it faces.
"""

CUED = ("all", "facing")
"""Of these, those with radiance cues."""

MIRROR_ROUGHNESS = 1e-3
"""GGX alpha below which a surface without diffuse albedo is a perfect mirror."""


def assembled(
    images: Images, camera: PinholeCamera, area: AreaLight, measure: Measure, lighting: str
) -> Tensor:
    """The channels of a frame, `network.INPUTS`, (34 or 37, H, W), finite. What the network is not told of is 0.

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

    centre = place.new_tensor(area.centre)[:, None, None]
    parts = [
        measure.inside(place),
        normal,
        albedo,
        images["specular_albedo"],
        images["roughness"],
        unit_vectors(view),
    ]
    direct = images["direct_diffuse"] + images["direct_specular"]
    lights = (direct, *(images[name] for name in CUES))
    coded = [CODE.encode(per_flux(light, area) / measure.direct) for light in lights]
    told = {"no-cues": 1, "position": 0}.get(lighting, 1 + len(CUES))
    parts += [part if number < told else torch.zeros_like(part) for number, part in enumerate(coded)]
    parts.append(
        measure.inside(centre.expand_as(place)) if lighting == "position" else unit_vectors(centre - place)
    )
    if lighting == "facing":
        parts.append(place.new_tensor(area.direction)[:, None, None].expand_as(place))
    return torch.where(hit, torch.cat(parts), 0)
