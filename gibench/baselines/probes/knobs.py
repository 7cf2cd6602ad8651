"""Settings of the probes, the same in every method's card, so that equal settings share one bake."""

from __future__ import annotations

from gibench.baselines.method import Knob

PROBE_KNOBS = (
    Knob("probes", 64, (8, 16, 32, 64, 128, 256, 512), "probes in the grid, about", bakes=True),
    Knob(
        "probe_width",
        256,
        (32, 64, 128, 256, 512, 1024),
        "texels around a probe; half as many from top to bottom",
        bakes=True,
    ),
    Knob("probe_spp", 16, (1, 4, 16, 64, 128, 256, 1024, 2048), "paths a texel", bakes=True),
    Knob("probe_denoise", False, (False, True), "whether the maps are denoised", bakes=True),
)
"""The papers have 252 probes of 1024 × 512 at 2048 paths a texel (Rodriguez et al. 2020, section 7) and 256 of the
same size at 128 (Guo et al. 2022, section 5)."""
