"""Placement of the labels of a plot, so that none lies on another: plain geometry in pixels.

Greedy: the labels that must be shown come first, each takes the nearest free place around its point (compare
Christensen, Marks & Shieber 1995, An empirical study of algorithms for point-feature label placement, ACM TOG 14(3)).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

RINGS = (3, 6, 10, 16, 24, 34, 46, 60, 80, 105, 135, 170, 210)
"""Distances between a point and its label that are tried, nearest first, in typographic points; then every 40."""

DIRECTIONS = 24

NEAR = 10
"""Up to this distance a label needs no line to its point, and a label that may be dropped is not put farther away."""

GAP = 1.5
"""Least distance between two labels."""

COVERED, CROSSED = 25, 60
"""Cost, in distance, of covering an obstacle and to let a label and another's line cross."""


@dataclass(frozen=True)
class Box:
    """An upright rectangle."""

    left: float
    bottom: float
    right: float
    top: float

    def meets(self, other: Box, gap: float = 0.0) -> bool:
        """Whether the two come nearer than the gap."""
        return (
            self.left < other.right + gap
            and other.left < self.right + gap
            and self.bottom < other.top + gap
            and other.bottom < self.top + gap
        )

    def holds(self, other: Box) -> bool:
        """Whether the other lies inside."""
        return (
            self.left <= other.left
            and other.right <= self.right
            and self.bottom <= other.bottom
            and other.top <= self.top
        )

    def nearest(self, x: float, y: float) -> tuple[float, float]:
        """Give the point of the box that is nearest to a point."""
        return min(max(x, self.left), self.right), min(max(y, self.bottom), self.top)


@dataclass(frozen=True)
class Label:
    """A text of a size at a point; required: it must be shown, however far away."""

    x: float
    y: float
    width: float
    height: float
    required: bool = True


def place(
    labels: Sequence[Label], obstacles: Sequence[Box], bounds: Box, *, scale: float = 1.0
) -> list[Box | None]:
    """Find a place for every label.

    obstacles: what labels should rather not cover, such as markers and curves; they give way only where nothing
    else is left. scale: pixels per point.

    Returns: a box a label, in their order. None where there was no room: for a label that is not required because its
    point is crowded, for one that is because the bounds are full.
    """
    placed: list[Box | None] = [None] * len(labels)
    lines: list[tuple[float, float, float, float]] = []
    taken: list[Box] = []
    for index in sorted(range(len(labels)), key=lambda i: (not labels[i].required, labels[i].x)):
        label = labels[index]
        best, cost = None, math.inf
        for distance, box in _candidates(label, bounds, scale):
            if distance >= cost:
                break
            if not label.required and distance > NEAR * scale:
                break
            if not bounds.holds(box) or any(box.meets(other, GAP * scale) for other in taken):
                continue
            covered = sum(box.meets(other) for other in obstacles)
            crossed = sum(_crosses(line, box) for line in lines)
            if distance > NEAR * scale:
                leader = (label.x, label.y, *box.nearest(label.x, label.y))
                crossed += sum(_crosses(leader, other) for other in taken)
            if covered + crossed and not label.required:
                continue
            price = distance + scale * (COVERED * covered + CROSSED * crossed)
            if price < cost:
                best, cost = box, price
        if best is not None:
            placed[index] = best
            taken.append(best)
            if _distance(label, best) > NEAR * scale:
                lines.append((label.x, label.y, *best.nearest(label.x, label.y)))
    return placed


def spread(wanted: Sequence[float], size: float, low: float, high: float) -> list[float]:
    """Move positions on a line as little as can be (least squares) until they are `size` apart and within [low, high].

    Where they cannot all fit they share the room evenly. Pool-adjacent-violators (Barlow et al. 1972, Statistical
    inference under order restrictions): positions that push each other move as one block.
    """
    if not wanted:
        return []
    step = min(size, (high - low) / max(1, len(wanted) - 1))
    order = sorted(range(len(wanted)), key=lambda i: wanted[i])
    blocks: list[tuple[float, int]] = []
    for rank, index in enumerate(order):
        mean, count = wanted[index] - rank * step, 1
        while blocks and blocks[-1][0] > mean:
            last, number = blocks.pop()
            mean, count = (mean * count + last * number) / (count + number), count + number
        blocks.append((mean, count))
    result = [0.0] * len(wanted)
    rank = 0
    for mean, count in blocks:
        for _ in range(count):
            base = min(max(mean, low), high - (len(wanted) - 1) * step)
            result[order[rank]] = base + rank * step
            rank += 1
    return result


def needs_line(label: Label, box: Box, scale: float = 1.0) -> bool:
    """Whether a label is so far from its point that a line should join them."""
    return _distance(label, box) > NEAR * scale


def _candidates(label: Label, bounds: Box, scale: float) -> Iterator[tuple[float, Box]]:
    widest = math.hypot(bounds.right - bounds.left, bounds.top - bounds.bottom) / scale
    for ring in (*RINGS, *range(RINGS[-1] + 40, int(widest), 40)):
        distance = ring * scale
        for turn in range(DIRECTIONS):
            angle = 2 * math.pi * turn / DIRECTIONS
            across, up = math.cos(angle), math.sin(angle)
            # The box touches the ring with the side or the corner that faces the point.
            x = label.x + distance * across + (across - 1) / 2 * label.width
            y = label.y + distance * up + (up - 1) / 2 * label.height
            yield distance, Box(x, y, x + label.width, y + label.height)


def _distance(label: Label, box: Box) -> float:
    x, y = box.nearest(label.x, label.y)
    return math.hypot(x - label.x, y - label.y)


def _crosses(line: tuple[float, float, float, float], box: Box) -> bool:
    # Liang & Barsky 1984: the part of the segment inside the four half-planes is not empty.
    x0, y0, x1, y1 = line
    start, end = 0.0, 1.0
    for step, room in (
        (x0 - x1, x0 - box.left),
        (x1 - x0, box.right - x0),
        (y0 - y1, y0 - box.bottom),
        (y1 - y0, box.top - y0),
    ):
        if step == 0:
            if room < 0:
                return False
            continue
        at = room / step
        if step < 0:
            start = max(start, at)
        else:
            end = min(end, at)
        if start > end:
            return False
    return True
