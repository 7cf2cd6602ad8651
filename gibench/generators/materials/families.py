"""The registry of material families: a new one is a new file and a line here."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import NamedTuple

from gibench.generators.parts import Material


class MaterialFamily(NamedTuple):
    """build(**parameters) has no randomness; sample(rng, role, **fixed) draws them within a `Role`."""

    build: Callable[..., Material]
    sample: Callable[..., Material]


# Family `name` lives in the module `name`, which holds the functions `name` and `sample_name`.
_NAMES = (
    "brick",
    "carpet",
    "concrete",
    "fabric",
    "foliage",
    "leather",
    "metal",
    "mirror",
    "paint",
    "parquet",
    "picture",
    "planks",
    "plaster",
    "rug",
    "soil",
    "stone",
    "terrazzo",
    "tile",
    "wallpaper",
    "wicker",
    "wood",
)


def _family(name: str) -> MaterialFamily:
    module = importlib.import_module(f"gibench.generators.materials.{name}")
    return MaterialFamily(getattr(module, name), getattr(module, f"sample_{name}"))


MATERIALS: dict[str, MaterialFamily] = {name: _family(name) for name in _NAMES}
