"""Names of environment maps resolved: sets of those that ship, single ones by name, files and folders."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gibench.generators.daylight import BadEnvironment, read_panorama
from gibench.generators.environments.shipped import ShippedMap, shipped_maps
from gibench.rendering.panoramas import HEIGHT

SUFFIXES = (".exr", ".hdr")

SETS: dict[str, Callable[[ShippedMap], bool]] = {
    "indoor": lambda entry: entry.indoor,
    "outdoor": lambda entry: not entry.indoor,
    "train": lambda entry: entry.split == "train",
    "test": lambda entry: entry.split == "test",
    "indoor-test": lambda entry: entry.indoor and entry.split == "test",
}
"""Names of sets of the maps that ship. All that are to train on are indoor, all outdoor ones are to test on."""


class EnvironmentFile(NamedTuple):
    """An environment map on disk. indoor: None for a map that does not ship, of which nobody said so."""

    name: str
    path: Path
    indoor: bool | None


def environment_files(wanted: str | Path | Sequence[str | Path]) -> tuple[EnvironmentFile, ...]:
    """The maps that `wanted` names, in that order, each once.

    wanted: a set in `SETS`, the name of a map that ships, a file (.hdr, .exr), a folder, of which all such files are
    taken by name, or a list of these. Nothing is read but folders.

    Raises BadEnvironment for an unknown name, a folder without a map, two maps of one name, and an empty list.
    """
    asked = [wanted] if isinstance(wanted, str | Path) else list(wanted)
    found: dict[str, EnvironmentFile] = {}
    for one in asked:
        for entry in _named(one):
            if found.setdefault(entry.name, entry).path != entry.path:
                first = found[entry.name].path
                raise BadEnvironment(
                    f"environments: {first} and {entry.path} are both called '{entry.name}'; rename one"
                )
    if not found:
        raise BadEnvironment(f"environments: the list names none; name {_choices()}")
    return tuple(found.values())


def _named(wanted: str | Path) -> list[EnvironmentFile]:
    shipped = {entry.name: entry for entry in shipped_maps()}
    if (within := SETS.get(str(wanted))) is not None:
        chosen = [entry for entry in shipped.values() if within(entry)]
        return [EnvironmentFile(entry.name, entry.path, entry.indoor) for entry in chosen]
    if (entry := shipped.get(str(wanted))) is not None:
        return [EnvironmentFile(entry.name, entry.path, entry.indoor)]
    place = Path(wanted)
    if place.is_dir():
        files = sorted(f for f in place.iterdir() if f.suffix.lower() in SUFFIXES and f.is_file())
        if not files:
            raise BadEnvironment(f"environments: the folder {place} holds no .hdr or .exr file")
    elif place.is_file():
        files = [place]
    else:
        near = difflib.get_close_matches(str(wanted), [*SETS, *shipped], n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise BadEnvironment(f"environments: there is no '{wanted}'{hint or f'; name {_choices()}'}")
    return [EnvironmentFile(file.stem, file.resolve(), None) for file in files]


def _choices() -> str:
    return f"{', '.join(SETS)}, a map that ships, a file or a folder"


def read_environment(path: str | Path, height: int = HEIGHT) -> NDArray[np.float32]:
    """An environment map with `height` rows: (height, 2·height, 3) radiance as the file has it, linear Rec. 709.

    Raises BadEnvironment for a file that is no image, holds NaN, infinity or a negative value, is black, or is not
    twice as wide as high.
    """
    # It loads SciPy, which those who only name environments do not need.
    from gibench.rendering.latlong import resampled

    image = read_panorama(str(path))
    if not image.any():
        raise BadEnvironment(f"hdr {path}: it is black; give a panorama with light in it")
    return resampled(image, height)
