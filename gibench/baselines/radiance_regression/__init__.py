"""Radiance regression functions (Ren et al. 2013): a small network for each part of a room."""

from __future__ import annotations

from gibench.baselines.linearly_transformed_cosines import SHADOWS
from gibench.baselines.method import Knob, Method, Variant
from gibench.baselines.moving_light import LIT, SURFACE

METHOD = Method(
    id="rrf",
    title="Radiance regression functions",
    family="neural",
    tracks=("moving-light",),
    paper="Ren et al. 2013, Global Illumination with Radiance Regression Functions",
    implementation="gibench.baselines.radiance_regression.implementation:RegressedLight",
    channels=(*LIT, *SURFACE),
    knobs=(
        Knob("cells", 1024, (16, 64, 256, 1024), "parts of the room, a network of 52 kB each", trains=True),
        Knob("facing", False, (False, True), "whether networks are told where the light faces", trains=True),
        *SHADOWS,
    ),
    budget="shadow_rays",
    trains=True,
    variants=(Variant("facing", {"facing": True}),),
)
"""The method `rrf`: indirect light by networks, direct light by linearly transformed cosines."""
