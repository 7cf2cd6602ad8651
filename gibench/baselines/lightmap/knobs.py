"""The knobs of whatever stands on a lightmap, so that all such methods share one bake."""

from __future__ import annotations

from gibench.baselines.method import Knob

TEXELS = Knob("texels", 16, (4, 8, 16, 32, 64), "texels a metre of the lightmap", bakes=True)
LIGHTMAP_SPP = Knob("lightmap_spp", 256, (16, 64, 256, 1024), "paths a texel of the lightmap", bakes=True)
LIGHTMAP_DENOISE = Knob(
    "lightmap_denoise", True, (False, True), "OIDN's lightmap filter over the atlas", bakes=True
)
LIGHTMAP_KNOBS = (TEXELS, LIGHTMAP_SPP, LIGHTMAP_DENOISE)

RAYS = Knob("rays", 4, (1, 4, 16), "camera rays a pixel, on a square grid: antialiasing")
