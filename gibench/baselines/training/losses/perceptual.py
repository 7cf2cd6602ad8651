"""Differences as networks see them that were trained to recognise photographs.

Both losses take display values in [0, 1]; `gibench.baselines.training.display` makes them of radiance. The weights are
those of `gibench.metrics.lpips_weights`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import torch
from torch import Tensor, nn

from gibench.baselines.training.errors import TrainingError
from gibench.metrics.lpips_network import build_network

SMALLEST = 32
"""Pixels along a side: below, the last layers of VGG16 see single pixels, and what torch then gives for gradients may
differ in the last bits from run to run.
"""

RELU = {"relu1_1": 1, "relu2_1": 6, "relu3_1": 11, "relu4_1": 18, "relu5_1": 25}
"""Layers of VGG16 by their names in Simonyan & Zisserman 2014, as numbers in its list of layers."""

FEATURE_WEIGHTS = {"relu1_1": 1 / 32, "relu2_1": 1 / 16, "relu3_1": 1 / 8, "relu4_1": 1 / 4, "relu5_1": 1.0}
"""Of pix2pixHD (Wang et al. 2018), which took VGG19. VGG16 has the same layers up to conv3_1."""


class Lpips(nn.Module):
    """LPIPS of VGG16 (Zhang et al. 2018) as a loss: the metric `lpips_vgg`, with a gradient."""

    def __init__(self) -> None:
        """Raises WeightsError, MissingDependencyError as `build_network` does."""
        super().__init__()
        self.network = build_network("vgg")

    def forward(self, output: Tensor, truth: Tensor) -> Tensor:
        """The mean over a batch of (N, 3, H, W)."""
        _check(output)
        distance: Tensor = self.network(2 * output - 1, 2 * truth - 1)
        return distance.mean()


class Vgg16Features(nn.Module):
    """Mean absolute differences of the features of VGG16, weighted by layer and added (Johnson et al. 2016)."""

    def __init__(self, weights: Mapping[str, float] = FEATURE_WEIGHTS) -> None:
        """weights: by layer, of RELU. Raises what `Lpips` does."""
        super().__init__()
        unknown = weights.keys() - RELU.keys()
        if unknown or not weights:
            raise TrainingError(
                f"features of {', '.join(sorted(unknown)) or 'no layer'}: known are {', '.join(RELU)}"
            )
        network = build_network("vgg")
        slices = [getattr(network.net, f"slice{k}") for k in range(1, 6)]
        last = max(RELU[name] for name in weights)
        self.layers = nn.ModuleList([layer for part in slices for layer in part][: last + 1])
        self.scaling: nn.Module = network.scaling_layer  # type: ignore[assignment]
        self.weights = {RELU[name]: float(weight) for name, weight in weights.items()}

    def forward(self, output: Tensor, truth: Tensor) -> Tensor:
        """The loss of a batch of (N, 3, H, W). The truth is given no gradient."""
        _check(output)
        with torch.no_grad():
            found = dict(self._features(truth))
        total = output.new_zeros(())
        for number, features in self._features(output):
            total = total + self.weights[number] * (features - found[number]).abs().mean()
        return total

    def _features(self, image: Tensor) -> Iterator[tuple[int, Tensor]]:
        """Of each layer that is looked at, with its number."""
        features = self.scaling(2 * image - 1)
        for number, layer in enumerate(self.layers):
            features = layer(features)
            if number in self.weights:
                yield number, features


def _check(image: Tensor) -> None:
    if min(image.shape[-2:]) < SMALLEST:
        height, width = image.shape[-2:]
        raise TrainingError(
            f"a perceptual loss looks at {SMALLEST} pixels along each side at least, not at {width} × {height}"
        )
