"""Image space gathering: mirror reflections, blurred on the screen into glossy ones."""

from __future__ import annotations

from gibench.baselines.lightmap.knobs import LIGHTMAP_KNOBS, RAYS
from gibench.baselines.method import Knob, Method

METHOD = Method(
    id="isg",
    title="Image space gathering",
    family="screen space",
    tracks=("walkthrough",),
    paper="Robison and Shirley 2009, Image Space Gathering",
    implementation="gibench.baselines.image_space_gathering.implementation:ImageSpaceGathering",
    knobs=(
        Knob("taps", 32, (8, 16, 32, 64, 128), "samples of the gather, a camera ray"),
        *LIGHTMAP_KNOBS,
        RAYS,
    ),
    budget="taps",
)
