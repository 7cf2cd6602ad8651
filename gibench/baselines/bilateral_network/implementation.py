"""The method `bcn`: direct light, and the indirect light that its network makes of it."""

from __future__ import annotations

from torch import nn

from gibench.baselines.bilateral_network.network import CHANNELS, BilateralNetwork
from gibench.baselines.image_to_image import channels_at
from gibench.baselines.image_to_image.implementation import IndirectByNetwork


class BilateralConvolutions(IndirectByNetwork):
    """See `gibench.baselines.bilateral_network.METHOD`."""

    mixed = False

    def network(self) -> nn.Module:
        """The network, untrained."""
        return BilateralNetwork(channels_at(float(self.settings["width"]), CHANNELS))
