"""Light field probes (McGuire et al. 2017): glossy rays that are marched through octahedral probes."""

from gibench.baselines.lightmap.knobs import LIGHTMAP_KNOBS, RAYS
from gibench.baselines.method import Knob, Method
from gibench.baselines.probes.knobs import PROBE_KNOBS

METHOD = Method(
    id="light-field-probes",
    title="Light field probes",
    family="probes",
    tracks=("walkthrough",),
    paper="McGuire et al. 2017, Real-time Global Illumination using Precomputed Light Field Probes",
    implementation="gibench.baselines.light_field_probes.implementation:LightFieldProbes",
    knobs=(
        Knob("glossy_rays", 2, (1, 2, 4, 8, 16), "glossy rays from each first hit"),
        Knob("denoise", True, (False, True), "OIDN over the specular image"),
        Knob(
            "metre",
            1.0,
            (0.01, 0.1, 1.0, 10.0, 100.0),
            "length in the scene that the paper's metre stands for: thickness of surfaces, start of rays",
        ),
        *PROBE_KNOBS,
        *LIGHTMAP_KNOBS,
        RAYS,
    ),
    budget="glossy_rays",
)
