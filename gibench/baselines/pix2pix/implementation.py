"""The method `pix2pix`: direct light, and the indirect light that its network makes of it."""

from __future__ import annotations

from torch import nn

from gibench.baselines.image_to_image import channels_at
from gibench.baselines.image_to_image.implementation import IndirectByNetwork
from gibench.baselines.image_to_image.shading import Concatenated
from gibench.baselines.pix2pix.network import CHANNELS, UNet


class Pix2Pix(IndirectByNetwork):
    """See `gibench.baselines.pix2pix.METHOD`."""

    mixed = False

    def network(self) -> nn.Module:
        """The network, untrained."""
        channels = channels_at(float(self.settings["width"]), CHANNELS)
        return Concatenated(UNet(Concatenated.INPUTS, channels=channels))
