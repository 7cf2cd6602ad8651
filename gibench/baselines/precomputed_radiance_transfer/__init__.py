"""Precomputed radiance transfer in spherical harmonics (Sloan et al. 2002), of indirect light, on vertices."""

from __future__ import annotations

from gibench.baselines.method import Knob, Method
from gibench.baselines.relighting import DENOISED

METHOD = Method(
    id="sh-prt",
    title="Precomputed radiance transfer in spherical harmonics",
    family="precomputed transfer",
    tracks=("relight",),
    paper="Sloan, Kautz & Snyder 2002, Precomputed Radiance Transfer for Real-Time Rendering in Dynamic, Low-Frequency "
    "Lighting Environments; the baseline of Raghavan et al. 2023, Table 6",
    implementation="gibench.baselines.precomputed_radiance_transfer.implementation:HarmonicTransfer",
    channels=("position", "normal"),
    knobs=(
        Knob("degree", 8, (0, 1, 2, 4, 6, 8), "of the harmonics that light is taken in"),
        Knob(
            "window", 0.005, (0.0, 0.0005, 0.005, 0.05), "how much high degrees are damped, against ringing"
        ),
        *DENOISED,
        Knob("reflected", 8, (2, 4, 6, 8), "degree of the light that arrives at a vertex", bakes=True),
        Knob("edge", 0.05, (0.5, 0.2, 0.1, 0.05, 0.02), "metres along an edge of the even mesh", bakes=True),
        Knob("paths", 1024, (64, 256, 1024, 4096), "from a vertex", bakes=True),
    ),
    budget="spp",
)
