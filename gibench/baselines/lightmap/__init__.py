"""Diffuse light baked into a texture over all surfaces: the method `lightmap`, and what others stand on.

`lookup` reads a lightmap, `bake` makes one; both need a renderer, this file does not.
"""

from __future__ import annotations

from gibench.baselines.lightmap.knobs import LIGHTMAP_KNOBS, RAYS
from gibench.baselines.method import Method

METHOD = Method(
    id="lightmap",
    title="Lightmap",
    family="precomputed",
    tracks=("walkthrough",),
    paper="Guo et al. 2022, Efficient Light Probes for Real-Time Global Illumination, section 4.1",
    implementation="gibench.baselines.lightmap.implementation:LightmapMethod",
    knobs=(*LIGHTMAP_KNOBS, RAYS),
    budget="rays",
)
