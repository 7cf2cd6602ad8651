"""Materials of the parts of a room: the choices that make its things belong together."""

from __future__ import annotations

import zlib

import numpy as np

from gibench.generators.light_shapes import LAMP_MATERIAL
from gibench.generators.materials import sample_material
from gibench.generators.parts import Material

# How far one draw of a slot reaches: over the whole room, over all things of a family, or over one thing.
ROOM, FAMILY, THING = "room", "family", "thing"
REACH = {
    "wood": ROOM,
    "metal": ROOM,
    "chrome": ROOM,
    "brass": ROOM,
    "soil": ROOM,
    "screen": ROOM,
    "mirror": ROOM,
    "enamel": ROOM,
    "plastic": ROOM,
    "leaf": THING,
    "pot": THING,
    "ceramic": THING,
    "glassware": THING,
    "picture": THING,
    "carpet": THING,
}  # all other slots: FAMILY
WOODS = 2  # kinds of wood in a room


class Palette:
    """The materials of one room, drawn when first asked for.

    Every draw has a random generator of its own, seeded by what it is for, so that one thing more in the room
    does not change what the others are made of.
    """

    def __init__(self, entropy: np.random.SeedSequence, room_kind: str) -> None:
        """entropy: the lane of materials."""
        self.room_kind = room_kind
        self.materials: dict[str, Material] = {
            LAMP_MATERIAL: Material(LAMP_MATERIAL, "lamp", "diffuse", (0.6, 0.6, 0.6))
        }
        self._entropy = entropy
        self._drawn: dict[str, str] = {}
        self._glossy: set[tuple[str, str]] = set()

    def polish(self, family: str, slot: str) -> None:
        """Make what has not been drawn yet of a family's slot a polished surface."""
        self._glossy.add((family, slot))

    def rng(self, key: str) -> np.random.Generator:
        """The generator of a draw with that key."""
        spawn = (*self._entropy.spawn_key, zlib.crc32(key.encode()))
        return np.random.default_rng(np.random.SeedSequence(self._entropy.entropy, spawn_key=spawn))

    def name_of(self, thing: str, family: str, slot: str, variant: str) -> str:
        """Name of the material of a part: of the thing of that name, in its family's slot and variant."""
        glossy = (family, slot) in self._glossy
        reach = REACH.get(slot, FAMILY)
        if glossy:
            key = f"{slot}/{family}/polished"
        elif slot == "wood":
            # Most families share the first wood of the room.
            key = f"wood/{int(self.rng(f'wood of {family}').random() < 0.3) % WOODS}"
        elif reach == ROOM:
            key = f"{slot}/{variant}"
        elif reach == FAMILY:
            key = f"{slot}/{family}/{variant}"
        else:
            key = f"{slot}/{thing}/{variant}"
        if key not in self._drawn:
            material = sample_material(self.rng(key), slot, room_kind=self.room_kind, glossy=glossy)
            self.materials.setdefault(material.name, material)
            self._drawn[key] = material.name
        return self._drawn[key]
