"""What networks share that predict the indirect light of one room under an area light that moves.

`measure` is what numbers of a room are divided by, `lit_frames` is direct light and surfaces of a frame that is being
rendered, on the device.
"""

SURFACE = ("position", "normal", "albedo", "specular_albedo", "roughness")
"""Channels of what is seen, that networks are given."""

LIT = ("direct_diffuse", "direct_specular", "indirect_diffuse", "indirect_specular")
"""Channels of light in the training frames."""
