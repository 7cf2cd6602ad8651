"""Looking-glass: a smooth conductor of even, slightly green reflectance."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.materials.errors import BadMaterial
from gibench.generators.materials.roles import Role, draw
from gibench.generators.materials.surface import build_with, name_of
from gibench.generators.parts import Material


def mirror(*, reflectance: float) -> Material:
    """A perfect mirror. reflectance: in [0.5, 0.89]; silvered glass has at least 0.85."""
    if not 0.5 <= reflectance <= 0.89:
        raise BadMaterial(f"mirror: reflectance is {reflectance}; a looking-glass has 0.5 to 0.89")
    parameters = dict(locals())
    color = (reflectance * 0.99, reflectance, reflectance * 0.99)
    return Material(name_of("mirror", parameters), "mirror", "conductor", color, parameters=parameters)


def sample_mirror(rng: np.random.Generator, role: Role, **fixed: Any) -> Material:
    """A good looking-glass."""
    return build_with(mirror, {"reflectance": draw(rng, 0.85, 0.89)}, fixed)
