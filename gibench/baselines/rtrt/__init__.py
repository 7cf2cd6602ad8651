"""Real-time ray tracing of glossy paths over a lightmap: the baseline of Guo et al. 2022 and Rodriguez et al. 2020."""

from __future__ import annotations

from gibench.baselines.lightmap.knobs import LIGHTMAP_KNOBS, RAYS
from gibench.baselines.method import Knob, Method

METHOD = Method(
    id="rtrt",
    title="Lightmap + glossy rays",
    family="ray tracing",
    tracks=("walkthrough",),
    paper="Rodriguez et al. 2020, Glossy Probe Reprojection, section 7.3.1",
    implementation="gibench.baselines.rtrt.implementation:GlossyRays",
    knobs=(
        Knob("samples", 4, (1, 2, 4, 8, 16), "glossy paths from each first hit"),
        Knob("bounces", 3, (1, 2, 3), "glossy reflections along a path, the first included"),
        Knob("denoise", True, (False, True), "OIDN over the specular image"),
        *LIGHTMAP_KNOBS,
        RAYS,
    ),
    budget="samples",
)
