"""Compositional neural scene representations (Granskog et al. 2020): light told by three images of the room."""

from __future__ import annotations

from gibench.baselines.linearly_transformed_cosines import SHADOWS
from gibench.baselines.method import Knob, Method
from gibench.baselines.moving_light import LIT, SURFACE

METHOD = Method(
    id="cnnr",
    title="Compositional neural scene representations",
    family="neural",
    tracks=("moving-light",),
    paper="Granskog et al. 2020, Compositional Neural Scene Representations for Shading Inference",
    implementation="gibench.baselines.compositional_scene_representations.implementation:RepresentedLight",
    channels=(*LIT, *SURFACE),
    knobs=(
        Knob("network", "full", ("small", "full"), "0.39 or 5.76 million parameters", bakes=True),
        Knob("observed", 16, (4, 16, 64), "paths a pixel of each of the three images", bakes=True),
        Knob("crop", 64, (32, 64, 128, 256), "pixels along a side of what a step learns from", bakes=True),
        *SHADOWS,
    ),
    budget="shadow_rays",
    trained=True,
)
"""The method `cnnr`: indirect light by a network, direct light by linearly transformed cosines."""
