"""Motion of a mirror point with the eye: first and second order on a surface of known curvature.

Chen and Arvo 2000 ("Theory and application of specular path perturbation") and Rodriguez et al. 2020, section 5.1: the
path from p over x to q is stationary among those over the surface f = 0 (Fermat), so x is a function of p, and the
implicit function theorem gives its derivatives. Here f is the paraboloid z = ½ (κ₁ s² + κ₂ t²) over the tangent plane
at x, whose third derivatives vanish, and the system of four equations is solved by hand: two unknowns in the tangent
plane, then the height over it and the Lagrange multiplier.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

FOCUS = 0.02
"""Smallest determinant of the 2 × 2 system, as a share of what it is on a plane: at the focus of a concave mirror it
is 0, and a point moves infinitely far."""


@dataclass
class Mirror:
    """A point of a surface that mirrors something to an eye, and how the surface bends there.

    point: mi.Point3f, m. normal: unit mi.Vector3f, towards the eye. curvature: mi.Vector2f, principal, 1/m, positive
    where the surface bends towards its normal. direction: unit mi.Vector3f of the first of the two; 0 will do where
    both are equal.
    """

    point: Any
    normal: Any
    curvature: Any
    direction: Any


def _hessian(unit: Any, inverse: Any, a: Any, b: Any) -> Any:
    """aᵀ (I − uuᵀ) b / d: of the distance to a point, twice differentiated; unit: from the point, inverse: 1 / d."""
    return inverse * (dr.dot(a, b) - dr.dot(unit, a) * dr.dot(unit, b))


def _third(unit: Any, inverse: Any, w: Any) -> Any:
    """Of the distance to a point, differentiated three times, twice along w: mi.Vector3f."""
    along = dr.dot(unit, w)
    across = w - along * unit
    return -(2 * along * across + unit * dr.dot(across, across)) * dr.square(inverse)


def _limited(vector: Any, longest: Any) -> Any:
    """A vector cut to a length."""
    length = dr.norm(vector)
    return vector * dr.select(length > longest, longest / dr.maximum(length, 1e-30), 1)


def _frame(mirror: Mirror) -> tuple[Any, Any]:
    """Unit tangents along the principal directions."""
    n = mirror.normal
    tangent = mirror.direction - dr.dot(mirror.direction, n) * n
    length = dr.norm(tangent)
    s = dr.select(length > 1e-3, tangent / dr.maximum(length, 1e-3), mi.coordinate_system(n)[0])
    return s, dr.cross(n, s)


def displacement(mirror: Mirror, eye: Any, target: Any, far: Any, move: Any, order: Any) -> Any:
    """Displacement of the mirror point of `target` as the eye moves, mi.Vector3f, m.

    eye: mi.Point3f, p. target: what is mirrored, mi.Point3f, or its unit direction where that is infinitely far (`far`,
    mi.Bool). move: mi.Vector3f, of the eye, Δp. order: mi.UInt32, 0 (no motion at all), 1 (Jacobian) or 2 (Jacobian and
    Hessian). The error is O(|Δp|^(order + 1)). The result is finite: no longer than the paths to eye and target and the
    move together, its second order no longer than its first.
    """
    n = mirror.normal
    to_point = mirror.point - eye
    distance = dr.norm(to_point)
    p_inverse = dr.rcp(dr.maximum(distance, 1e-20))
    u = to_point * p_inverse
    from_target = mirror.point - target
    reach = dr.select(far, 0, dr.norm(from_target))
    q_inverse = dr.select(far, 0, dr.rcp(dr.maximum(reach, 1e-20)))
    v = dr.select(far, -mi.Vector3f(target), from_target * q_inverse)
    multiplier = -dr.dot(u + v, n)
    s, t = _frame(mirror)

    def second(a, b):
        return _hessian(u, p_inverse, a, b) + _hessian(v, q_inverse, a, b)

    k_s, k_t = mirror.curvature.x, mirror.curvature.y
    m_ss, m_tt, m_st = (
        second(s, s) - multiplier * k_s,
        second(t, t) - multiplier * k_t,
        second(s, t),
    )
    plane = second(s, s) * second(t, t) - dr.square(m_st)
    determinant = m_ss * m_tt - dr.square(m_st)
    # The sign of a determinant of 0 is as good as the other.
    least = FOCUS * dr.abs(plane)
    determinant = dr.select(dr.abs(determinant) < least, dr.copysign(least, determinant), determinant)
    inverse = dr.select(determinant != 0, dr.rcp(determinant), 0)

    def solved(r_s, r_t):
        return inverse * (m_tt * r_s - m_st * r_t), inverse * (m_ss * r_t - m_st * r_s)

    drive = p_inverse * (move - dr.dot(u, move) * u)
    a_s, a_t = solved(dr.dot(drive, s), dr.dot(drive, t))
    a = a_s * s + a_t * t
    longest = distance + reach + dr.norm(move)
    first = _limited(a, longest)

    push = dr.dot(n, drive) - second(n, a)
    height = k_s * dr.square(a_s) + k_t * dr.square(a_t)
    bend = _third(u, p_inverse, a - move) + _third(v, q_inverse, a)
    b_s, b_t = solved(
        -dr.dot(bend, s) + 2 * push * k_s * a_s - second(s, n) * height,
        -dr.dot(bend, t) + 2 * push * k_t * a_t - second(t, n) * height,
    )
    half = 0.5 * (b_s * s + b_t * t + height * n)
    both = first + _limited(half, dr.norm(first))
    moved = dr.select(order == 0, 0, dr.select(order == 1, first, both))
    return dr.select(dr.isfinite(dr.squared_norm(moved)), moved, 0)
