"""Places in a room: cells of a grid, and in each of them six for what its surfaces face."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

FACES = 6
"""A surface belongs to the axis and the sign of the largest component of its normal."""

CELLS = 6000
"""Of a grid, about: those of a furnished room are 0.3 m wide."""


def facing(si):
    """Geometric normal on the side that si.wi sees, unit."""
    return dr.mulsign(si.n, dr.dot(si.n, si.to_world(si.wi)))


class Grid:
    """Cubes over a box. arrays: those of the device."""

    def __init__(self, low: NDArray[Any], high: NDArray[Any], cells: int = CELLS) -> None:
        """low, high: (3,) corners of the box, m."""
        extent = np.maximum(high - low, 1e-3 * np.max(high - low))
        side = float((np.prod(extent) / cells) ** (1 / 3))
        self.shape = tuple(int(n) for n in np.maximum(np.ceil(extent / side), 1))
        """(3,) cells along x, y and z."""
        self._low = mi.Point3f(*(float(x) for x in low))
        self._inverse = mi.Float(1 / side)
        self._size = mi.Vector3u(*self.shape)
        self.arrays = [self._low, self._inverse, self._size]
        dr.make_opaque(self.arrays)

    @property
    def places(self) -> int:
        """Faces of all cells, and last those of all that lies outside."""
        return (int(np.prod(self.shape)) + 1) * FACES

    def place_or_outside(self, position, normal, shift):
        """As `place`, with numbers of their own for what lies outside: the ground before the windows, a facade."""
        place, inside = self.place(position, normal, shift)
        # Counted, not known: kernels do not depend on the size of a room.
        cells = self._size.x * self._size.y * self._size.z
        return dr.select(inside, place, cells * FACES + place % FACES)

    def place(self, position, normal, shift):
        """Number of the place of a surface point (mi.UInt32), and whether it lies in the grid.

        normal: unit, towards the viewer. shift: mi.Vector3f in [−0.5, 0.5)³, in cells, by which the point is moved
        along the surface before it is looked up. A random one blurs the edges of cells.
        """
        size = mi.Vector3f(self._size)
        length = dr.abs(normal)
        along_x = (length.x >= length.y) & (length.x >= length.z)
        along_y = (along_x ^ True) & (length.y >= length.z)
        along_z = (along_x | along_y) ^ True
        axis = dr.select(along_x, mi.UInt32(0), dr.select(along_y, mi.UInt32(1), mi.UInt32(2)))
        component = dr.select(along_x, normal.x, dr.select(along_y, normal.y, normal.z))
        face = 2 * axis + dr.select(component < 0, mi.UInt32(1), mi.UInt32(0))
        moved = mi.Vector3f(
            dr.select(along_x, 0, shift.x), dr.select(along_y, 0, shift.y), dr.select(along_z, 0, shift.z)
        )
        at = (position - self._low) * self._inverse + moved
        inside = dr.all((at >= 0) & (at < size))
        cell = mi.Vector3u(dr.clip(at, 0, size - 1))
        return ((cell.z * self._size.y + cell.y) * self._size.x + cell.x) * FACES + face, inside
