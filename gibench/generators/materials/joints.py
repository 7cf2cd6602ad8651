"""Joints between tiles, bricks and boards, drawn as the share of each texel that they cover."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def joint_cover(
    position: NDArray[np.floating], length: float, width: float, texel: float
) -> NDArray[np.floating]:
    """Share of a texel that lies in a joint, in [0, 1].

    position: where in its unit the texel's centre lies, in [0, 1). length: of the unit with its joint, m.
    width: of the joint, m, half of it at either end. texel: size of a texel, m. Joints thinner than a texel
    come out fainter, not wider, wherever they fall between two texels.
    """
    distance = np.minimum(position, 1 - position) * length
    overlap = np.minimum(width / 2, distance + texel / 2) - np.maximum(-width / 2, distance - texel / 2)
    return np.clip(overlap / texel, 0, 1)
