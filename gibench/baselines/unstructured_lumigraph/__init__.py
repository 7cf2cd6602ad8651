"""Unstructured lumigraph rendering with the probes as its cameras."""

from gibench.baselines.lightmap.knobs import LIGHTMAP_KNOBS, RAYS
from gibench.baselines.method import Knob, Method
from gibench.baselines.probes.knobs import PROBE_KNOBS

METHOD = Method(
    id="ulr",
    title="Unstructured lumigraph",
    family="probes",
    tracks=("walkthrough",),
    paper="Buehler et al. 2001, Unstructured Lumigraph Rendering",
    implementation="gibench.baselines.unstructured_lumigraph.blending:UnstructuredLumigraph",
    knobs=(
        *PROBE_KNOBS,
        *LIGHTMAP_KNOBS,
        Knob(
            "candidates", 16, (8, 16, 32, 64), "probes nearest to the camera that are weighed at each point"
        ),
        RAYS,
    ),
    budget="rays",
)
