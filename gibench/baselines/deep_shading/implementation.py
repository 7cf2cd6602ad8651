"""The method `deep-shading`: direct light, and the indirect light that its network makes of it."""

from __future__ import annotations

from torch import nn

from gibench.baselines.deep_shading.network import CHANNELS, OfEachColour
from gibench.baselines.image_to_image import channels_at
from gibench.baselines.image_to_image.implementation import IndirectByNetwork
from gibench.baselines.image_to_image.shading import GEOMETRY, LIGHT


class DeepShadingOfColours(IndirectByNetwork):
    """See `gibench.baselines.deep_shading.METHOD`."""

    def network(self) -> nn.Module:
        """The network, untrained."""
        return OfEachColour(LIGHT, GEOMETRY, channels_at(float(self.settings["width"]), CHANNELS))
