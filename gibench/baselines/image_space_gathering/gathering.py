"""The cross-bilateral gather of a mirror image.

A glossy lobe blurs what a surface reflects in proportion to the distance from the surface to what is reflected. Seen
from the camera, the reflection lies behind the surface, at the sum of both distances, so a lobe of half angle θ blurs
it over tan θ · d_r / (d_c + d_r) times the focal length, in pixels. The gather runs along the surface's own pixels
alone, told apart by depth, normal and roughness (Robison and Shirley 2009).
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import drjit as dr
import mitsuba as mi

from gibench.baselines.image_space_gathering.pyramid import LEVELS, Pyramid

SEARCH_TAPS = 32
"""Points of the window in which the mean blur is taken."""

GOLDEN_ANGLE = 2.399963229728653
"""Radians between successive taps of a spiral that fills a disk evenly (Vogel 1979)."""

WIDEST = 1.2
"""Radians from the mirror direction beyond which a lobe is not followed: the tangent runs away there."""

PLANE_SHARE = 0.02
"""Distance of a neighbour from the tangent plane, as a share of the distance to the camera, at which its weight has
dropped to e^−½."""

NORMAL_ANGLE = 0.1
"""Radians between normals, likewise."""

ROUGHNESS_STEP = 0.05
"""Difference of GGX alpha, likewise."""


def lobe_angle(roughness, u):
    """Angle (radians) to the mirror direction that a share `u` of a GGX lobe lies within, at normal incidence.

    Of the half vectors a share u has tan² θ_h ≤ α² u / (1 − u) (Walter et al. 2007, equation 35); what is reflected
    turns by twice their angle. At most WIDEST.
    """
    return dr.minimum(2 * dr.atan(roughness * dr.sqrt(u / dr.maximum(1 - u, 1e-6))), WIDEST)


@dr.syntax
def _mean(pyramid: Pyramid, name: str, own, glossy, at, scale, distance, taps):
    """Mean of a part of the mirror image over a lobe.

    own: index of the ray; at: its place (mi.Point2f); scale: how many cells of the finest level a tangent of 1 is;
    distance: to the camera. Each tap stands for an equal share of the lobe and reads the mean over the area of its
    share, so that small lamps are neither missed nor multiplied.
    """
    image = pyramid.image
    values = getattr(image, name)
    position = dr.gather(mi.Point3f, image.position, own, glossy)
    normal = dr.gather(mi.Normal3f, image.normal, own, glossy)
    roughness = dr.gather(mi.Float, image.roughness, own, glossy)
    # The ray itself, with a weight that only matters where there is nothing else.
    total, weight = 1e-6 * dr.gather(type(values), values, own, glossy), mi.Float(1e-6)
    tap = mi.UInt32(0)
    inner = mi.Float(0)
    while glossy & (tap < taps):
        outer = scale * dr.tan(lobe_angle(roughness, mi.Float(tap + 1) / mi.Float(taps)))
        radius = scale * dr.tan(lobe_angle(roughness, (mi.Float(tap) + 0.5) / mi.Float(taps)))
        area = dr.pi * (dr.square(outer) - dr.square(inner))
        level = mi.UInt32(dr.clip(dr.round(0.5 * dr.log2(dr.maximum(area, 1))), 0, LEVELS - 1))
        angle = GOLDEN_ANGLE * mi.Float(tap)
        for index, near in pyramid.cells(level, at + radius * mi.Vector2f(dr.cos(angle), dr.sin(angle))):
            read = glossy & (near > 0)
            to_plane = dr.dot(normal, dr.gather(mi.Point3f, image.position, index, read) - position)
            turned = dr.gather(mi.Normal3f, image.normal, index, read)
            step = dr.gather(mi.Float, image.roughness, index, read) - roughness
            exponent = (
                dr.square(to_plane / (PLANE_SHARE * distance))
                + dr.squared_norm(turned - normal) / NORMAL_ANGLE**2
                + dr.square(step / ROUGHNESS_STEP)
            )
            coverage = dr.gather(mi.Float, image.coverage, index, read)
            similar = near * coverage * dr.exp(-0.5 * exponent)
            total += similar * dr.gather(type(values), values, index, read)
            weight += similar
        inner = outer
        tap += 1
    return total / weight


def gather(pyramid: Pyramid, scale, distance, taps):
    """The mirror image blurred by the lobe of each ray, mi.Color3f.

    scale: mi.Float, how many rays apart a tangent of 1 is on the image, at each ray: the focal length, or less where
    the lobe is narrower than at normal incidence. distance: mi.Float, to the camera (m). taps: mi.UInt32, opaque. A
    mirror's taps all fall on itself, so it stays as it is.
    """
    width, height = pyramid.layout.sizes[0]
    lane = dr.arange(mi.UInt32, width * height)
    columns = dr.opaque(mi.UInt32, width)
    row = lane // columns
    at = mi.Point2f(mi.Float(lane - row * columns) + 0.5, mi.Float(row) + 0.5)
    glossy = dr.gather(mi.Float, pyramid.image.coverage, lane) > 0
    # The mean of the blur first, over the lobe at its widest: beside the edge of something near that is reflected, the
    # far runs over it.
    search = dr.opaque(mi.UInt32, SEARCH_TAPS)
    blur = _mean(pyramid, "blur", lane, glossy, at, scale, distance, search)
    return _mean(pyramid, "radiance", lane, glossy, at, scale * blur, distance, taps)
