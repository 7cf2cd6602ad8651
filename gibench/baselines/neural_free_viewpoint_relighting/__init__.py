"""Neural Free-Viewpoint Relighting (Raghavan et al. 2023): indirect light of a scene as a dot product of wavelets."""

from __future__ import annotations

from gibench.baselines.method import Knob, Method, Variant
from gibench.baselines.relighting import CHANNELS, DENOISED

WAVELETS = (
    Knob("wavelets", 64, (16, 32, 64, 128, 256), "of the environment, that a frame is made from"),
    Knob(
        "selection",
        "area",
        ("none", "root-area", "area"),
        "what coefficients are weighted by before the largest are chosen: the area of their wavelet's support",
    ),
    Knob("precision", "single", ("bfloat16", "single"), "of the products of a frame"),
)
"""Of all methods whose light is in wavelets; none of them needs another training."""

TRAINING = (
    Knob("network", "full", ("small", "full"), "of 32 or the paper's 64 products", trains=True),
    Knob("faces", 64, (16, 32, 64), "texels along a face of the cubemap of light", trains=True),
    Knob("encoding", True, (False, True), "spherical harmonics of the reflected direction", trains=True),
    Knob(
        "pixels",
        "important",
        ("uniform", "important"),
        "where training looks: anywhere, or also where it is hard",
        trains=True,
    ),
    Knob("batch", 2048, (64, 256, 512, 1024, 2048), "pixels of a step", trains=True),
    Knob("learned", 300, (16, 32, 64, 96, 150, 300), "wavelets of a step", trains=True),
)
"""Knobs of the training of a network of wavelets."""

METHOD = Method(
    id="nfvr",
    title="Neural free-viewpoint relighting",
    family="neural",
    tracks=("relight",),
    paper="Raghavan et al. 2023, Neural Free-Viewpoint Relighting for Glossy Indirect Illumination",
    implementation="gibench.baselines.neural_free_viewpoint_relighting.implementation:NeuralRelighting",
    channels=CHANNELS,
    knobs=(
        *WAVELETS,
        *DENOISED,
        *TRAINING,
        Knob(
            "table",
            19,
            (12, 13, 14, 15, 16, 17, 18, 19, 20),
            "binary logarithm of the entries of a level of the hash grid",
            trains=True,
        ),
    ),
    budget="wavelets",
    trains=True,
    variants=(
        Variant("no-encoding", {"encoding": False}),
        Variant("uniform-pixels", {"pixels": "uniform"}),
    ),
)
