"""Direct light alone: what methods that predict indirect light start from, and must beat."""

from __future__ import annotations

from gibench.baselines.method import Knob, Method

SAMPLING = (
    Knob("spp", 16, (1, 2, 4, 8, 16, 32), "light paths a pixel, of one scattering event"),
    Knob("denoise", True, (False, True), "whether Open Image Denoise removes the noise"),
)

METHOD = Method(
    id="direct",
    title="Direct light",
    family="ray tracing",
    tracks=("moving-light", "relight", "unseen-rooms"),
    paper="a baseline of Gai et al., Geometry-Aware Global Feature Aggregation for Real-Time Indirect Illumination",
    implementation="gibench.baselines.direct_light.tracer:DirectLight",
    knobs=SAMPLING,
    budget="spp",
)
