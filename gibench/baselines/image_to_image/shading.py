"""Indirect light by a network that knows neither how bright a room is, nor how large, nor what its surfaces reflect.

Direct light is divided by albedo, and what the network says is multiplied by it (Gai, Wang & Li, Geometry-Aware Global
Feature Aggregation for Real-Time Indirect Illumination, section 3.1). They learn from random exposures that a brighter
room is the same room (section 3.3); here light is also divided by its unit (see `units`), so that it is so for any
network, and its numbers stay in the range that it was trained in. Lengths are divided by the median depth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gibench.baselines.image_to_image.frames import Images
from gibench.baselines.training.codes import Exponential

CHANNELS = ("direct_diffuse", "albedo", "normal", "position", "depth")
"""Of a frame, what a network is given of it."""

GEOMETRY = 7
"""Channels of the geometry: position 3, normal 3, depth 1."""

LIGHT = 2
"""Of the light, in each colour: direct light over albedo, and albedo."""

DARKEST = 0.01
"""Added to albedo before anything is divided by it: black surfaces reflect nothing, and nothing is what they get."""

FARTHEST = 8.0
"""Depth that a network is told of at most, in units of the median depth of a frame."""

OUTPUT = Exponential(largest=1e4, smallest=1e-6)
"""Of indirect light over albedo, in its unit."""


def demodulated(radiance: Tensor, albedo: Tensor) -> Tensor:
    """Radiance over albedo: light, without the texture that it falls on."""
    return radiance / (albedo + DARKEST)


def remodulated(light: Tensor, albedo: Tensor) -> Tensor:
    """The inverse of `demodulated`, to the last bits."""
    return light * (albedo + DARKEST)


def brightness(direct: Tensor, albedo: Tensor, *, of_each_colour: bool = False) -> Tensor:
    """(…, 1, 1, 1), or (…, 3, 1, 1) of each colour: the light on what is in view, mean radiance over mean albedo.

    Not the mean of radiance over albedo: radiance is the mean of a pixel and albedo that of its centre, so a black
    thing has a bright rim, which would decide. direct, albedo: (…, 3, H, W).
    """
    over = (-2, -1) if of_each_colour else (-3, -2, -1)
    return demodulated(direct.mean(dim=over, keepdim=True), albedo.mean(dim=over, keepdim=True))


def in_units(light: Tensor, unit: Tensor) -> Tensor:
    """Light (…, 3, H, W) over its unit (…, 1 or 3, 1, 1); 0 where that is 0."""
    return torch.where(unit > 0, light / torch.where(unit > 0, unit, 1), 0)


def geometry(images: Images, length: Tensor | None = None) -> Tensor:
    """(…, GEOMETRY, H, W) of images in camera space, lengths in units of the median depth of what is hit.

    length: that depth, (…, 1, 1, 1), where the images are a part of a frame.

    What lies deeper than FARTHEST units is drawn nearer along its ray, to that depth: ground that a window shows a
    kilometre away would be all that a network sees of a room.
    """
    depth = images["depth"]
    unit = median_depth(depth) if length is None else length
    nearer = FARTHEST / torch.clamp(depth / unit, min=FARTHEST)
    return torch.cat([images["position"] / unit * nearer, images["normal"], depth / unit * nearer], dim=-3)


def median_depth(depth: Tensor) -> Tensor:
    """(…, 1, 1, 1): the lower median of depths (…, 1, H, W) above 0; 1 where there are none."""
    flat = depth.flatten(-3)
    if depth.device.type == "cpu":  # where a sort takes ten times as long
        found = [_lower_median(one) for one in flat.reshape(-1, flat.shape[-1]).numpy()]
        return depth.new_tensor(found).reshape(*flat.shape[:-1], 1, 1, 1)
    hit = flat > 0
    # A sort repeats its bits on every device; torch.median does not.
    ordered = torch.where(hit, flat, torch.inf).sort(dim=-1).values
    middle = (hit.sum(dim=-1, keepdim=True) - 1).clamp(min=0) // 2
    median = ordered.gather(-1, middle)
    return torch.where(median.isfinite(), median, 1)[..., None, None]


def _lower_median(depth: NDArray[Any]) -> float:
    hit = depth[depth > 0]
    middle = (len(hit) - 1) // 2
    return float(np.partition(hit, middle)[middle]) if len(hit) else 1.0


@dataclass(frozen=True, eq=False)
class Inputs:
    """What a network is given of frames. light: (N, LIGHT, 3, H, W), compressed direct light over albedo, and albedo.

    geometry: (N, GEOMETRY, H, W). unit: (N, 1, 1, 1), of the light, or (N, 3, 1, 1), of each colour: where it is 0, no
    light being in view or a lamp having nothing of a colour, what comes out is black, for light is linear. albedo:
    (N, 3, H, W).
    """

    light: Tensor
    geometry: Tensor
    unit: Tensor
    albedo: Tensor

    @staticmethod
    def of(direct: Tensor, albedo: Tensor, geometry: Tensor, unit: Tensor) -> Inputs:
        """direct: direct diffuse radiance (N, 3, H, W), ≥ 0. unit: (N, 1 or 3, 1, 1), ≥ 0."""
        light = torch.log1p(in_units(demodulated(direct, albedo), unit))
        return Inputs(torch.stack([light, albedo], dim=1), geometry, unit, albedo)

    def radiance(self, code: Tensor) -> Tensor:
        """What a network says, (N, 3, H, W), as indirect diffuse radiance: finite and ≥ 0."""
        return self.radiance_of(OUTPUT.decode(code))

    def radiance_of(self, light: Tensor) -> Tensor:
        """Indirect light over albedo, in its unit, as radiance."""
        return remodulated(light * self.unit, self.albedo)


def indirect(
    network: nn.Module, direct: Tensor, albedo: Tensor, geometry: Tensor, unit: Tensor | None = None
) -> Tensor:
    """Indirect diffuse radiance (N, 3, H, W), finite and ≥ 0.

    network: of (light, geometry) as in `Inputs`, gives logarithms. direct: direct diffuse radiance (N, 3, H, W), ≥ 0.
    geometry: (N, GEOMETRY, H, W). unit: of light over albedo, (N, 1 or 3, 1, 1), its brightness by default.
    """
    if unit is None:
        unit = brightness(direct, albedo)
    inputs = Inputs.of(direct, albedo, geometry, unit)
    return inputs.radiance(network(inputs.light, inputs.geometry))


class Concatenated(nn.Module):
    """An image-to-image network of LIGHT · 3 + GEOMETRY channels that is given them all, side by side."""

    INPUTS = 3 * LIGHT + GEOMETRY

    def __init__(self, network: nn.Module) -> None:
        """network: from INPUTS channels to 3."""
        super().__init__()
        self.network = network

    def forward(self, light: Tensor, geometry: Tensor) -> Tensor:
        """As a network of `indirect`."""
        code: Tensor = self.network(torch.cat([light.flatten(1, 2), geometry], dim=1))
        return code
