"""The method `gfa`: direct light, and the indirect light that its network makes of it."""

from __future__ import annotations

from torch import nn

from gibench.baselines.geometry_aware_feature_aggregation.network import FULL, MINI, GeometryAware, Size
from gibench.baselines.image_to_image import channels_at
from gibench.baselines.image_to_image.implementation import IndirectByNetwork


class GeometryAwareAggregation(IndirectByNetwork):
    """See `gibench.baselines.geometry_aware_feature_aggregation.METHOD`."""

    def network(self) -> nn.Module:
        """The network, untrained."""
        settings = self.settings
        width, base = float(settings["width"]), MINI if settings["mini"] else FULL
        return GeometryAware(
            Size(
                channels_at(width, base.light),
                channels_at(width, base.geometry),
                heads=int(settings["heads"]),
                query=max(4, round(width * base.query)),
                colours=1 if settings["monochromatic"] else 3,
            )
        )
