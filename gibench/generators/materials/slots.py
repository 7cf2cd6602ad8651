"""The materials that may fill each slot, and `sample_material`, which picks one."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gibench.generators.materials.errors import BadMaterial, UnknownSlot
from gibench.generators.materials.families import MATERIALS
from gibench.generators.materials.roles import GLOSSY_ALPHA, Role
from gibench.generators.parts import Material

ROOM_KINDS = ("living", "bedroom", "dining-kitchen", "office", "bathroom")

MATT = (0.0, 0.0)
MIRROR_LIKE = (0.005, GLOSSY_ALPHA)


@dataclass(frozen=True)
class SlotRule:
    """The materials that may fill a slot.

    families: family → weight. rooms: room kind → weights that replace them there. luminance: range of the
    mean diffuse reflectance. alpha: range of GGX roughness, log-uniform; `MATT` for diffuse. family_alpha:
    family → its own range. family_luminance: likewise.
    """

    families: Mapping[str, float]
    luminance: tuple[float, float]
    alpha: tuple[float, float]
    rooms: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    family_alpha: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    family_luminance: Mapping[str, tuple[float, float]] = field(default_factory=dict)


def _one(family: str, luminance: tuple[float, float], alpha: tuple[float, float]) -> SlotRule:
    return SlotRule({family: 1.0}, luminance, alpha)


SLOTS: dict[str, SlotRule] = {
    "floor": SlotRule(
        {
            "planks": 0.42,
            "parquet": 0.22,
            "tile": 0.1,
            "stone": 0.08,
            "carpet": 0.12,
            "terrazzo": 0.03,
            "concrete": 0.03,
        },
        (0.2, 0.4),
        (0.02, 0.35),
        rooms={
            "bedroom": {"planks": 0.4, "parquet": 0.18, "carpet": 0.37, "tile": 0.05},
            "dining-kitchen": {"tile": 0.4, "planks": 0.3, "parquet": 0.1, "stone": 0.1, "terrazzo": 0.1},
            "office": {"carpet": 0.4, "planks": 0.25, "concrete": 0.15, "tile": 0.1, "terrazzo": 0.1},
            "bathroom": {"tile": 0.65, "stone": 0.2, "terrazzo": 0.15},
        },
        family_alpha={
            "tile": (0.005, 0.3),
            "stone": (0.005, 0.2),
            "terrazzo": (0.005, 0.15),
            "concrete": (0.05, 0.4),
        },
    ),
    "ceiling": SlotRule({"paint": 0.7, "plaster": 0.3}, (0.7, 0.86), MATT),
    "wall": SlotRule(
        {"paint": 0.52, "plaster": 0.18, "wallpaper": 0.2, "brick": 0.06, "concrete": 0.04},
        (0.4, 0.8),
        MATT,
        rooms={
            "bathroom": {"tile": 0.6, "stone": 0.1, "paint": 0.2, "plaster": 0.1},
            "dining-kitchen": {"paint": 0.6, "plaster": 0.2, "brick": 0.1, "tile": 0.1},
            "office": {"paint": 0.7, "plaster": 0.12, "concrete": 0.12, "brick": 0.06},
        },
        family_alpha={"tile": (0.005, 0.2), "stone": (0.005, 0.2)},
        family_luminance={"brick": (0.3, 0.65), "concrete": (0.3, 0.5), "wallpaper": (0.35, 0.75)},
    ),
    "skirting": SlotRule(
        {"paint": 0.75, "wood": 0.25}, (0.5, 0.82), (0.08, 0.4), family_luminance={"wood": (0.2, 0.5)}
    ),
    "door": SlotRule(
        {"paint": 0.6, "wood": 0.4}, (0.4, 0.82), (0.08, 0.4), family_luminance={"wood": (0.2, 0.5)}
    ),
    "window_frame": SlotRule(
        {"paint": 0.8, "wood": 0.2}, (0.5, 0.82), (0.08, 0.4), family_luminance={"wood": (0.2, 0.5)}
    ),
    "sill": SlotRule(
        {"paint": 0.5, "stone": 0.35, "wood": 0.15},
        (0.4, 0.82),
        (0.05, 0.4),
        family_alpha={"stone": (0.005, 0.15)},
        family_luminance={"wood": (0.2, 0.5)},
    ),
    "splashback": SlotRule({"tile": 0.7, "stone": 0.2, "paint": 0.1}, (0.3, 0.8), (0.005, 0.12)),
    "wood": _one("wood", (0.2, 0.5), (0.06, 0.5)),
    "lacquer": _one("paint", (0.2, 0.7), (0.005, 0.4)),
    "fabric": _one("fabric", (0.2, 0.6), MATT),
    "leather": _one("leather", (0.2, 0.38), (0.15, 0.45)),
    "linen": _one("fabric", (0.4, 0.8), MATT),
    "carpet": SlotRule({"rug": 0.65, "carpet": 0.35}, (0.2, 0.5), MATT),
    "curtain": _one("fabric", (0.3, 0.7), MATT),
    "metal": _one("metal", (0.2, 0.9), (0.08, 0.4)),
    "chrome": _one("metal", (0.2, 0.9), (0.005, 0.06)),
    "brass": _one("metal", (0.2, 0.9), (0.03, 0.3)),
    "ceramic": _one("paint", (0.2, 0.82), (0.005, 0.12)),
    "stone": SlotRule({"stone": 0.75, "terrazzo": 0.15, "concrete": 0.1}, (0.2, 0.7), (0.005, 0.2)),
    "plastic": _one("paint", (0.05, 0.7), (0.05, 0.4)),
    "screen": _one("paint", (0.02, 0.05), (0.005, 0.05)),
    "mirror": _one("mirror", (0.85, 0.89), MATT),
    "paper": _one("paint", (0.1, 0.7), MATT),
    "picture": _one("picture", (0.2, 0.5), MATT),
    "leaf": _one("foliage", (0.08, 0.25), (0.15, 0.4)),
    "soil": _one("soil", (0.04, 0.1), MATT),
    "lampshade": _one("fabric", (0.5, 0.8), MATT),
    "rattan": _one("wicker", (0.25, 0.5), MATT),
    "pot": _one("paint", (0.15, 0.7), (0.005, 0.5)),
    "enamel": _one("paint", (0.7, 0.85), (0.005, 0.06)),
    "glassware": _one("paint", (0.2, 0.7), (0.005, 0.03)),
}

# What takes a polish: the families that `glossy=True` chooses from, where the slot has them.
_POLISHABLE = frozenset(
    {"planks", "parquet", "wood", "tile", "stone", "terrazzo", "concrete", "paint", "metal"}
)


def sample_material(
    rng: np.random.Generator,
    slot: str,
    *,
    room_kind: str = "living",
    family: str | None = None,
    glossy: bool = False,
    **fixed: Any,
) -> Material:
    """Draw a material for a slot.

    slot: a key of `SLOTS`. room_kind: one of `ROOM_KINDS`. family: fixes the family. glossy: asks for a
    polished surface, alpha in [0.005, 0.1], of a family that takes a polish. fixed: parameters of the family
    that are not drawn. The material's `parameters` rebuild it: `build_material(material.family,
    material.parameters)`.

    Raises UnknownSlot for a slot, room kind or family that does not exist; BadMaterial for a fixed parameter
    that the family does not have, or `glossy` where the slot has nothing to polish.
    """
    rule = _find(SLOTS, slot, "slot")
    _find(dict.fromkeys(ROOM_KINDS), room_kind, "room kind")
    weights = dict(rule.rooms.get(room_kind, rule.families))
    if glossy:
        weights = {name: w for name, w in weights.items() if name in _POLISHABLE}
        if not weights:
            raise BadMaterial(
                f"slot {slot!r} has no family that takes a polish in a {room_kind}; leave out glossy"
            )
    share = np.array(list(weights.values()))
    drawn = str(rng.choice(list(weights), p=share / share.sum()))
    chosen = drawn if family is None else family
    found = _find(MATERIALS, chosen, "material family")
    alpha = MIRROR_LIKE if glossy else rule.family_alpha.get(chosen, rule.alpha)
    luminance = rule.family_luminance.get(chosen, rule.luminance)
    return found.sample(rng, Role(slot, luminance, alpha), **fixed)


def build_material(family: str, parameters: Mapping[str, Any]) -> Material:
    """Build a material again from its family and parameters, with no randomness. Raises UnknownSlot."""
    return _find(MATERIALS, family, "material family").build(**parameters)


def _find(table: Mapping[str, Any], name: str, what: str) -> Any:
    """The entry of a table, or UnknownSlot with the nearest names."""
    if name not in table:
        near: Iterable[str] = difflib.get_close_matches(name, table, n=3) or sorted(table)
        raise UnknownSlot(f"there is no {what} {name!r}; did you mean {', '.join(near)}?")
    return table[name]
