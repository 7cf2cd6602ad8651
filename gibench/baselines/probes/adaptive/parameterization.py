"""From what a probe sees to where its texels look (Rodriguez et al. 2020, section 4.2)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gibench.baselines.probes.adaptive.inversion import inverse_map, lattice
from gibench.baselines.probes.adaptive.quasi_harmonic import forward_map
from gibench.baselines.probes.adaptive.resolution import resolution_map

GUIDES = (256, 128)
"""Width and height of the maps that decide, section 4.2.1."""

GUIDE_MAPS = ("distance", "normal", "roughness")
"""Maps that they are made of; names in `baking.MAPS`."""

CELLS = (128, 64)
"""Columns and rows of the mesh that is moved. The paper has a quad a texel of the guides; what they say is blurred over
five of them, and on half of them the map is found in a fifth of the time."""


def parameterize(
    guides: Mapping[str, NDArray[np.floating]], facing: NDArray[np.floating], size: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The forward and the inverse map of one probe, both in texels of a map of `size` (width, height).

    guides: GUIDE_MAPS → (H, W, components), lat-long. facing: (H, W), cosine between rays and normals. Returns
    (CELLS[1] + 1, CELLS[0] + 1, 2), where the corners of the mesh are on the probe's map, and (height + 1, width + 1,
    2), where the corners of its texels are on a lat-long map. Raises ProbeError.
    """
    distance = guides["distance"][..., 0]
    smoothness = np.where(distance > 0, 1 - np.clip(guides["roughness"][..., 0], 0, 1), 0)
    wanted = resolution_map(smoothness, distance, guides["normal"], facing)
    columns, rows = CELLS
    height, width = wanted.shape
    wanted = wanted.reshape(rows, height // rows, columns, width // columns).mean(axis=(1, 3))
    forward = forward_map(wanted)
    inverse = inverse_map(forward, lattice(size, CELLS))
    to_texels = np.array(size) / CELLS
    return (forward * to_texels).astype(np.float32), (inverse * to_texels).astype(np.float32)
