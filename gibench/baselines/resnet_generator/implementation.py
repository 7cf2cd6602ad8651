"""The method `resnet`: direct light, and the indirect light that its network makes of it."""

from __future__ import annotations

from torch import nn

from gibench.baselines.image_to_image import channels_at
from gibench.baselines.image_to_image.implementation import IndirectByNetwork
from gibench.baselines.image_to_image.shading import Concatenated
from gibench.baselines.resnet_generator.network import WIDTH, ResidualGenerator


class ResidualBlocks(IndirectByNetwork):
    """See `gibench.baselines.resnet_generator.METHOD`."""

    def network(self) -> nn.Module:
        """The network, untrained."""
        (width,) = channels_at(float(self.settings["width"]), (WIDTH,))
        return Concatenated(ResidualGenerator(Concatenated.INPUTS, width=width))
