"""Direct light by linearly transformed cosines (Heitz et al. 2016), with shadows by a ratio of samples (2018)."""

from __future__ import annotations

from gibench.baselines.method import Knob, Method

SHADOWS = (
    Knob("shadow_rays", 4, (1, 2, 4, 8, 16), "towards the light, for each camera ray"),
    Knob("rays", 4, (1, 4), "camera rays a pixel, on a square grid: antialiasing"),
)

METHOD = Method(
    id="ltc-direct",
    title="Direct light by linearly transformed cosines",
    family="analytic",
    tracks=("moving-light",),
    paper="Heitz et al. 2016, Real-Time Polygonal-Light Shading with Linearly Transformed Cosines, and 2018, "
    "Combining Analytic Direct Illumination and Stochastic Shadows",
    implementation="gibench.baselines.linearly_transformed_cosines.implementation:AnalyticLight",
    knobs=SHADOWS,
    budget="shadow_rays",
)
