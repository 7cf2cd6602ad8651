"""Plants: leaves on stems in a pot, for the plants on the floor and those on a sill."""

from __future__ import annotations

import numpy as np

from gibench.generators.furniture.joinery import fit_parts
from gibench.generators.parts import FloatArray, Mesh, Part
from gibench.generators.shapes import bezier, cylinder, fillet, leaf, repeat, revolve, tubes

POTS = ("cylinder", "tapered", "bowl")
PLANTS = ("bush", "fig", "palm", "swords")

_GOLDEN = np.pi * (3 - np.sqrt(5))  # the angle between successive leaves of many plants


def potted(plant: str, pot: str, width: float, height: float, arrangement: int) -> list[Part]:
    """A plant of PLANTS in a pot of POTS that fills a box `width` m wide and deep and `height` m high.

    arrangement: seeds the little differences between leaves.
    """
    rng = np.random.default_rng(arrangement)
    pot_height = float(np.clip(0.28 * height, 0.08, 0.42))
    radius = float(np.clip(0.55 * pot_height, 0.05, 0.36 * width))
    parts = [Part(_pot(pot, radius, pot_height), "pot")]
    level = 0.9 * pot_height
    inside = radius * (0.86 if pot != "bowl" else 0.8)
    parts.append(Part(cylinder(inside, level - 0.03, level, bevel=0.006, segments=24), "soil"))
    grow = {"bush": _bush, "fig": _fig, "palm": _palm, "swords": _swords}[plant]
    leaves, stems = grow(rng, width / 2, level - 0.01, height, 0.6 * inside)
    size = np.array([width / 2, width / 2, 0])
    green = [Part(leaves, "leaf")] + (
        [Part(stems, "wood" if plant == "fig" else "leaf", "stem")] if stems else []
    )
    low = np.min([p.mesh.vertices[:, 2].min() for p in green])
    # The pot keeps its shape; only what grows is made to fill the box.
    return parts + fit_parts(green, -size + np.array([0, 0, low]), size + np.array([0, 0, height]))


def _pot(style: str, radius: float, height: float) -> Mesh:
    wall = 0.06 * radius + 0.003
    foot = {"cylinder": 0.96, "tapered": 0.7, "bowl": 0.55}[style] * radius
    belly = {"cylinder": 0.98, "tapered": 0.85, "bowl": 0.97}[style] * radius
    floor = 0.8 * height
    line: list[list[float]] = [
        [0, 0],
        [foot, 0],
        [belly, 0.5 * height],
        [radius, height],
        [radius - wall, height],
        [0.9 * radius - wall, floor],
        [0, floor],
    ]
    return revolve(fillet(line, [0, 0.006, 0.4 * height, 0.3 * wall, 0.3 * wall, 0.004, 0]), segments=32)


def _placed(
    azimuth: FloatArray, elevation: FloatArray, at: FloatArray, size: FloatArray, roll: FloatArray
) -> FloatArray:
    """(N, 4, 4) matrices that turn +x to the direction (azimuth, elevation), scale by size and move to
    `at`."""
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    cr, sr = np.cos(roll), np.sin(roll)
    along = np.stack([ca * ce, sa * ce, se], 1)
    side = np.stack([-sa, ca, np.zeros_like(ca)], 1)
    up = np.cross(along, side)
    matrices = np.tile(np.eye(4), (len(azimuth), 1, 1))
    matrices[:, :3, 0] = along * size[:, None]
    matrices[:, :3, 1] = (cr[:, None] * side + sr[:, None] * up) * size[:, None]
    matrices[:, :3, 2] = (cr[:, None] * up - sr[:, None] * side) * size[:, None]
    matrices[:, :3, 3] = at
    return matrices


def _curves(controls: FloatArray, count: int) -> FloatArray:
    """(N, count, 3) points along N Bézier curves with the control points (P, N, 3)."""
    curves = bezier(controls.reshape(len(controls), -1), count).reshape(count, -1, 3)
    return curves.transpose(1, 0, 2)


def _bush(
    rng: np.random.Generator, reach: float, z0: float, height: float, spread: float
) -> tuple[Mesh, Mesh]:
    """Big leaves, each on a stem that arches out of the soil."""
    count = 22
    k = np.arange(count)
    azimuth = k * _GOLDEN + rng.uniform(-0.25, 0.25, count)
    rank = (k + 0.5) / count  # 0 for the inner, upright ones
    rise = (height - z0) * (0.95 - 0.55 * rank) * rng.uniform(0.88, 1.0, count)
    out = 0.62 * reach * np.sqrt(rank) * rng.uniform(0.85, 1.1, count)
    way = np.stack([np.cos(azimuth), np.sin(azimuth)], 1)
    foot, tip = spread * 0.6 * rank[:, None] * way, out[:, None] * way
    controls = np.empty((3, count, 3))
    controls[0, :, :2], controls[1, :, :2], controls[2, :, :2] = foot, foot, tip
    controls[0, :, 2], controls[1, :, 2], controls[2, :, 2] = z0, z0 + 0.6 * rise, z0 + 0.82 * rise
    paths = _curves(controls, 6)
    stems = tubes(paths, np.linspace(0.006, 0.0028, 6) * (0.5 + height / 2))
    tips = paths[:, -1]
    elevation = 0.75 - 1.1 * rank
    length = 0.42 * reach + 0.1 * (height - z0)
    blade = leaf(length, 0.62 * length, droop=0.35, fold=0.12, widest=0.38, cells=7)
    size = rng.uniform(0.75, 1.1, count)
    roll = rng.uniform(-0.35, 0.35, count)
    sunk = tips - 0.01 * length * np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], 1)
    return repeat(blade, _placed(azimuth, elevation, sunk, size, roll)), stems


def _fig(
    rng: np.random.Generator, reach: float, z0: float, height: float, spread: float
) -> tuple[Mesh, Mesh]:
    """A little tree: a few woody stems with leaves all along their upper half."""
    del spread
    trunks, each = 3, 22
    turn = np.arange(trunks) * 2 * np.pi / trunks + rng.uniform(-0.4, 0.4, trunks)
    way = np.stack([np.cos(turn), np.sin(turn)], 1)
    top = z0 + (height - z0) * (0.93 - 0.12 * np.arange(trunks))
    controls = np.empty((3, trunks, 3))
    controls[..., :2] = np.stack([0.02 * way, 0.03 * way, 0.6 * reach * way])
    controls[..., 2] = np.stack([np.full(trunks, z0), (z0 + top) / 2, top])
    stems = tubes(_curves(controls, 9), np.linspace(0.014, 0.005, 9) * (0.4 + 0.6 * height / 1.5), sides=8)
    fine = 67
    t = np.linspace(0.38, 1.0, each)
    at = _curves(controls, fine)[:, np.rint(t * (fine - 1)).astype(int)]
    shape = (trunks, each)
    azimuth = turn[:, None] + np.arange(each) * _GOLDEN + rng.uniform(-0.3, 0.3, shape)
    elevation = 0.15 + 0.9 * np.linspace(0, 1, each) ** 2 + rng.uniform(-0.25, 0.25, shape)
    length = 0.36 * reach + 0.05 * height
    blade = leaf(length, 0.5 * length, droop=0.3, fold=0.18, widest=0.5, cells=5)
    size, roll = rng.uniform(0.6, 1.1, trunks * each), rng.uniform(-0.4, 0.4, trunks * each)
    matrices = _placed(azimuth.ravel(), elevation.ravel(), at.reshape(-1, 3), size, roll)
    return repeat(blade, matrices), stems


def _palm(
    rng: np.random.Generator, reach: float, z0: float, height: float, spread: float
) -> tuple[Mesh, Mesh]:
    """Arching fronds with pairs of narrow leaflets."""
    fronds, pairs = 9, 11
    k = np.arange(fronds)
    turn = k * _GOLDEN + rng.uniform(-0.2, 0.2, fronds)
    way = np.stack([np.cos(turn), np.sin(turn)], 1)
    rank = (k + 0.5) / fronds
    out = (reach * (0.35 + 0.55 * rank))[:, None] * way
    rise = (height - z0) * (1.0 - 0.4 * rank)
    foot = 0.5 * spread * rank[:, None] * way
    controls = np.empty((4, fronds, 3))
    controls[..., :2] = np.stack([foot, foot + 0.12 * out, 0.6 * out, out])
    # A frond hangs over the less, the steeper it stands.
    droop = np.minimum(0.3, 0.5 * np.linalg.norm(out, axis=1) / rise)
    controls[..., 2] = z0 + rise * np.stack([0 * droop, 0.7 + 0 * droop, 1 + 0.3 * droop, 1 - droop])
    stems = tubes(_curves(controls, 9), np.linspace(0.007, 0.002, 9) * (0.5 + height / 2))
    fine = 45
    t = np.linspace(0.35, 0.97, pairs)
    at = _curves(controls, fine)[:, np.rint(t * (fine - 1)).astype(int)]
    # Axes: frond, pair, side.
    shape = (fronds, pairs, 2)
    side = np.array([1.0, -1.0])
    azimuth = turn[:, None, None] + side * (1.05 - 0.5 * t[:, None])
    elevation = 0.25 - 0.5 * t[:, None] + rng.uniform(-0.1, 0.1, shape)
    size = np.sin(np.pi * (0.2 + 0.75 * t[:, None])) * rng.uniform(0.9, 1.1, shape)
    length = 0.5 * reach
    blade = leaf(length, 0.13 * length, droop=0.35, fold=0.25, widest=0.35, cells=4)
    matrices = _placed(
        azimuth.ravel(),
        elevation.ravel(),
        np.repeat(at.reshape(-1, 3), 2, 0),
        size.ravel(),
        np.zeros(size.size),
    )
    return repeat(blade, matrices), stems


def _swords(
    rng: np.random.Generator, reach: float, z0: float, height: float, spread: float
) -> tuple[Mesh, None]:
    """Stiff upright leaves, as of a snake plant."""
    count = 16
    k = np.arange(count)
    rank = (k + 0.5) / count
    azimuth = k * _GOLDEN
    out = spread * np.sqrt(rank)
    at = np.stack([out * np.cos(azimuth), out * np.sin(azimuth), np.full(count, z0)], 1)
    length = height - z0
    blade = leaf(length, 0.13 * length, droop=0.04, fold=0.2, thickness=0.004, widest=0.4, cells=8)
    size = (1.0 - 0.45 * rank) * rng.uniform(0.85, 1.0, count)
    # The outermost leaves lean so far that their tips reach the side of the box.
    widest = np.arcsin(np.clip((reach - spread) / (0.65 * length), 0.05, 0.6))
    lean = np.pi / 2 - widest * rank * rng.uniform(0.7, 1.1, count)
    return repeat(blade, _placed(azimuth, lean, at, size, rng.uniform(-0.6, 0.6, count))), None
