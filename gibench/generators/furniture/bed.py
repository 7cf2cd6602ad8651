"""Beds with mattress, duvet and pillows: platform, slatted or upholstered headboard."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import legs
from gibench.generators.parts import Furniture, Part
from gibench.generators.shapes import boxes, pillow, rotate_x, rotate_z, rounded_box, sheet, translate

SIZES = {
    "width": Size(1.37, 0.90, 2.00, 0.16),
    "depth": Size(2.24, 2.05, 2.40, 0.04),
    "height": Size(0.91, 0.76, 1.25, 0.10),
}
CHOICES = {
    "style": ("platform", "slats", "upholstered"),
    "finish": ("wood", "wood", "lacquer"),
    "duvet": ("flat", "turned", "draped"),
    "arrangement": range(1000),
}


def bed(
    *, width: float, depth: float, height: float, style: str, finish: str, duvet: str, arrangement: int
) -> Furniture:
    """A bed (m), its head at the back; depth is its length, height that of the headboard.

    duvet: how it lies (turned: folded back at the pillows; draped: down over the sides). arrangement: which
    folds and pillow angles. Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("bed", locals(), SIZES, CHOICES)
    w, d = width / 2, depth / 2
    rail_low, rail_top, top = 0.14, 0.3, 0.5
    head = 0.09 if style == "upholstered" else 0.05
    head_y = -d + head
    parts: list[Part] = []
    frame_slot = "fabric" if style == "upholstered" else finish
    if style == "upholstered":
        parts.append(
            Part(
                rounded_box((-w, w, -d, head_y, 0.06, height), 0.035, swell=(0, 0.012, 0), arc=3, flat=4),
                "fabric",
            )
        )
        boards = [
            *[
                rounded_box((s, s + 0.06, head_y - 0.02, d - 0.01, rail_low, rail_top), 0.02, arc=2, flat=1)
                for s in (-w + 0.02, w - 0.08)
            ],
            rounded_box(
                (-w + 0.022, w - 0.022, d - 0.06, d, rail_low + 0.001, rail_top + 0.001), 0.02, arc=2, flat=1
            ),
        ]
        parts += [Part(b, "fabric") for b in boards]
    else:
        bars = [[s, s + 0.03, head_y - 0.01, d - 0.01, rail_low, rail_top] for s in (-w + 0.012, w - 0.042)]
        bars.append([-w + 0.01, w - 0.01, d - 0.03, d, rail_low - 0.002, rail_top + 0.002])
        if style == "platform":
            bars.append([-w, w, -d, head_y, 0.08, height])
        else:
            bars += [[s, s + 0.06, -d, head_y, 0, height] for s in (-w, w - 0.06)]
            bars += [
                [-w + 0.05, w - 0.05, -d + 0.008, head_y - 0.008, z, z + 0.08]
                for z in (rail_top + 0.1, height - 0.1)
            ]
            count = round((width - 0.12) / 0.11)
            places = np.linspace(-w + 0.06, w - 0.06, count + 1)[1:-1]
            bars += [
                [x - 0.022, x + 0.022, -d + 0.016, head_y - 0.016, rail_top + 0.15, height - 0.08]
                for x in places
            ]
        parts.append(Part(boxes(bars, bevel=0.006), frame_slot))
    foot_slot = "wood" if style == "upholstered" else finish
    parts.append(Part(legs("square", w - 0.09, d - 0.1, rail_low + 0.03, 0.07, back=-d + 0.16), foot_slot))
    slab = boxes(
        [-w + 0.03, w - 0.03, head_y - 0.005, d - 0.02, rail_top - 0.07, rail_top - 0.04], bevel=0.003
    )
    parts.append(Part(slab, foot_slot))
    side = 0.05
    mattress = (-w + side, w - side, head_y + 0.004, d - 0.035, rail_top - 0.045, top)
    parts.append(Part(rounded_box(mattress, 0.05, swell=(0, 0, 0.008)), "linen", "sheet"))
    parts += _duvet(duvet, mattress, w - 0.006, arrangement)
    parts += _pillows(width, head_y, top, arrangement)
    return Furniture("bed", parameters, tuple(parts))


def _duvet(style: str, mattress: tuple[float, ...], reach_x: float, arrangement: int) -> list[Part]:
    x, top = mattress[1], mattress[5]
    start = mattress[2] + 0.48
    if style != "draped":
        cover = rounded_box(
            (-x - 0.022, x + 0.022, start, mattress[3] + 0.012, top - 0.13, top + 0.06),
            0.055,
            swell=(0.004, 0.004, 0.016),
            flat=4,
        )
        parts = [Part(cover, "linen", "duvet")]
        if style == "turned":
            fold = rounded_box(
                (-x - 0.028, x + 0.028, start - 0.03, start + 0.32, top - 0.11, top + 0.085),
                0.04,
                swell=(0, 0.004, 0.008),
            )
            parts.append(Part(fold, "linen", "sheet"))
        return parts
    # Across the bed: up one side, over the mattress with round shoulders, down the other.
    thick, drop, radius = 0.03, top - 0.3, 0.05
    half = reach_x - thick / 2 - 0.012
    level = top + 0.012 + thick / 2
    turn = np.linspace(0, np.pi / 2, 5)
    corner = np.stack([half - radius + radius * np.cos(turn), level - radius + radius * np.sin(turn)], 1)
    down = np.stack([np.full(5, half), np.linspace(level - radius - drop, level - radius, 6)[:5]], 1)
    flat = np.stack([np.linspace(half - radius, 0, 8)[1:], np.full(7, level)], 1)
    right = np.concatenate([down, corner, flat])
    section = np.concatenate([right[:-1], right[::-1] * [-1, 1]])
    end = mattress[3] - 0.045
    y = np.linspace(start, end, 24)
    grid = np.empty((len(section), len(y), 3))
    grid[..., 0], grid[..., 1], grid[..., 2] = section[:, None, 0], y, section[:, None, 1]
    hang = np.clip((level - radius - section[:, 1]) / drop, 0, 1)[:, None]
    phases = np.random.default_rng(arrangement).uniform(0, 2 * np.pi, 4)
    waves = np.sin(17 * y + phases[0]) + 0.6 * np.sin(29 * y + phases[1])
    grid[..., 0] += 0.007 * np.sign(section[:, :1]) * hang * (waves - 1.6) * 0.6
    ripple = np.sin(5 * section[:, :1] + 9 * y + phases[2]) + np.sin(9 * section[:, :1] - 6 * y + phases[3])
    grid[..., 2] += 0.004 * (1 - hang) * (1 + 0.5 * ripple)
    # At the foot it sinks onto the mattress, so that no slit is left to look into.
    grid[..., 2] -= 0.03 * (1 - hang) * np.clip((y - end + 0.12) / 0.12, 0, 1) ** 2
    return [Part(sheet(grid[::-1], thick), "linen", "duvet")]


def _pillows(width: float, head_y: float, top: float, arrangement: int) -> list[Part]:
    rng = np.random.default_rng(arrangement)
    count = 1 if width < 1.25 else 2
    share = (width - 0.14) / count
    size = min(0.7, share - 0.04)
    parts = []
    for k in range(count):
        x = (k + 0.5 - count / 2) * share
        cushion = rotate_x(pillow(size, 0.45, 0.15), 0.3 + 0.1 * float(rng.uniform(-1, 1)))
        cushion = translate(
            rotate_z(cushion, 0.05 * float(rng.uniform(-1, 1))), [x, head_y + 0.265, top + 0.115]
        )
        parts.append(Part(cushion, "linen", "pillow"))
    return parts


def sample_bed(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A bed with the parameters that are not fixed drawn at random."""
    return bed(**(draw(rng, SIZES, CHOICES) | fixed))
