"""The probe nearest to the camera, looked up where the point is seen from it: the naive way."""

from gibench.baselines.lightmap.knobs import LIGHTMAP_KNOBS, RAYS
from gibench.baselines.method import Method
from gibench.baselines.probes.knobs import PROBE_KNOBS

METHOD = Method(
    id="nearest-probe",
    title="Nearest probe",
    family="probes",
    tracks=("walkthrough",),
    paper="the naive lookup of Guo et al. 2022, Figure 6",
    implementation="gibench.baselines.nearest_probe.lookup:NearestProbe",
    knobs=(*PROBE_KNOBS, *LIGHTMAP_KNOBS, RAYS),
    budget="rays",
)
