"""Directions in bins of equal solid angle: the sphere laid out on a square that keeps areas (Clarberg 2008)."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import math

import drjit as dr
import mitsuba as mi

SIDE = 16
"""Bins along a side of the square."""

BINS = SIDE * SIDE

BIN_AREA = 4 * math.pi / BINS
"""Solid angle of a bin, sr."""


def direction_of(square):
    """Unit mi.Vector3f at a point of the square (mi.Point2f in [0, 1]²)."""
    u, v = 2 * square.x - 1, 2 * square.y - 1
    height = 1 - (dr.abs(u) + dr.abs(v))
    radius = 1 - dr.abs(height)
    turn = (dr.abs(v) - dr.abs(u)) / dr.maximum(radius, 1e-30) + 1
    sine, cosine = dr.sincos(dr.select(radius > 0, turn, 0) * (0.25 * dr.pi))
    flat = radius * dr.sqrt(dr.maximum(2 - dr.square(radius), 0))
    return mi.Vector3f(
        dr.mulsign(cosine * flat, u), dr.mulsign(sine * flat, v), dr.mulsign(1 - dr.square(radius), height)
    )


def square_of(direction):
    """Point of the square that `direction_of` maps to a unit vector."""
    radius = dr.sqrt(dr.maximum(1 - dr.abs(direction.z), 0))
    v = dr.atan2(dr.abs(direction.y), dr.abs(direction.x)) * (2 * dr.inv_pi) * radius
    u = radius - v
    below = direction.z < 0
    u, v = dr.select(below, 1 - v, u), dr.select(below, 1 - u, v)
    return 0.5 * mi.Point2f(dr.mulsign(u, direction.x), dr.mulsign(v, direction.y)) + 0.5


def bin_of(direction):
    """Number of the bin, mi.UInt32 below BINS, that a unit vector lies in; some bin for what is not finite."""
    at = mi.Point2u(dr.clip(square_of(direction) * SIDE, 0, SIDE - 1))
    # A NaN passes through `clip`, and tables are gathered at this number.
    return dr.minimum(at.y * SIDE + at.x, BINS - 1)


def direction_in(number, place):
    """Unit vector at a place in [0, 1)² of a bin."""
    row = number // SIDE
    corner = mi.Point2f(mi.Float(number - row * SIDE), mi.Float(row))
    return direction_of((corner + place) / SIDE)
