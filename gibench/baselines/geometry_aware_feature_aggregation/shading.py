"""Indirect light by a network that knows neither how bright a room is nor what its surfaces reflect.

Direct light is divided by albedo, and by its own mean; what the network says is multiplied by both (section 3.1). The
paper divides by albedo alone, and learns from random exposures that a brighter room is the same room (section 3.3);
with the mean it is so for any network, and its numbers stay in the range that it was trained in.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from gibench.baselines.training.codes import Exponential

DARKEST = 0.01
"""Added to albedo before anything is divided by it: black surfaces reflect nothing, and nothing is what they get."""

OUTPUT = Exponential(largest=1e4, smallest=1e-6)
"""Of indirect light over albedo, in units of the mean direct light."""


def demodulated(radiance: Tensor, albedo: Tensor) -> Tensor:
    """Radiance over albedo: light, without the texture that it falls on."""
    return radiance / (albedo + DARKEST)


def remodulated(light: Tensor, albedo: Tensor) -> Tensor:
    """The inverse of `demodulated`, to the last bits."""
    return light * (albedo + DARKEST)


def brightness(direct: Tensor) -> Tensor:
    """(N, 1, 1, 1): mean of direct light over albedo, all colours together, 1 where there is none at all."""
    mean = direct.mean(dim=(1, 2, 3), keepdim=True)
    return torch.where(mean > 0, mean, 1)


def indirect(network: nn.Module, direct: Tensor, albedo: Tensor, geometry: Tensor) -> Tensor:
    """Indirect diffuse radiance (N, 3, H, W), finite and ≥ 0.

    network: a `GeometryAware` or another that gives logarithms. direct: direct diffuse radiance (N, 3, H, W), ≥ 0.
    geometry: (N, GEOMETRY, H, W).
    """
    light = demodulated(direct, albedo)
    unit = brightness(light)
    inputs = torch.stack([torch.log1p(light / unit), albedo], dim=1)
    return remodulated(OUTPUT.decode(network(inputs, geometry)) * unit, albedo)
