"""Learned vectors on the vertices of an even mesh, in the place of a hash grid (Raghavan et al. 2023, Table 6)."""

from __future__ import annotations

from gibench.baselines.method import Knob, Method
from gibench.baselines.neural_free_viewpoint_relighting import TRAINING, WAVELETS
from gibench.baselines.relighting import CHANNELS, DENOISED

METHOD = Method(
    id="vertex-features",
    title="Features on vertices",
    family="neural",
    tracks=("relight",),
    paper="Raghavan et al. 2023, Neural Free-Viewpoint Relighting for Glossy Indirect Illumination, Table 6",
    implementation="gibench.baselines.vertex_features.implementation:VertexFeatures",
    channels=CHANNELS,
    knobs=(
        *WAVELETS,
        *DENOISED,
        *TRAINING,
        Knob("edge", 0.05, (0.2, 0.1, 0.05, 0.02), "metres along an edge of the even mesh", trains=True),
    ),
    budget="wavelets",
    trains=True,
)
