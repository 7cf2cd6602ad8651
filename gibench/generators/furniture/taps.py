"""Water taps for kitchens and bathrooms."""

from __future__ import annotations

from gibench.generators.parts import Mesh
from gibench.generators.shapes import bend, box, cylinder, merge, rod, translate, tube


def tap(height: float, reach: float, *, at: tuple[float, float, float], gooseneck: bool) -> Mesh:
    """A mixer tap that stands on `at` and reaches towards +y.

    height: of its highest point above its foot, reach: from its foot to its spout (m). gooseneck: a high
    bow as over kitchen sinks, otherwise a straight spout.
    """
    radius = 0.011 if gooseneck else 0.012
    meshes = [
        cylinder(0.026, -0.002, 0.012, bevel=0.003),
        cylinder(0.019, 0.01, 0.09 if gooseneck else height - 0.02, bevel=0.003),
    ]
    top = height - radius
    if gooseneck:
        path = [[0, 0, 0.085], [0, 0, top], [0, reach, top], [0, reach, 0.6 * height]]
        meshes.append(tube(bend(path, 0.49 * reach, segments=8), radius, sides=12))
        meshes.append(rod([0.012, 0, 0.06], [0.085, 0, 0.085], 0.006, sides=10))
    else:
        low = 0.62 * height
        meshes.append(tube([[0, 0.005, low - 0.012], [0, reach, low]], radius, sides=12, caps="round"))
        meshes.append(cylinder(0.009, low - 0.028, low, segments=12, centre=(0, reach - 0.004)))
        meshes.append(box(-0.008, 0.008, -0.022, 0.07, height - 0.022, height, bevel=0.003))
    return translate(merge(meshes), at)
