"""From parameters and pixels to a `Material`: the checks and the naming that all families share."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gibench.generators.materials.color import fit_range
from gibench.generators.materials.errors import BadMaterial
from gibench.generators.parts import Material, Texture


def name_of(family: str, parameters: Mapping[str, Any]) -> str:
    """The family and eight hexadecimal digits of its parameters: equal names mean equal materials."""
    text = json.dumps(parameters, sort_keys=True)
    return f"{family}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


def dielectric(
    family: str,
    parameters: Mapping[str, Any],
    reflectance: ArrayLike | NDArray[np.uint8],
    *,
    alpha: float,
    size: tuple[float, float] | None = None,
    ior: float = 1.5,
) -> Material:
    """A matt surface (alpha 0: `diffuse`) or a coated one (`roughplastic`).

    reflectance: (3,) linear colour, or (H, W, 3) sRGB bytes that cover `size` metres. Raises BadMaterial.
    """
    if not (alpha == 0 or 1e-3 <= alpha <= 1):
        raise BadMaterial(
            f"{family}: alpha is {alpha}; give 0 for a matt surface, or a GGX roughness in [0.001, 1]"
        )
    if size is None:
        color = fit_range(np.asarray(reflectance, np.float64))
        value: tuple[float, float, float] | Texture = (float(color[0]), float(color[1]), float(color[2]))
    else:
        value = Texture(np.asarray(reflectance, np.uint8), size)
    bsdf = "diffuse" if alpha == 0 else "roughplastic"
    return Material(name_of(family, parameters), family, bsdf, value, alpha, ior, parameters=dict(parameters))


def check_luminance(family: str, luminance: float) -> None:
    """Raise BadMaterial unless the mean reflectance is one that a surface can have."""
    if not 0.02 <= luminance <= 0.9:
        raise BadMaterial(f"{family}: luminance is {luminance}; a mean reflectance lies in [0.02, 0.9]")


def build_with(
    build: Callable[..., Material], drawn: Mapping[str, Any], fixed: Mapping[str, Any]
) -> Material:
    """Call a family's builder with what was drawn, where the caller's fixed values win.

    Everything is drawn before it is overridden, so that fixing one parameter leaves the others as they were.
    Raises BadMaterial for a fixed parameter that the family does not have.
    """
    unknown = sorted(set(fixed) - set(drawn))
    if unknown:
        raise BadMaterial(
            f"{build.__name__} has no parameter {unknown[0]!r}; it has {', '.join(sorted(drawn))}"
        )
    return build(**{**drawn, **fixed})
