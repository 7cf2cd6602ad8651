"""A mirror image and its guides, averaged over ever larger cells."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

LEVELS = 8
"""Cells of 1, 2, 4 … 128 rays across; the widest window is a few hundred across."""


@dataclass
class MirrorImage:
    """Inputs of a gather: arrays with a lane a ray, in row order, or a lane a cell.

    radiance: mi.Color3f, along the mirror direction, not yet times a reflectance. blur: mi.Float, d_r / (d_c + d_r),
    in [0, 1]. position: mi.Point3f (m). normal: mi.Normal3f, towards the viewer. roughness: mi.Float, GGX alpha.
    coverage: mi.Float, share of the cell that has a specular lobe. All but the last are means over that share.
    """

    radiance: Any
    blur: Any
    position: Any
    normal: Any
    roughness: Any
    coverage: Any


_PARTS = ("radiance", "blur", "position", "normal", "roughness")


class Layout:
    """Offsets of the levels when they stand one after the other.

    sizes: (width, height) by level, each half the one before, rounded up. arrays: the same on the device, evaluated:
    start of each level, width, height.
    """

    def __init__(self, width: int, height: int, arrays: Any = None) -> None:
        """width, height: of the finest level. arrays: of an equal layout, where they exist already."""
        self.sizes = [(width, height)]
        while len(self.sizes) < LEVELS:
            self.sizes.append(((self.sizes[-1][0] + 1) // 2, (self.sizes[-1][1] + 1) // 2))
        if arrays is None:
            starts = [0, *itertools.accumulate(columns * rows for columns, rows in self.sizes[:-1])]
            arrays = (
                mi.UInt32(starts),
                mi.Int32([columns for columns, _ in self.sizes]),
                mi.Int32([rows for _, rows in self.sizes]),
            )
            dr.make_opaque(arrays)
        self.arrays = arrays


class Pyramid:
    """All levels one after the other in one array each.

    layout: of the finest and all other levels. image: all of them, evaluated.
    """

    def __init__(self, finest: MirrorImage, layout: Layout) -> None:
        """finest: evaluated. Runs LEVELS − 1 small kernels."""
        levels = [finest]
        for size in layout.sizes[:-1]:
            levels.append(_halved(levels[-1], size))
        self.layout = layout
        self.image = MirrorImage(
            *(_joined([getattr(level, name) for level in levels]) for name in (*_PARTS, "coverage"))
        )
        dr.eval(self.image)

    def cells(self, level, at):
        """The four cells of a level (mi.UInt32) that lie around a point, for bilinear reading.

        at: mi.Point2f, in rays. Returns four pairs of index and weight; the weight is 0 beyond the image.
        """
        starts, widths, heights = self.layout.arrays
        start = dr.gather(mi.UInt32, starts, level)
        columns, rows = dr.gather(mi.Int32, widths, level), dr.gather(mi.Int32, heights, level)
        place = at * dr.exp2(-mi.Float(level)) - 0.5
        low = dr.floor(place)
        share = place - low
        found = []
        for dy in range(2):
            for dx in range(2):
                x, y = mi.Int32(low.x) + dx, mi.Int32(low.y) + dy
                inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
                weight = (share.x if dx else 1 - share.x) * (share.y if dy else 1 - share.y)
                index = dr.select(inside, mi.UInt32(y * columns + x), 0)
                found.append((start + index, dr.select(inside, weight, 0)))
        return found


def _joined(arrays: list[Any]) -> Any:
    """Arrays one after the other; dr.concat knows flat ones only."""
    if isinstance(arrays[0], mi.Float):
        return dr.concat(arrays)
    return type(arrays[0])(*(dr.concat(list(part)) for part in zip(*arrays, strict=True)))


def _halved(image: MirrorImage, size: tuple[int, int]) -> MirrorImage:
    """Means over 2 × 2 cells, weighted by coverage; what lies beyond the image has none."""
    width, height = size
    columns, rows = (width + 1) // 2, (height + 1) // 2
    lane = dr.arange(mi.UInt32, columns * rows)
    row = lane // dr.opaque(mi.UInt32, columns)
    column = lane - row * dr.opaque(mi.UInt32, columns)
    coverage = mi.Float(0)
    sums: dict[str, Any] = dict.fromkeys(_PARTS, 0)
    for dy in range(2):
        for dx in range(2):
            x, y = 2 * column + dx, 2 * row + dy
            inside = (x < dr.opaque(mi.UInt32, width)) & (y < dr.opaque(mi.UInt32, height))
            index = y * dr.opaque(mi.UInt32, width) + x
            weight = dr.gather(mi.Float, image.coverage, index, inside)
            coverage += weight
            for name in _PARTS:
                values = getattr(image, name)
                sums[name] = sums[name] + weight * dr.gather(type(values), values, index, inside)
    inverse = dr.select(coverage > 0, dr.rcp(dr.maximum(coverage, 1e-20)), 0)
    means = {name: value * inverse for name, value in sums.items()}
    result = MirrorImage(**means, coverage=0.25 * coverage)
    dr.eval(result)
    return result
