"""The probes of a scene on the device: where they are, and lookups that work inside of kernels."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from gibench.baselines.method import Site
from gibench.baselines.probes.baking import MAPS, POSITIONS, ProbeSettings, baked_files, load_warp
from gibench.baselines.probes.errors import ProbeError
from gibench.baselines.probes.mappings import MAPPINGS

LARGEST_INDEX = 2**32
"""Entries that a map may have on the device."""


def _on_device(path: Path) -> Any:
    """A baked array, flat, as it is stored: half, single precision, or whole numbers."""
    try:
        array = np.load(path, mmap_mode="r")
    except (OSError, ValueError) as problem:
        raise ProbeError(f"{path} cannot be read ({problem}): remove the folder {path.parent}") from problem
    if array.size >= LARGEST_INDEX:
        raise ProbeError(
            f"{path.stem} has {array.size} values, more than the device can index: fewer or smaller probes"
        )
    if array.dtype == np.uint16:
        return mi.UInt32(array.ravel().astype(np.uint32))
    return (dr.float16_array_t(mi.Float) if array.dtype == np.float16 else mi.Float)(array.ravel())


class Probes:
    """Probes and some of their maps.

    count: number of probes. mapping: where directions lie on a map, before its texels are moved. arrays: what a
    `Replay` must hold.

    Texel coordinates are mi.Point2f, (0, 0) the outer corner of the first texel, x along the columns. Probes are
    counted from 0. Texels are counted by row over all maps of a probe, so that `texel` and `corners` give what `fetch`
    takes.
    """

    def __init__(self, settings: ProbeSettings, files: dict[str, Path]) -> None:
        """files: from `baking.baked_files`."""
        self.mapping = MAPPINGS[settings.mapping](settings.width, settings.height)
        self.arrays = {name: _on_device(path) for name, path in files.items() if name in (POSITIONS, *MAPS)}
        self.count = len(np.load(files[POSITIONS], mmap_mode="r"))
        self._texels = mi.UInt32(settings.width * settings.height)
        self._number = mi.UInt32(self.count)
        self.arrays |= {"texels": self._texels, "number": self._number}
        self._warp = load_warp(settings, files)
        if self._warp is not None:
            self.arrays["warp"] = self._warp.arrays
        dr.make_opaque(self.arrays)

    def position(self, probe: Any) -> Any:
        """mi.Point3f where probes (mi.UInt32) are, metres."""
        return dr.gather(mi.Point3f, self.arrays[POSITIONS], probe)

    @dr.syntax
    def nearest(self, point: Any, count: int) -> list[Any]:
        """The `count` probes next to points (mi.Point3f), as that many mi.UInt32, the nearest first.

        count: at most the number of probes. Every probe is looked at: some hundreds cost less than a grid's
        bookkeeping, and what is found is exact where probes of the grid were dropped.
        """
        distances = [mi.Float(dr.inf) for _ in range(count)]
        found = [mi.UInt32(0) for _ in range(count)]
        probe = mi.UInt32(0)
        while probe < self._number:
            distance = dr.squared_norm(self.position(probe) - point)
            candidate = mi.UInt32(probe)
            for k in range(count):
                closer = distance < distances[k]
                distance, distances[k] = (
                    dr.select(closer, distances[k], distance),
                    dr.select(closer, distance, distances[k]),
                )
                candidate, found[k] = (
                    dr.select(closer, found[k], candidate),
                    dr.select(closer, candidate, found[k]),
                )
            probe += 1
        return found

    def coordinates(self, probe: Any, direction: Any) -> Any:
        """Texel coordinates of a direction (mi.Vector3f, of any length) from a probe, in [0, width] × [0, height]."""
        at = self.mapping.coordinates(direction)
        return at if self._warp is None else self._warp.moved(probe, at)

    def direction(self, probe: Any, at: Any) -> Any:
        """Unit mi.Vector3f that texel coordinates of a probe stand for; those of texel centres were baked."""
        at = self.mapping.clamped(at)
        return self.mapping.direction(at if self._warp is None else self._warp.plain(probe, at))

    def stretch(self, probe: Any, at: Any) -> Any:
        """Width of a texel at texel coordinates, mi.Float, where 1 is what it is without moved texels.

        |∂f⁻¹/∂x| in section 5.2 of Rodriguez et al. 2020, as the square root of the Jacobian's determinant.
        """
        return mi.Float(1) if self._warp is None else self._warp.stretch(probe, self.mapping.clamped(at))

    def texel(self, probe: Any, direction: Any) -> Any:
        """The texel (mi.UInt32) that a direction (mi.Vector3f, of any length) from a probe falls into."""
        return self.texel_at(probe, self.coordinates(probe, direction))

    def texel_at(self, probe: Any, at: Any) -> Any:
        """The texel (mi.UInt32) that texel coordinates fall into; beside the map, the one that they wrap to."""
        at = self.mapping.clamped(at)
        column = dr.minimum(mi.Int32(at.x), self.mapping.width - 1)
        row = dr.minimum(mi.Int32(at.y), self.mapping.height - 1)
        return self._index(probe, column, row)

    def corners(self, probe: Any, direction: Any) -> list[tuple[Any, Any]]:
        """The four texels around a direction from a probe, each with its bilinear weight, which sum to 1."""
        return self.corners_at(probe, self.coordinates(probe, direction))

    def corners_at(self, probe: Any, at: Any) -> list[tuple[Any, Any]]:
        """The four texels around texel coordinates, each with its bilinear weight, which sum to 1."""
        at = self.mapping.clamped(at) - 0.5
        low = dr.floor(at)
        share = at - low
        column, row = mi.Int32(low.x), mi.Int32(low.y)
        return [
            (
                self._index(probe, *self._wrapped(column + i, row + j)),
                (share.x if i else 1 - share.x) * (share.y if j else 1 - share.y),
            )
            for j in (0, 1)
            for i in (0, 1)
        ]

    def fetch(self, name: str, texel: Any, active: Any = True) -> Any:
        """Values of a map at texels: mi.Float, mi.UInt32 (ids) or mi.Vector3f (three components); 0 where inactive."""
        array, size = self.arrays[name], MAPS[name][1]
        kind: Callable[..., Any] = mi.UInt32 if name.endswith("_id") else mi.Float
        parts = [kind(dr.gather(type(array), array, texel * size + k, active)) for k in range(size)]
        return parts[0] if size == 1 else mi.Vector3f(*parts)

    def bilinear(self, name: str, probe: Any, direction: Any, active: Any = True) -> Any:
        """A map along directions from probes, mixed from the four texels around each."""
        return sum(
            weight * self.fetch(name, texel, active) for texel, weight in self.corners(probe, direction)
        )

    def _wrapped(self, column: Any, row: Any) -> tuple[Any, Any]:
        # Where texels are moved, what lies over a pole is not half way around: the row next to it is repeated.
        if self._warp is not None:
            row = dr.clip(row, 0, dr.opaque(mi.Int32, self.mapping.height - 1))
        return self.mapping.wrapped(column, row)

    def _index(self, probe: Any, column: Any, row: Any) -> Any:
        return probe * self._texels + mi.UInt32(row * dr.opaque(mi.Int32, self.mapping.width) + column)


def load_probes(site: Site, settings: ProbeSettings, maps: tuple[str, ...]) -> Probes:
    """The probes of a site with some of their maps (names in `baking.MAPS`), baked where they are not there yet.

    Raises ProbeError, DenoiserError.
    """
    return Probes(settings, baked_files(site, settings, maps))
