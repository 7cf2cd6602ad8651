"""Direct light, and one constant times albedo for all the rest: what games shipped before they had anything better."""

from __future__ import annotations

from gibench.baselines.direct_light import SAMPLING
from gibench.baselines.method import Method

METHOD = Method(
    id="ambient",
    title="Direct and ambient light",
    family="ray tracing",
    tracks=("moving-light", "relight", "unseen-rooms"),
    paper="a baseline of Gai et al., Geometry-Aware Global Feature Aggregation for Real-Time Indirect Illumination",
    implementation="gibench.baselines.ambient_light.implementation:AmbientLight",
    channels=("indirect_diffuse", "indirect_specular", "albedo"),
    knobs=SAMPLING,
    budget="spp",
    trains=True,
)
