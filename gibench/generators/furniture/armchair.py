"""Armchairs: boxy like a sofa, a tub with a curved back, or cushions in a wooden frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import legs, post
from gibench.generators.parts import Furniture, Mesh, Part
from gibench.generators.shapes import (
    bend,
    boxes,
    fit,
    merge,
    rotate_x,
    rounded_box,
    rounded_rectangle,
    skin,
    translate,
)

SIZES = {
    "width": Size(0.97, 0.72, 1.15, 0.08),
    "depth": Size(0.86, 0.74, 1.00, 0.07),
    "height": Size(0.88, 0.74, 1.08, 0.08),
}
CHOICES = {"style": ("block", "tub", "lounge"), "cover": ("fabric", "fabric", "leather")}


def armchair(*, width: float, depth: float, height: float, style: str, cover: str) -> Furniture:
    """An armchair (m). cover: slot of the upholstery.

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("armchair", locals(), SIZES, CHOICES)
    build = {"block": _block, "tub": _tub, "lounge": _lounge}[style]
    return Furniture("armchair", parameters, tuple(build(width / 2, depth / 2, height, cover)))


def _seat(x: float, back: float, front: float, low: float, top: float, cover: str) -> Part:
    return Part(
        rounded_box((-x, x, back, front, low, top), 0.045, swell=(0, 0.008, 0.022), arc=2, flat=4), cover
    )


def _back_cushion(x: float, y: float, z0: float, z1: float, thick: float, cover: str, tilt: float) -> Part:
    cushion = rounded_box(
        (-x, x, -thick / 2, thick / 2, 0, z1 - z0), 0.055, swell=(0.004, 0.03, 0.01), arc=2, flat=4
    )
    leaning = rotate_x(cushion, tilt)
    return Part(translate(leaning, [0, y, z0 - leaning.vertices[:, 2].min()]), cover)


def _block(w: float, d: float, height: float, cover: str) -> list[Part]:
    arm, foot = 0.19, 0.11
    inner = w - arm
    arms = [
        rounded_box((s, s + arm, -d + 0.004, d, foot, 0.68 * height), 0.04, flat=1) for s in (-w, w - arm)
    ]
    base = rounded_box(
        (-inner - 0.03, inner + 0.03, -d + 0.02, d - 0.03, foot + 0.004, 0.27), 0.02, arc=2, flat=1
    )
    back = rounded_box((-inner - 0.04, inner + 0.04, -d, -d + 0.17, foot + 0.002, height), 0.05, flat=1)
    parts = [Part(mesh, cover) for mesh in (*arms, base, back)]
    parts.append(_seat(inner - 0.003, -d + 0.15, d - 0.004, 0.26, 0.44, cover))
    parts.append(_back_cushion(inner - 0.005, -d + 0.3, 0.415, height - 0.03, 0.16, cover, 0.12))
    parts.append(Part(legs("round", w - 0.09, d - 0.09, foot + 0.02, 0.045), "wood"))
    return parts


def _tub(w: float, d: float, height: float, cover: str) -> list[Part]:
    thick, foot = 0.11, 0.13
    x, back, front = w - thick / 2, -d + thick / 2, d - 0.06
    corners = [[x, front, 0], [x, back, 0], [-x, back, 0], [-x, front, 0]]
    path = bend(corners, 0.62 * x, segments=9)
    first, last = path[:1], path[-1:]
    steps = np.linspace(0, 1, 4)[1:-1, None]
    path = np.concatenate(
        [first, first + steps * (path[1] - first), path[1:-1], path[-2] + steps * (last - path[-2]), last]
    )
    headings = np.gradient(path[:, :2], axis=0)
    headings /= np.linalg.norm(headings, axis=1, keepdims=True)
    outward = np.stack([-headings[:, 1], headings[:, 0]], 1)
    rise = np.clip((front - path[:, 1]) / (front - back) / 0.85, 0, 1)
    tops = 0.62 * height + (height - 0.62 * height) * rise**2 * (3 - 2 * rise)
    section = rounded_rectangle(-0.5, 0.5, 0, 1, 0.45, segments=4)
    # The rounding is drawn for the width and must not stretch with the height.
    lift = np.where(section[:, 1] > 0.5, section[:, 1] - 1, section[:, 1]) * thick
    rings = np.empty((len(path) + 2, len(section), 3))
    rings[1:-1, :, :2] = path[:, None, :2] + thick * section[:, 0, None] * outward[:, None]
    rings[1:-1, :, 2] = np.where(section[:, 1] > 0.5, tops[:, None], foot) + lift
    rings[0], rings[-1] = rings[1].mean(0), rings[-2].mean(0)
    wall = fit(skin(rings, creases=[1, len(path)]), [-w, -d, foot], [w, front, height])
    inner = w - thick + 0.01
    base = rounded_box((-inner, inner, -d + thick - 0.01, d - 0.02, foot + 0.01, 0.29), 0.03, arc=2, flat=1)
    parts = [Part(wall, cover), Part(base, cover)]
    parts.append(_seat(inner, -d + thick - 0.01, d, 0.28, 0.45, cover))
    parts.append(Part(legs("round", 0.62 * w, 0.6 * d, foot + 0.06, 0.04, splay=0.04), "wood"))
    return parts


def _lounge(w: float, d: float, height: float, cover: str) -> list[Part]:
    bar, x = 0.04, w - 0.035
    arm = 0.6

    def frame(side: float) -> list[Mesh]:
        return [
            post(bar, bar, [[side * x, d - 0.08, 0], [side * x, d - 0.12, arm - 0.01]]),
            post(bar, bar, [[side * x, -d + 0.1, 0], [side * x, -d + 0.17, arm - 0.01]]),
            rounded_box(
                (side * x - 0.035, side * x + 0.035, -d + 0.08, d, arm - 0.02, arm + 0.012),
                0.012,
                arc=2,
                flat=1,
            ),
        ]

    inner = x - bar / 2 + 0.002
    rails = [
        [-inner, inner, d - 0.118, d - 0.088, 0.25, 0.31],
        [-inner, inner, -d + 0.122, -d + 0.152, 0.21, 0.27],
        [-inner, inner, -d + 0.15, d - 0.115, 0.262, 0.28],
    ]
    tilt = 0.24
    tall = (height - 0.3) / np.cos(tilt)
    slats = [
        [s - 0.02, s + 0.02, -0.009, 0.009, 0, tall - 0.01]
        for s in np.linspace(-inner + 0.06, inner - 0.06, 6)
    ]
    slats.append([-inner + 0.02, inner - 0.02, -0.014, 0.014, tall - 0.05, tall])
    rack = rotate_x(boxes(slats, bevel=0.003), tilt)
    rack = fit(rack, [rack.vertices[:, 0].min(), -d, 0.25], [rack.vertices[:, 0].max(), -d + 0.2, height])
    parts = [Part(merge([*frame(-1), *frame(1), boxes(rails, bevel=0.003), rack]), "wood")]
    parts.append(_seat(inner - 0.006, -d + 0.17, d - 0.02, 0.279, 0.43, cover))
    cushion = _back_cushion(inner - 0.01, -d + 0.235, 0.4, height - 0.03, 0.14, cover, tilt)
    return [*parts, cushion]


def sample_armchair(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """An armchair with the parameters that are not fixed drawn at random."""
    return armchair(**(draw(rng, SIZES, CHOICES) | fixed))
