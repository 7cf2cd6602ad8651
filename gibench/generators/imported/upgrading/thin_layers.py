"""Cloth and scattering layers of Mitsuba 0.x, which have no counterpart, as surfaces of the same mean colour."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gibench.generators.imported.changes import Note
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.tree import Node, new
from gibench.generators.imported.upgrading.rules import become, constant_color, number, plugins, rgb, setting

Color = tuple[float, float, float]

MEASURED: dict[str, tuple[Color, Color]] = {
    "apple": ((2.29, 2.39, 1.97), (0.0030, 0.0034, 0.046)),
    "chicken1": ((0.15, 0.21, 0.38), (0.015, 0.077, 0.19)),
    "chicken2": ((0.19, 0.25, 0.32), (0.018, 0.088, 0.20)),
    "cream": ((7.38, 5.47, 3.15), (0.0002, 0.0028, 0.0163)),
    "ketchup": ((0.18, 0.07, 0.03), (0.061, 0.97, 1.45)),
    "marble": ((2.19, 2.62, 3.00), (0.0021, 0.0041, 0.0071)),
    "potato": ((0.68, 0.70, 0.55), (0.0024, 0.0090, 0.12)),
    "skimmilk": ((0.70, 1.22, 1.90), (0.0014, 0.0025, 0.0142)),
    "skin1": ((0.74, 0.88, 1.01), (0.032, 0.17, 0.48)),
    "skin2": ((1.09, 1.59, 1.79), (0.013, 0.070, 0.145)),
    "spectralon": ((11.6, 20.4, 14.9), (0.0, 0.0, 0.0)),
    "wholemilk": ((2.55, 3.21, 3.77), (0.0011, 0.0024, 0.014)),
}
"""Reduced scattering and absorption of materials by name, 1/mm (Jensen et al. 2001, figure 5)."""


def scattering_layers(root: Node, note: Note) -> None:
    """`hk` becomes `principledthin` of the light that its layer scatters back and through, behind a mask for the rest.

    Raises SceneFileError for a material that is not MEASURED and negative numbers.
    """
    for node in plugins(root, "bsdf", "hk"):
        scattering, absorption = _coefficients(node)
        thickness = number(node, node.value("thickness", "1"))
        total = scattering + absorption
        if min(scattering.min(), absorption.min(), thickness) < 0:
            raise SceneFileError(f"{node.where}: hk has a negative coefficient or thickness")
        back, through, straight = layer(scattering, total, thickness)
        opacity = float(np.clip(1 - straight.mean(), 0.0, 1.0))
        scattered = back + through
        share = float(through.sum() / scattered.sum()) if scattered.sum() > 0 else 0.0
        color = np.minimum(1.0, scattered / max(opacity, 1e-6))
        thin = [
            rgb(node, "base_color", tuple(color.tolist())),
            setting(node, "float", "diff_trans", repr(round(2 * share, 6))),
            setting(node, "float", "spec_trans", 0),
        ]
        if opacity > 0.999:
            become(node, "principledthin", *thin)
        else:
            inner = new("bsdf", node, type="principledthin")
            inner[:] = thin
            become(node, "mask", setting(node, "float", "opacity", repr(round(opacity, 6))), inner)
        note(node, "hk is principledthin of its single scattering, alike in all directions", loss=True)


def _coefficients(node: Node) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Scattering and absorption, (3,) each."""
    name = node.value("material", "skin1").lower()
    asked = {key: node.property(key) for key in ("sigma_s", "sigma_a", "sigma_t", "albedo")}
    if name not in MEASURED and not any(part is not None for part in asked.values()):
        raise SceneFileError(
            f"{node.where}: hk: nothing is known of the material '{name}': give sigmaS and sigmaA, or one of "
            f"{', '.join(MEASURED)}"
        )
    known = MEASURED.get(name, MEASURED["skin1"])
    if asked["sigma_t"] is not None or asked["albedo"] is not None:
        total = _color(asked["sigma_t"], (1.0, 1.0, 1.0))
        albedo = np.clip(_color(asked["albedo"], (0.5, 0.5, 0.5)), 0, 1)
        return total * albedo, total * (1 - albedo)
    return _color(asked["sigma_s"], known[0]), _color(asked["sigma_a"], known[1])


def _color(part: Node | None, default: Color) -> NDArray[np.float64]:
    color = default if part is None else constant_color(part, 0.0)
    return np.array(default if color is None else color)  # a texture counts as its default


def layer(
    scattering: NDArray[np.float64], total: NDArray[np.float64], thickness: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Shares of diffuse light that a layer of single, isotropic scattering sends back, through, and lets pass.

    All (3,); scattering, total: 1/length. Source: Hanrahan and Krueger 1993, equations 8 to 10, integrated over both
    hemispheres.
    """
    nodes, weights = np.polynomial.legendre.leggauss(64)
    mu, weights = 0.5 * (nodes + 1), 0.5 * weights
    inside, outside = mu[:, None], mu[None, :]
    area = weights[:, None] * weights[None, :]
    albedo = np.divide(scattering, total, out=np.zeros(3), where=total > 0)
    back, through, straight = (np.zeros(3) for _ in range(3))
    apart = np.where(np.abs(inside - outside) < 1e-9, 1.0, inside - outside)
    for channel, tau in enumerate(np.minimum(total * thickness, 1e6)):
        reflected = inside * outside / (inside + outside) * -np.expm1(-tau * (1 / inside + 1 / outside))
        fade_in, fade_out = np.exp(-tau / inside), np.exp(-tau / outside)
        passed = np.where(
            np.abs(inside - outside) < 1e-9,
            tau * fade_in,
            inside * outside * (fade_in - fade_out) / apart,
        )
        back[channel] = albedo[channel] * np.sum(area * reflected)
        through[channel] = albedo[channel] * np.sum(area * passed)
        straight[channel] = 2 * np.sum(weights * mu * np.exp(-tau / mu))
    return back, through, straight


def woven_cloth(root: Node, note: Note) -> None:
    """`irawan` becomes `diffuse` of the mean of its yarns' diffuse colours: what they weave is lost."""
    for node in plugins(root, "bsdf", "irawan"):
        yarns = [
            color
            for part in node.nodes("rgb", "spectrum", "float")
            if part.get("name", "").endswith("kd") and (color := constant_color(part, 0.0)) is not None
        ]
        mean = np.mean(yarns, axis=0) if yarns else np.full(3, 0.3)
        become(node, "diffuse", rgb(node, "reflectance", tuple(np.clip(mean, 0, 1).tolist())))
        note(node, "irawan is diffuse of the mean colour of its yarns, without their sheen", loss=True)
