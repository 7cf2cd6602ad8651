"""Materials of rooms and furniture: procedural, tileable, of physically plausible reflectance and roughness.

A slot ("floor", "fabric", "chrome" …) is the role that a part plays; `sample_material` draws a material for
it. Every family has a file with a builder `wood(**parameters)`, which has no randomness, and a sampler
`sample_wood(rng, role, **fixed)`. A new family is a new file and a line in `families.py`.
"""

from gibench.generators.materials.bsdf import base_color, bsdf_xml, is_glossy, tile_size
from gibench.generators.materials.color import mean_luminance
from gibench.generators.materials.errors import BadMaterial, UnknownSlot
from gibench.generators.materials.families import MATERIALS, MaterialFamily
from gibench.generators.materials.slots import ROOM_KINDS, SLOTS, SlotRule, build_material, sample_material

__all__ = [
    "MATERIALS",
    "ROOM_KINDS",
    "SLOTS",
    "BadMaterial",
    "MaterialFamily",
    "SlotRule",
    "UnknownSlot",
    "base_color",
    "bsdf_xml",
    "build_material",
    "is_glossy",
    "mean_luminance",
    "sample_material",
    "tile_size",
]
