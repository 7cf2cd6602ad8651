"""Neural Precomputed Radiance Transfer (Rainer et al. 2022): indirect light from a code of the environment."""

from __future__ import annotations

from gibench.baselines.method import Knob, Method, Variant
from gibench.baselines.relighting import CHANNELS, DENOISED

METHOD = Method(
    id="nprt",
    title="Neural precomputed radiance transfer",
    family="neural",
    tracks=("relight",),
    paper="Rainer et al. 2022, Neural Precomputed Radiance Transfer",
    implementation="gibench.baselines.neural_precomputed_radiance_transfer.implementation:NeuralTransfer",
    channels=CHANNELS,
    knobs=(
        *DENOISED,
        Knob("separated", True, (False, True), "a branch each for diffuse and specular light", trains=True),
        Knob("batch", 2048, (64, 256, 512, 1024, 2048), "pixels of a step", trains=True),
    ),
    budget="spp",
    trains=True,
    variants=(Variant("one-branch", {"separated": False}),),
)
