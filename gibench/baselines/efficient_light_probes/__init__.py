"""Efficient Light Probes (Guo et al. 2022): probes that are searched for the reflection which a pixel sees.

`elp-search` is the method up to its network, as in Table 1 of the paper; `elp` is all of it.
"""

from gibench.baselines.lightmap.knobs import LIGHTMAP_KNOBS, RAYS
from gibench.baselines.method import Knob, Method, Variant
from gibench.baselines.probes.knobs import PROBE_KNOBS

SEARCH_KNOBS = (
    Knob("candidates", 8, (1, 2, 4, 8, 16), "probes nearest to the camera that are searched, K"),
    Knob("steps", 20, (1, 2, 5, 10, 20), "steps of a search at most, N_max"),
    Knob(
        "tolerance",
        0.1,
        (0.001, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 10.0),
        "metres between what a probe reflects and what the pixel does, at most, D_max",
    ),
)

SEARCH = Method(
    id="elp-search",
    title="Efficient light probes (search)",
    family="probes",
    tracks=("walkthrough",),
    paper="Guo et al. 2022, Efficient Light Probes for Real-time Global Illumination, section 4.3",
    implementation="gibench.baselines.efficient_light_probes.implementation:ReflectionSearch",
    knobs=(*SEARCH_KNOBS, *PROBE_KNOBS, *LIGHTMAP_KNOBS, RAYS),
    budget="rays",
)

METHOD = Method(
    id="elp",
    title="Efficient light probes",
    family="probes",
    tracks=("walkthrough",),
    paper="Guo et al. 2022, Efficient Light Probes for Real-time Global Illumination",
    implementation="gibench.baselines.efficient_light_probes.reconstruction:Reconstruction",
    channels=("color",),
    knobs=(
        Knob(
            "fusion",
            "modulation",
            ("modulation", "concatenation"),
            "how features of the G-buffers act on those of the image",
            bakes=True,
        ),
        Knob("lpips", True, (False, True), "whether the perceptual loss is trained for", bakes=True),
        Knob(
            "temporal", True, (False, True), "earlier frames in the input and the temporal loss", bakes=True
        ),
        Knob("epochs", 1000, (2, 20, 100, 200, 400, 1000), "passes over the training views", bakes=True),
        Knob(
            "crop",
            128,
            (32, 64, 96, 128, 256, 512),
            "pixels along a side of what a step learns from",
            bakes=True,
        ),
        *SEARCH_KNOBS,
        *PROBE_KNOBS,
        *LIGHTMAP_KNOBS,
        RAYS,
    ),
    budget="rays",
    trained=True,
    variants=(
        Variant("concatenation", {"fusion": "concatenation"}),
        Variant("no-lpips", {"lpips": False}),
        Variant("no-temporal", {"temporal": False}),
    ),
)
