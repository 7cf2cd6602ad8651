"""Real-time path tracing: a few paths a pixel and a denoiser, without preparation."""

from gibench.baselines.method import Knob, Method

METHOD = Method(
    id="path-traced",
    title="Real-time path tracing",
    family="ray tracing",
    tracks=("walkthrough", "moving-light", "relight", "unseen-rooms"),
    paper="the real-time path tracer of Rodriguez et al. 2020, section 7.3.1",
    implementation="gibench.baselines.path_traced.tracer:PathTracer",
    knobs=(
        Knob("spp", 2, (1, 2, 4, 8, 16, 32), "paths a pixel"),
        Knob("denoise", True, (False, True), "whether Open Image Denoise removes the noise"),
    ),
    budget="spp",
)
