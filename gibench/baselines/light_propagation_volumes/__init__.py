"""Light propagation volumes (Kaplanyan & Dachsbacher 2010): light that spreads from cell to cell of a grid."""

from __future__ import annotations

from gibench.baselines.linearly_transformed_cosines import SHADOWS
from gibench.baselines.method import Knob, Method

METHOD = Method(
    id="lpv",
    title="Light propagation volumes",
    family="volumes",
    tracks=("moving-light",),
    paper="Kaplanyan & Dachsbacher 2010, Cascaded Light Propagation Volumes for Real-Time Indirect Illumination",
    implementation="gibench.baselines.light_propagation_volumes.implementation:PropagatedLight",
    knobs=(
        Knob("cells", 32, (8, 16, 32, 64), "along the longest side of the room", bakes=True),
        Knob("steps", 8, (2, 4, 8, 16, 32, 64), "of propagation, from each cell to its neighbours"),
        Knob("virtual_lights", 65536, (4096, 16384, 65536), "paths that the light emits"),
        Knob("bounces", 1, (1, 2, 4), "hits of a path that become virtual lights"),
        Knob("geometry", True, (False, True), "whether surfaces between two cells block light"),
        *SHADOWS,
    ),
    budget="steps",
)
"""The method `lpv`: indirect light of diffuse surfaces from a volume, direct light by linearly transformed cosines."""
