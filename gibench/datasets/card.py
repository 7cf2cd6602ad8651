"""The card of a dataset, `DATASET.md`: what it holds, how it was made, and what its light and things are like.

Statistics are over at most `SAMPLED` frames, spread evenly over the dataset, and over the rooms of these, so that a
card takes seconds however large the dataset is. Nothing in it depends on the time or on the machine.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gibench import gate
from gibench.datasets.checked import parsed, shown
from gibench.datasets.exr import decode, present_channels
from gibench.datasets.folder import room_folder
from gibench.datasets.manifest import room_record
from gibench.datasets.records import Contents
from gibench.rendering.channels import CHANNELS, PARTS

if TYPE_CHECKING:
    import pandas as pd

SAMPLED = 32
"""Frames that are read."""

FAMILIES = 8
"""Families of materials that are named, those that cover most."""

NEAR_MIRROR = 0.1
"""GGX alpha below which a surface counts as one."""

READ = (*PARTS, "depth", "roughness", "specular_albedo", "material_id")


def card(root: Path, manifest: Mapping[str, Any], table: pd.DataFrame) -> str:
    """The text of the card of a dataset with at least one frame, Markdown. Raises DatasetError, StorageError.

    table: a row a frame, as `manifest.frame_table` makes it. A room.json that cannot be read adds nothing.
    """
    recipe, versions = manifest["recipe"], manifest["versions"]
    width, height = recipe["resolution"]
    samples = (
        f"{recipe['spp']} samples a pixel"
        if recipe["error"] is None
        else f"samples until the median relative error is below {recipe['error']:g}"
    )
    if manifest["identity"].get("sampling") == "guided":
        samples += " along guided paths"
    kinds = table.drop_duplicates("room")["kind"].value_counts()
    splits = table["split"].value_counts()
    denoised = "denoised, each radiance part on its own" if recipe["denoise"] else "not denoised"
    return f"""# {_some(len(table), "frame")} of {_some(table["room"].nunique(), "room")}, by gibench

| | |
| --- | --- |
| frames | {len(table)} of {width} × {height} pixels, {_counted(splits)} |
| rooms | {_counted(kinds)} |
| light | {_lighting(recipe, table)} |
| samples | {samples}, {denoised}, at most {recipe["max_depth"]} scattering events |
| made with | gibench {versions["gibench"]}, Mitsuba {versions["mitsuba"]}, {manifest["variant"]} |
| command | `{manifest["command"]}` |
| licence | {manifest["licence"]} |

Splits go by room. `dataset.json` has the whole recipe, `frames.parquet` a row a frame, `rooms/*/room.json` what is in
a room, `rooms/*/scene.xml` the room for stock Mitsuba. The same command, seed and versions make the same pixels.

## What it is like

{_statistics(root, table)}

## Channels

Radiance is linear Rec. 709 in W·m⁻²·sr⁻¹, `color` the sum of its five parts. World space is right-handed, Z up, in
metres.

{channel_table(recipe["channels"])}

## How to load it

```python
from gibench.datasets import open_dataset

dataset = open_dataset("DIR")
frame = dataset[0]
frame["color"]  # (H, W, 3) float32
frame.shot  # its camera and its light
dataset.torch(["color", "albedo"])  # for a DataLoader; `gibench dataset cache DIR` makes it fast
```
"""


def channel_table(names: Iterable[str]) -> str:
    """A row a channel: name, components, unit and meaning."""
    rows = [
        f"| `{name}` | {CHANNELS[name].components} | {CHANNELS[name].unit} | {CHANNELS[name].meaning} |"
        for name in names
    ]
    return "\n".join(["| channel | components | unit | meaning |", "| --- | --- | --- | --- |", *rows])


def _counted(counts: pd.Series) -> str:
    return ", ".join(f"{name} {count}" for name, count in sorted(counts.items()))


def _lighting(recipe: Mapping[str, Any], table: pd.DataFrame) -> str:
    if recipe.get("lighting", "own") == "area-light":
        return (
            "a rectangle in the room, another one for every still; the room's own lamps and windows are dark"
        )
    if recipe.get("lighting", "own") == "environments":
        maps = table["environment"].nunique()
        return f"{maps} environment maps, turned about Z; the room's own lamps and windows are dark"
    return "the room's own lamps and daylight"


def _statistics(root: Path, table: pd.DataFrame) -> str:
    chosen = np.unique(np.linspace(0, len(table) - 1, min(SAMPLED, len(table))).round().astype(int))
    rows = table.iloc[chosen]
    rooms = {int(room): _described(root, int(room)) for room in rows["room"].unique()}
    seen = _Seen()
    for row in rows.to_dict("records"):
        path = gate.inside(root, row["file"])
        room = int(row["room"])
        names = room_record(root, room)["materials"]
        seen.add(_present(path), names, rooms[room].get("materials", {}))
    lamps = _lamps(rooms.values()) if "lighting" not in table else []  # else these are dark
    lines = [*_brightness(rows), *lamps, *seen.light(), *seen.lines()]
    head = (
        f"Over {_some(len(rows), 'frame')}, spread evenly, of {_some(len(rooms), 'room')}: the median, and from the "
        "5th to the 95th percentile; shares are of pixels."
    )
    return "\n".join([head, "", "| | |", "| --- | --- |", *(f"| {name} | {what} |" for name, what in lines)])


def _described(root: Path, room: int) -> dict[str, Any]:
    path = (room_folder(root, room) / "room.json").relative_to(root)
    with suppress(gate.GateError, ValueError):
        return parsed(gate.read_inside(root, path), Contents)
    return {}


def _present(path: Path) -> dict[str, NDArray[Any]]:
    return decode(path, [name for name in READ if name in present_channels(path)], widen=True)


def _brightness(rows: pd.DataFrame) -> list[tuple[str, str]]:
    exposures = rows["exposure"].to_numpy(dtype=float)
    exposures = exposures[np.isfinite(exposures) & (exposures > 0)]
    return [("radiance shown as white", f"{_range(1 / exposures)} W·m⁻²·sr⁻¹")] if len(exposures) else []


def _lamps(rooms: Collection[Mapping[str, Any]]) -> list[tuple[str, str]]:
    lines = []
    counts, lumens, kelvins = [], [], []
    for room in rooms:
        # A shade glows, and so do its open ends: the lights of one lamp are named after it.
        lamps: dict[str, float] = {}
        for number, light in enumerate(room.get("lights", ())):
            lamp = light.get("name", "").rpartition(".")[0] or str(number)
            lamps[lamp] = lamps.get(lamp, 0.0) + (light.get("lumens") or 0.0)
            if light.get("kelvin") is not None:
                kelvins.append(light["kelvin"])
        counts.append(len(lamps))
        lumens += [flux for flux in lamps.values() if flux]
    if any(counts):
        lines.append(("lamps of a room", _range(counts)))
    if lumens:
        lines.append(("of a lamp", f"{_range(lumens)} lm" + (f", {_range(kelvins)} K" if kelvins else "")))
    outside = Counter(room["environment"]["kind"] for room in rooms if room.get("environment"))
    if outside:
        lines.append(("outside the windows", ", ".join(f"{kind} {n}" for kind, n in sorted(outside.items()))))
    return lines


class _Seen:
    """What is gathered frame by frame."""

    def __init__(self) -> None:
        self.indirect: list[float] = []
        self.specular: list[float] = []
        self.depths: list[NDArray[Any]] = []
        self.alphas: list[NDArray[Any]] = []
        self.pixels = self.hits = 0
        self.families: Counter[str] = Counter()

    def add(
        self, channels: Mapping[str, NDArray[Any]], names: Sequence[str], materials: Mapping[str, Any]
    ) -> None:
        """channels: (H, W, C) of a frame. names: of its materials by id. materials: what room.json says of them."""
        if all(name in channels for name in PARTS):
            sums = {name: float(channels[name].sum(dtype=np.float64)) for name in PARTS[1:]}
            if (total := sum(sums.values())) > 0:
                self.indirect.append((sums["indirect_diffuse"] + sums["indirect_specular"]) / total)
                self.specular.append((sums["direct_specular"] + sums["indirect_specular"]) / total)
        if "depth" in channels:
            depth = channels["depth"].ravel()
            self.depths.append(depth[depth > 0][::7])
        if "roughness" in channels and "specular_albedo" in channels:
            has_lobe = channels["specular_albedo"].max(axis=-1).ravel() > 0
            self.alphas.append(channels["roughness"].ravel()[has_lobe])
            self.pixels += len(has_lobe)
        if "material_id" in channels:
            ids, counts = np.unique(channels["material_id"], return_counts=True)
            for id, count in zip(ids.tolist(), counts.tolist(), strict=True):
                if 0 < id <= len(names):
                    self.hits += count
                    known = materials.get(names[id - 1])
                    self.families["of the scene" if known is None else known["family"]] += count

    def light(self) -> list[tuple[str, str]]:
        """Lines about light."""
        shares = {"indirect": self.indirect, "specular": self.specular}
        return [
            (f"{name} of all reflected light", f"{_range(share, 100)} %")
            for name, share in shares.items()
            if share
        ]

    def lines(self) -> list[tuple[str, str]]:
        """Lines about things."""
        lines = []
        if self.hits:
            most = self.families.most_common(FAMILIES)
            told = ", ".join(f"{shown(name)[1:-1]} {100 * count / self.hits:.0f} %" for name, count in most)
            lines.append(("materials", told))
        if self.depths and len(depths := np.concatenate(self.depths)):
            lines.append(("depth", f"{_range(depths)} m"))
        if self.pixels:
            alphas = np.concatenate(self.alphas)
            glossy = f"{100 * len(alphas) / self.pixels:.0f} % with a specular lobe"
            if len(alphas):
                mirrors = 100 * np.count_nonzero(alphas < NEAR_MIRROR) / self.pixels
                glossy += f", of GGX alpha {_range(alphas)}; {mirrors:.0f} % of alpha below {NEAR_MIRROR}"
            lines.append(("gloss", glossy))
        return lines


def _range(values: Sequence[float] | NDArray[Any], scale: float = 1.0) -> str:
    """The median, and from the 5th to the 95th percentile."""
    low, middle, high = np.percentile(np.asarray(values, dtype=float), (5, 50, 95)) * scale
    return f"{_number(middle)} ({_number(low)} to {_number(high)})"


def _number(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def _some(count: int, what: str) -> str:
    return f"{count} {what}" + ("" if count == 1 else "s")
