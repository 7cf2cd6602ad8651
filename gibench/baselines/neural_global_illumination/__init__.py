"""Neural Global Illumination (Gao et al. 2022): indirect light of a room whose camera and area light move."""

from __future__ import annotations

from gibench.baselines.linearly_transformed_cosines import SHADOWS
from gibench.baselines.method import Knob, Method, Variant
from gibench.baselines.moving_light import LIT
from gibench.baselines.moving_light import SURFACE as LIT_SURFACE
from gibench.rendering.channels import CUES

SURFACE = (*LIT_SURFACE, "reflected_position", "reflected_normal", "reflected_albedo")
"""Channels of what is seen and of what it mirrors, that the network is given."""

METHOD = Method(
    id="ngi",
    title="Neural global illumination",
    family="neural",
    tracks=("moving-light",),
    paper="Gao et al. 2022, Neural Global Illumination: Interactive Indirect Illumination Prediction under Dynamic "
    "Area Lights",
    implementation="gibench.baselines.neural_global_illumination.implementation:NeuralLight",
    channels=("color", *LIT, *SURFACE, *CUES),
    knobs=(
        Knob(
            "network", "full", ("small", "full"), "1.20 or the paper's 14.65 million parameters", trains=True
        ),
        Knob("lpips", True, (False, True), "whether the perceptual loss is trained for", trains=True),
        Knob("cnn", True, (False, True), "whether a U-Net looks at the screen", trains=True),
        Knob("encoding", True, (False, True), "sines and cosines of the inputs", trains=True),
        Knob(
            "lighting",
            "all",
            ("position", "no-cues", "all", "facing"),
            "the light by its centre; by its direction and direct light; by cues too; or also by where it faces",
            trains=True,
        ),
        Knob("images", 1.0, (0.1, 0.2, 0.5, 1.0), "share of the training frames", trains=True),
        Knob(
            "crop",
            0,
            (0, 32, 64, 128, 256),
            "pixels along a side of what a step learns from; 0: 64 for the small network, 256 for the full one",
            trains=True,
        ),
        *SHADOWS,
    ),
    budget="shadow_rays",
    trains=True,
    variants=(
        Variant("no-lpips", {"lpips": False}),
        Variant("no-cues", {"lighting": "no-cues"}),
        Variant("no-cnn", {"cnn": False}),
        Variant("no-encoding", {"encoding": False}),
        Variant("position-only", {"lighting": "position"}),
        Variant("facing", {"lighting": "facing"}),
    ),
)
