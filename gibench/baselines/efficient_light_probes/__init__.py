"""Efficient Light Probes (Guo et al. 2022): probes that are searched for the reflection which a pixel sees.

`elp-search` is the method up to its network, as in Table 1 of the paper.
"""

from gibench.baselines.lightmap.knobs import LIGHTMAP_KNOBS, RAYS
from gibench.baselines.method import Knob, Method
from gibench.baselines.probes.knobs import PROBE_KNOBS

SEARCH = Method(
    id="elp-search",
    title="Efficient light probes (search)",
    family="probes",
    tracks=("walkthrough",),
    paper="Guo et al. 2022, Efficient Light Probes for Real-time Global Illumination, section 4.3",
    implementation="gibench.baselines.efficient_light_probes.implementation:ReflectionSearch",
    knobs=(
        Knob("candidates", 8, (1, 2, 4, 8, 16), "probes nearest to the camera that are searched, K"),
        Knob("steps", 20, (1, 2, 5, 10, 20), "steps of a search at most, N_max"),
        Knob(
            "tolerance",
            0.1,
            (0.02, 0.05, 0.1, 0.2, 0.5, 1.0),
            "metres between what a probe reflects and what the pixel does, at most, D_max",
        ),
        *PROBE_KNOBS,
        *LIGHTMAP_KNOBS,
        RAYS,
    ),
    budget="rays",
)
