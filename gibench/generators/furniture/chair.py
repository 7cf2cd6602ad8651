"""Dining chairs: slatted, ladder-backed, upholstered, or a plastic shell on splayed legs."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.furniture.drawing import Size, checked, draw
from gibench.generators.furniture.joinery import EMBED, legs, post
from gibench.generators.parts import Furniture, Mesh, Part
from gibench.generators.shapes import bezier, boxes, fit, merge, rounded_box, sheet, transform

SIZES = {
    "width": Size(0.48, 0.40, 0.62),
    "depth": Size(0.57, 0.46, 0.70),
    "height": Size(0.88, 0.76, 1.08, 0.07),
}
CHOICES = {
    "style": ("slats", "ladder", "panel", "shell"),
    "finish": ("wood", "wood", "lacquer"),
    "seat": ("wood", "fabric", "leather"),
}


def chair(*, width: float, depth: float, height: float, style: str, finish: str, seat: str) -> Furniture:
    """A chair (m). style: of its back; finish: slot of its frame; seat: slot of its seat (a shell is
    plastic).

    Raises FurnitureError for a size out of SIZES or an option out of CHOICES.
    """
    parameters = checked("chair", locals(), SIZES, CHOICES)
    seat_top = float(np.clip(0.52 * height, 0.43, 0.48))
    parts = (
        _shell(width, depth, height, seat_top, finish)
        if style == "shell"
        else _framed(width, depth, height, seat_top, style, finish, seat)
    )
    return Furniture("chair", parameters, tuple(parts))


def _shell(width: float, depth: float, height: float, seat_top: float, finish: str) -> list[Part]:
    # The middle line of the shell from the front edge of the seat over the hollow up to the top of the back.
    y, z = depth / 2, seat_top
    line = bezier(
        [
            [y, z - 0.02],
            [0.75 * y, z + 0.015],
            [0.1 * y, z - 0.03],
            [-0.95 * y, z - 0.06],
            [-0.75 * y, z + 0.16],
            [-y, height],
        ],
        101,
    )
    # Points lie closer at the ends, where the outline is round.
    t = (1 - np.cos(np.linspace(0, np.pi, 23))) / 2
    line = line[np.rint(100 * t).astype(int)]
    across = np.linspace(-1, 1, 11)
    half = width / 2 * (0.86 + 0.14 * np.sin(np.pi * np.clip(t * 1.15, 0, 1)))
    # Superelliptic corners at both ends, which leave a little more than half of the edge straight.
    end = np.clip((np.abs(2 * t - 1) - 0.7) / 0.3, 0, 1)
    round_off = 0.55 + 0.45 * (1 - end**2.5) ** 0.4
    grid = np.empty((11, 23, 3))
    grid[..., 0] = across[:, None] * half * round_off
    grid[..., 1] = line[:, 0] + 0.05 * across[:, None] ** 2 * t
    grid[..., 2] = line[:, 1] + 0.045 * across[:, None] ** 2 * np.sin(np.pi * np.clip(1.6 * t, 0, 1))
    shell = fit(sheet(grid[::-1], 0.007), [-width / 2, -y, seat_top - 0.045], [width / 2, y, height])
    spread = 0.32 * width
    stand = legs("round", spread - 0.045, 0.26 * depth, seat_top - 0.05, 0.032, splay=0.045)
    rails = boxes(
        [
            [-spread - 0.02, spread + 0.02, s - 0.012, s + 0.012, seat_top - 0.075, seat_top - 0.048]
            for s in (-0.26 * depth, 0.24 * depth)
        ]
        + [
            [s - 0.012, s + 0.012, -0.25 * depth, 0.23 * depth, seat_top - 0.072, seat_top - 0.03]
            for s in (-0.06, 0.06)
        ],
        bevel=0.003,
    )
    return [Part(shell, "plastic"), Part(stand, finish), Part(rails, "metal")]


def _framed(
    width: float, depth: float, height: float, seat_top: float, style: str, finish: str, seat: str
) -> list[Part]:
    thick, rake = 0.034, 0.11 * depth
    x, back = width / 2 - thick / 2, -depth / 2 + thick / 2
    foot_back = back + 0.35 * rake
    knee = back + rake
    posts = [
        post(thick, thick, [[s * x, foot_back, 0], [s * x, knee, 0.9 * seat_top], [s * x, back, height]])
        for s in (-1, 1)
    ]
    front = depth / 2 - 0.02 - thick / 2
    feet = [
        post(
            0.8 * thick,
            0.8 * thick,
            [[s * (x - 0.006), front, 0], [s * (x - 0.006), front, seat_top - 0.024]],
            taper=1.25,
        )
        for s in (-1, 1)
    ]
    rail_z = (seat_top - 0.085, seat_top - 0.027)
    inner = x - thick / 2 + EMBED
    rails = [
        [-inner, inner, front - 0.009, front + 0.009, *rail_z],
        [-inner, inner, knee - 0.009, knee + 0.009, *rail_z],
        *[
            [
                s * (x - 0.004) - 0.009,
                s * (x - 0.004) + 0.009,
                knee,
                front,
                rail_z[0] + 0.002,
                rail_z[1] - 0.002,
            ]
            for s in (-1, 1)
        ],
    ]
    frame = [*posts, *feet, boxes(rails, bevel=0.002)]
    slope = (knee - back) / (height - 0.9 * seat_top)

    def lean_back(mesh: Mesh) -> Mesh:
        matrix = np.eye(4)
        matrix[1, 2], matrix[1, 3] = -slope, knee + slope * 0.9 * seat_top
        return transform(mesh, matrix)

    parts = []
    top = height - 0.012
    low = seat_top + 0.16 * (height - seat_top)
    if style == "slats":
        count = 5
        places = np.linspace(-inner, inner, count + 2)[1:-1]
        bars = [
            [-inner, inner, -0.011, 0.011, top - 0.07, top],
            [-inner, inner, -0.010, 0.010, low, low + 0.04],
        ]
        bars += [[p - 0.014, p + 0.014, -0.005, 0.005, low + 0.03, top - 0.06] for p in places]
        frame.append(lean_back(boxes(bars, bevel=0.003)))
    elif style == "ladder":
        levels = np.linspace(low, top - 0.06, 4)
        frame.append(
            lean_back(boxes([[-inner, inner, -0.008, 0.008, z, z + 0.06] for z in levels], bevel=0.004))
        )
    else:
        pad = rounded_box((-inner, inner, -0.02, 0.03, low, top), 0.014, swell=(0, 0.006, 0), arc=2)
        parts.append(Part(lean_back(pad), seat if seat != "wood" else "fabric"))
    base = (-width / 2, width / 2, knee + thick / 2 + EMBED, depth / 2, seat_top - 0.031, seat_top)
    if seat == "wood":
        parts.append(Part(rounded_box(base, 0.009, arc=2, flat=1), finish))
    else:
        cushion = (base[0], base[1], base[2], base[3], seat_top - 0.03, seat_top + 0.025)
        parts.append(Part(rounded_box(cushion, 0.02, swell=(0, 0, 0.012)), seat))
    return [Part(merge(frame), finish), *parts]


def sample_chair(rng: np.random.Generator, **fixed: Any) -> Furniture:
    """A chair with the parameters that are not fixed drawn at random."""
    return chair(**(draw(rng, SIZES, CHOICES) | fixed))
