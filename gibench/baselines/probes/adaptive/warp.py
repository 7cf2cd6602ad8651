"""Reading the maps of adaptive probes inside of kernels: from plain texel coordinates to theirs, and back."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray


class _Grids:
    """A grid of points for each probe."""

    def __init__(self, points: NDArray[np.float32], size: tuple[int, int]) -> None:
        """points: (probes, rows + 1, columns + 1, 2). size: (width, height) of the coordinates that are looked up."""
        rows, columns = (n - 1 for n in points.shape[1:3])
        self._values = mi.Float(points.astype(np.float32).ravel())
        self._cells = mi.Vector2i(columns, rows)
        self._scale = mi.Vector2f(columns / size[0], rows / size[1])
        self.arrays = [self._values, self._cells, self._scale]
        dr.make_opaque(self.arrays)

    def around(self, probe: Any, at: Any) -> tuple[Any, Any, Any, Any, Any]:
        """The place in its cell that coordinates have, in [0, 1]², and the indices of the cell's four corners.

        Corners by row, then by column.
        """
        at = at * self._scale
        low = dr.clip(mi.Vector2i(dr.floor(at)), 0, self._cells - 1)
        stride = self._cells.x + 1
        first = (mi.Int32(probe) * (self._cells.y + 1) + low.y) * stride + low.x
        return at - mi.Vector2f(low), first, first + 1, first + stride, first + stride + 1

    def __getitem__(self, index: Any) -> Any:
        return dr.gather(mi.Point2f, self._values, mi.UInt32(index))


class Warp:
    """Directions of the texels of adaptive probes.

    Coordinates are in texels of maps of `size`: plain ones are those of the lat-long map, moved ones those of a
    probe's own. Both run over the same rectangle. arrays: what a `Replay` must hold.
    """

    def __init__(
        self, size: tuple[int, int], forward: NDArray[np.float32], inverse: NDArray[np.float32]
    ) -> None:
        """size: (width, height). forward, inverse: of all probes, each as `parameterize` returns them."""
        self._forward, self._inverse = _Grids(forward, size), _Grids(inverse, size)
        self.arrays = [self._forward.arrays, self._inverse.arrays]

    def moved(self, probe: Any, plain: Any) -> Any:
        """mi.Point2f moved coordinates of plain ones, linear on the two triangles of a cell (`inversion.TRIANGLES`)."""
        share, a, b, c, d = self._forward.around(probe, plain)
        upper = share.x + share.y <= 1
        corner = self._forward[dr.select(upper, a, d)]
        along_b = dr.select(upper, share.x, 1 - share.y)
        along_c = dr.select(upper, share.y, 1 - share.x)
        return corner + along_b * (self._forward[b] - corner) + along_c * (self._forward[c] - corner)

    def plain(self, probe: Any, moved: Any) -> Any:
        """mi.Point2f plain coordinates of moved ones, bilinear between the corners of texels."""
        share, *corners = self._inverse.around(probe, moved)
        a, b, c, d = (self._inverse[corner] for corner in corners)
        return dr.lerp(dr.lerp(a, b, share.x), dr.lerp(c, d, share.x), share.y)

    def stretch(self, probe: Any, moved: Any) -> Any:
        """mi.Float, side of a square as large as a texel is in plain texels, √|det| of the Jacobian of `plain`."""
        share, *corners = self._inverse.around(probe, moved)
        a, b, c, d = (self._inverse[corner] for corner in corners)
        x, y = dr.lerp(b - a, d - c, share.y), dr.lerp(c - a, d - b, share.x)
        return dr.sqrt(dr.abs(x.x * y.y - x.y * y.x))
