"""What the methods share that relight a scene: direct light, path traced, and indirect light surface by surface."""

from __future__ import annotations

from gibench.baselines.method import Knob

SURFACE = ("position", "normal", "albedo", "specular_albedo", "roughness")
"""Channels of what is seen, that indirect light is worked out from."""

CHANNELS = ("indirect_diffuse", "indirect_specular", *SURFACE)
"""Of a training frame."""

DENOISED = (
    Knob("spp", 16, (1, 2, 4, 8, 16, 32), "paths a pixel of direct light, which is always denoised"),
    Knob("denoise", True, (False, True), "whether Open Image Denoise sees indirect light too"),
)
"""Knobs of all of them."""
