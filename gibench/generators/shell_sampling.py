"""Drawing the sizes of a shell: footprint, height, door and windows."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.openings import ARCHITRAVE, Opening
from gibench.generators.shell import Shell, build_shell, footprint_corners, measured_walls

# (mean, standard deviation, least, greatest) in metres.
SIZES = {"width": (4.5, 1.0, 3.0, 8.0), "depth": (5.5, 1.0, 3.5, 8.0), "height": (2.6, 0.3, 2.3, 4.0)}
L_SHAPED = 0.3  # share of the rooms whose kind and size allow it
L_KINDS = ("living", "bedroom", "dining-kitchen", "office")
MIN_LEG = 2.2  # width of either leg of an L, m
MIN_WINDOW_WALL = 1.7  # a shorter wall gets no window, m
BETWEEN = 0.45  # least distance between two openings of a wall, m


def clipped_gaussian(
    rng: np.random.Generator, mean: float, deviation: float, least: float, greatest: float
) -> float:
    """A Gaussian draw, repeated until it lies in [least, greatest], so that nothing piles up at the ends."""
    while True:
        value = float(rng.normal(mean, deviation))
        if least <= value <= greatest:
            return value


def sample_shell(rng: np.random.Generator, kind: str, **fixed: Any) -> Shell:
    """Draw a shell for a room of that kind; `fixed` are keyword arguments of `build_shell` not to be drawn."""
    parameters: dict[str, Any] = {name: clipped_gaussian(rng, *size) for name, size in SIZES.items()}
    parameters.update((k, v) for k, v in fixed.items() if k in SIZES)
    parameters["notch"] = _sample_notch(rng, kind, parameters["width"], parameters["depth"])
    parameters["wall_thickness"] = float(rng.uniform(0.13, 0.3))
    parameters["skirting"] = [float(rng.uniform(0.06, 0.12)), float(rng.uniform(0.012, 0.018))]
    parameters.update(fixed)
    corners = footprint_corners(parameters["width"], parameters["depth"], parameters["notch"])
    walls = measured_walls(corners, parameters["wall_thickness"])
    accent = int(rng.integers(len(walls))) if rng.random() < 0.35 else -1
    parameters.setdefault("accent_wall", accent)
    if "openings" not in fixed:
        spans = [
            # A mitred end leaves no room for a hole within the wall's thickness.
            (0.3 + w.thickness * w.reflex[0], w.length - 0.3 - w.thickness * w.reflex[1])
            for w in walls
        ]
        parameters["openings"] = _sample_openings(rng, kind, spans, parameters)
    return build_shell(**parameters)


def _sample_notch(rng: np.random.Generator, kind: str, width: float, depth: float) -> list[float] | None:
    corner, across, up, chance = (
        int(rng.integers(4)),
        rng.uniform(0.25, 0.5),
        rng.uniform(0.25, 0.5),
        rng.random(),
    )
    across, up = min(across * width, width - MIN_LEG), min(up * depth, depth - MIN_LEG)
    if kind not in L_KINDS or chance > L_SHAPED or min(across, up) < 0.8:
        return None
    return [corner, float(across), float(up)]


def _sample_openings(
    rng: np.random.Generator,
    kind: str,
    spans: list[tuple[float, float]],
    parameters: dict[str, Any],
) -> list[dict[str, Any]]:
    height = parameters["height"]
    room = [b - a for a, b in spans]
    width = float(rng.uniform(0.82, 0.95)) + 0.04
    # Any wall that leaves the door its frame and a little air may hold it; short walls are no worse than long.
    fitting = [i for i, r in enumerate(room) if r > width + 2 * ARCHITRAVE]
    wall = int(rng.choice(fitting))
    low, high = spans[wall]
    # Doors stand near a corner more often than in the middle, which keeps the wall useful.
    s0 = low + ARCHITRAVE + float(rng.beta(0.6, 0.6)) * (high - low - width - 2 * ARCHITRAVE)
    style = ((0, 0), (1, 2), (2, 3), (1, 4))[int(rng.integers(4))]
    door = Opening(
        wall,
        "door",
        s0,
        s0 + width,
        0.0,
        float(rng.uniform(2.0, min(2.12, height - 0.15))),
        min(0.06, parameters["wall_thickness"] - 0.06),
        style,
        int(rng.choice([-1, 1])),
    )
    openings = [door]
    area = parameters["width"] * parameters["depth"]
    wanted = (
        int(rng.integers(0, 2)) if kind == "bathroom" else 1 + int(rng.random() < 0.55) + int(area > 24.0)
    )
    weights = np.array([r * (r > MIN_WINDOW_WALL - 0.6) for r in room])
    weights[wall] *= 0.15
    # Half the rooms have windows to one side only, as flats do.
    one_side = rng.random() < 0.5
    favourite = int(rng.choice(len(room), p=weights / weights.sum()))
    for attempt in range(10 * wanted):
        if len(openings) > wanted:
            break
        drawn = int(rng.choice(len(room), p=weights / weights.sum()))
        side = favourite if one_side and attempt < 5 * wanted else drawn
        window = _sample_window(rng, kind, side, spans[side], height)
        if window is not None and all(
            window.wall != o.wall or window.s0 > o.s1 + BETWEEN or window.s1 < o.s0 - BETWEEN
            for o in openings
        ):
            openings.append(window)
    return [_parameters(o) for o in openings]


def _sample_window(
    rng: np.random.Generator, kind: str, wall: int, span: tuple[float, float], height: float
) -> Opening | None:
    top = min(height - 0.2, float(rng.uniform(2.0, 2.35)))
    if kind == "bathroom":
        width, sill = float(rng.uniform(0.6, 1.1)), float(rng.uniform(1.1, 1.4))
    else:
        width = float(rng.uniform(1.1, 2.7))
        sill = float(rng.uniform(0.6, 0.95)) if rng.random() < 0.75 else float(rng.uniform(0.2, 0.35))
    low, high = span
    width = min(width, high - low)
    if width < 0.6:
        return None
    s0 = low + float(rng.random()) * max(0.0, high - width - low)
    columns = max(1, round(width / float(rng.uniform(0.55, 0.95))))
    return Opening(wall, "window", s0, s0 + width, sill, top, style=(columns, int(rng.integers(1, 3))))


def _parameters(opening: Opening) -> dict[str, Any]:
    return {
        "wall": opening.wall,
        "kind": opening.kind,
        "s0": opening.s0,
        "s1": opening.s1,
        "z0": opening.z0,
        "z1": opening.z1,
        "recess": opening.recess,
        "style": list(opening.style),
        "handle": opening.handle,
    }
