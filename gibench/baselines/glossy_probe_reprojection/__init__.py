"""Glossy Probe Reprojection (Rodriguez et al. 2020): probes searched where a reflection should be, then filtered."""

from gibench.baselines.lightmap.knobs import LIGHTMAP_KNOBS, RAYS
from gibench.baselines.method import Knob, Method, Variant
from gibench.baselines.probes.knobs import PROBE_KNOBS

METHOD = Method(
    id="gpr",
    title="Glossy probe reprojection",
    family="probes",
    tracks=("walkthrough",),
    paper="Rodriguez et al. 2020, Glossy Probe Reprojection for Interactive Global Illumination",
    implementation="gibench.baselines.glossy_probe_reprojection.implementation:GlossyProbeReprojection",
    knobs=(
        Knob("used", 8, (1, 2, 4, 8), "probes around the camera that are searched"),
        Knob("window", 7, (1, 3, 5, 7, 9), "samples along a side of the coarse search"),
        Knob("levels", 2, (1, 2), "of the search: 1 leaves the fine one out"),
        Knob("order", 2, (0, 1, 2), "of the path perturbation that a search starts at"),
        Knob("paraboloid", True, (False, True), "whether surfaces are curved to the perturbation, or flat"),
        Knob(
            "parameterization",
            "adaptive",
            ("plain", "adaptive"),
            "of the maps: even, or more texels for what is smooth, far or intricate",
            bakes=True,
        ),
        Knob(
            "halved",
            True,
            (False, True),
            "probes of half the roughness: first step of the convolution",
            bakes=True,
        ),
        Knob("filter", True, (False, True), "second step of the convolution, over the screen"),
        Knob("taps", 12, (4, 8, 12, 24, 48), "samples to either side in a pass of the filter"),
        Knob(
            "history", True, (False, True), "whether the frame before stands in where no probe has a sample"
        ),
        Knob("unit", 1.0, (0.01, 0.1, 1.0, 10.0, 100.0), "metres that count as one: the scale of the scene"),
        *PROBE_KNOBS,
        *LIGHTMAP_KNOBS,
        RAYS,
    ),
    budget="rays",
    variants=(
        Variant("plain", {"parameterization": "plain"}),
        Variant("planar", {"paraboloid": False}),
        Variant("small-window", {"window": 3}),
        Variant("one-level", {"levels": 1}),
        Variant("four-probes", {"used": 4}),
        Variant("no-filter", {"filter": False}),
        Variant("whole-roughness", {"halved": False, "filter": False}),
    ),
)
