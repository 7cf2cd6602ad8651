"""The environment maps that ship with gibench: 37 of Poly Haven's (CC0), 256 × 128, apart for training and testing."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path


@dataclass(frozen=True)
class ShippedMap:
    """A row of `maps.csv`.

    indoor: whether it shows a room, a hall or a cave. split: "train" or "test"; nothing that is scored is lit by a map
    to train on. source: web address of the original.
    """

    name: str
    path: Path
    indoor: bool
    split: str
    source: str


@cache
def shipped_maps() -> tuple[ShippedMap, ...]:
    """All of them: 23 indoor, of which 15 are to train on, and 14 outdoor, which are all to test on."""
    folder = Path(str(resources.files(__package__)))
    with open(folder / "maps.csv", newline="", encoding="utf-8") as file:
        return tuple(
            ShippedMap(
                row["name"],
                folder / "maps" / f"{row['name']}.hdr",
                row["place"] == "indoor",
                row["split"],
                row["source"],
            )
            for row in csv.DictReader(file)
        )
