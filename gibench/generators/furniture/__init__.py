"""Furniture: every family is one file with a build/sample pair, and one line in the table below.

A family's file `chair.py` holds `chair(**parameters)`, which builds without randomness, and
`sample_chair(rng, **fixed)`, which draws the parameters that are not fixed and calls it. Width is along x,
depth along y (a bed is as deep as it is long: its head is at the back), height along z.
"""

from __future__ import annotations

import difflib
import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import FurnitureError
from gibench.generators.parts import Furniture

__all__ = ["FAMILIES", "Family", "FurnitureError", "build_furniture", "sample_furniture"]


@dataclass(frozen=True)
class Family:
    """A kind of furniture. mount: "floor", "wall", "ceiling" or "surface"; module: the file in this
    folder."""

    name: str
    mount: str

    @property
    def module(self) -> str:
        """The import path of the family's file."""
        return f"{__name__}.{self.name}"

    @property
    def build(self) -> Callable[..., Furniture]:
        """The builder: keyword parameters in, Furniture out."""
        builder: Callable[..., Furniture] = getattr(importlib.import_module(self.module), self.name)
        return builder

    @property
    def sample(self) -> Callable[..., Furniture]:
        """The sampler: (rng, **fixed) in, Furniture out."""
        sampler: Callable[..., Furniture] = getattr(
            importlib.import_module(self.module), f"sample_{self.name}"
        )
        return sampler


FAMILIES: dict[str, Family] = {
    family.name: family
    for family in (
        Family("armchair", "floor"),
        Family("bathtub", "floor"),
        Family("bed", "floor"),
        Family("bench", "floor"),
        Family("book_row", "surface"),
        Family("bookcase", "floor"),
        Family("books", "surface"),
        Family("bottle", "surface"),
        Family("bowl", "surface"),
        Family("box", "surface"),
        Family("chair", "floor"),
        Family("coffee_table", "floor"),
        Family("curtain", "wall"),
        Family("desk", "floor"),
        Family("desk_lamp", "surface"),
        Family("dining_table", "floor"),
        Family("dresser", "floor"),
        Family("floor_lamp", "floor"),
        Family("fridge", "floor"),
        Family("keyboard", "surface"),
        Family("kitchen_counter", "floor"),
        Family("laptop", "surface"),
        Family("mirror", "wall"),
        Family("monitor", "surface"),
        Family("mug", "surface"),
        Family("nightstand", "floor"),
        Family("office_chair", "floor"),
        Family("ottoman", "floor"),
        Family("pendant", "ceiling"),
        Family("picture", "wall"),
        Family("plant", "floor"),
        Family("rug", "floor"),
        Family("shelf", "floor"),
        Family("shower", "floor"),
        Family("side_table", "floor"),
        Family("small_plant", "surface"),
        Family("sofa", "floor"),
        Family("stool", "floor"),
        Family("table_lamp", "surface"),
        Family("toilet", "floor"),
        Family("tv", "surface"),
        Family("tv_stand", "floor"),
        Family("vase", "surface"),
        Family("wall_cupboard", "wall"),
        Family("wall_lamp", "wall"),
        Family("wardrobe", "floor"),
        Family("washbasin", "floor"),
    )
}


def _family(name: str) -> Family:
    if name not in FAMILIES:
        near = difflib.get_close_matches(name, FAMILIES, n=3) or sorted(FAMILIES)
        raise FurnitureError(f"unknown furniture family {name!r}; did you mean {', '.join(near)}?")
    return FAMILIES[name]


@cache
def _parameters(family: Family) -> tuple[str, ...]:
    return tuple(inspect.signature(family.build).parameters)


def _only_known(family: Family, given: Mapping[str, Any], *, complete: bool) -> None:
    known = _parameters(family)
    unknown = [name for name in given if name not in known]
    missing = [name for name in known if complete and name not in given]
    if unknown or missing:
        wrong = f"has no parameter {unknown[0]!r}" if unknown else f"needs the parameter {missing[0]!r}"
        raise FurnitureError(f"{family.name} {wrong}; its parameters are {', '.join(known)}")


def sample_furniture(rng: np.random.Generator, family: str, **fixed: Any) -> Furniture:
    """A piece of the family with the fixed parameters as given and the others drawn.

    Raises FurnitureError for an unknown family or parameter, or a value out of its bounds.
    """
    entry = _family(family)
    _only_known(entry, fixed, complete=False)
    return entry.sample(rng, **fixed)


def build_furniture(family: str, parameters: Mapping[str, Any]) -> Furniture:
    """The piece of the family with these parameters, the same every time (a `Furniture.parameters`, say).

    Raises FurnitureError for an unknown family, an unknown or missing parameter, or a value out of its
    bounds.
    """
    entry = _family(family)
    _only_known(entry, parameters, complete=True)
    return entry.build(**parameters)
