"""The second step of the convolution: a Gaussian of its own shape at every pixel, kept within a surface.

Rodriguez et al. 2020, sections 6.2 and 6.3: equation 4, split into four passes along lines, the first and the third
along the first principal direction of the covariance, the others along the second, each with half of the variance.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.baselines.glossy_probe_reprojection.footprint import Covariance

ALIKE = 0.8
"""Cosine of the angle between normals above which pixels may mix, α_n (section 6.2)."""

DEPTH = 0.2
"""Metres between depths below which they may, α_d (section 6.2)."""

PASSES = 4
"""Along lines; two of them along each principal direction."""

REACH = 2.5
"""Standard deviations that a pass looks to either side."""

SMALL = 0.25
"""Pixels of standard deviation below which a pass leaves a pixel as it is."""


@dataclass
class Guides:
    """Features of pixels that keep them apart, a lane a pixel in row order.

    normal: unit mi.Vector3f. depth: mi.Float, m. material: mi.UInt32. width, height: mi.Int32 of one lane. unit:
    mi.Float of one lane, metres that count as one.
    """

    normal: Any
    depth: Any
    material: Any
    width: Any
    height: Any
    unit: Any


@dr.syntax
def _line(
    color: Any,
    weight: Any,
    guides: Guides,
    direction: Any,
    deviation: Any,
    taps: Any,
    again: Any,
    active: Any,
):
    """Mean of the pixels along a line through each, mi.Color3f.

    color, weight: evaluated, of all pixels. direction: unit mi.Vector2f. deviation: mi.Float, pixels. taps: mi.UInt32,
    to either side about, at most; of wider lines every second pixel is read, or every third, and so on. again: mi.Bool
    of one lane, whether this is the second pass along the line: it takes longer strides, since two of the same length
    would leave copies of whatever is small. Samples between pixels are bilinear: lines at 45° would otherwise never
    leave the one half of the pixels that they begin in.
    """
    lane = dr.arange(mi.UInt32, dr.width(color))
    row = mi.Int32(lane) // guides.width
    column = mi.Int32(lane) - row * guides.width
    reach = REACH * deviation
    stride = dr.maximum(dr.ceil(reach / mi.Float(taps)), 1)
    stride = dr.select(again & (stride > 1), stride + 1, stride)
    count = dr.select(active & (deviation > SMALL), mi.Int32(dr.ceil(reach / stride)), 0)
    falloff = -0.5 * dr.rcp(dr.square(dr.maximum(deviation, 1e-6)))

    normal = dr.gather(mi.Vector3f, guides.normal, lane)
    depth = dr.gather(mi.Float, guides.depth, lane)
    material = dr.gather(mi.UInt32, guides.material, lane)
    own = dr.gather(mi.Float, weight, lane)
    before = dr.gather(mi.Color3f, color, lane)
    total = own
    result = own * before
    k = -count
    while k <= count:
        offset = mi.Float(k) * stride
        place = offset * direction
        low = dr.floor(place)
        part = place - low
        near = dr.select(k != 0, dr.exp(falloff * dr.square(offset)), 0)
        for i in range(2):
            for j in range(2):
                x, y = column + mi.Int32(low.x) + i, row + mi.Int32(low.y) + j
                share = near * (part.x if i else 1 - part.x) * (part.y if j else 1 - part.y)
                inside = (share > 0) & (x >= 0) & (x < guides.width) & (y >= 0) & (y < guides.height)
                at = mi.UInt32(dr.select(inside, y * guides.width + x, 0))
                inside &= dr.gather(mi.UInt32, guides.material, at, inside) == material
                apart = dr.abs(dr.gather(mi.Float, guides.depth, at, inside) - depth)
                inside &= apart < DEPTH * guides.unit
                inside &= dr.dot(dr.gather(mi.Vector3f, guides.normal, at, inside), normal) > ALIKE
                share = dr.select(inside, share * dr.gather(mi.Float, weight, at, inside), 0)
                result += share * dr.gather(mi.Color3f, color, at, inside)
                total += share
        k += 1
    return dr.select(total > 0, result / dr.select(total > 0, total, 1), before)


def filtered(color: Any, weight: Any, guides: Guides, covariance: Covariance, taps: Any, active: Any) -> Any:
    """Glossy light after the filter of equation 4, mi.Color3f, evaluated.

    color: before it, mi.Color3f. weight: how far to trust each pixel, 1 / E, mi.Float ≥ 0; where it is 0, only
    others count. covariance: of the Gaussian at each pixel, pixels². taps: mi.UInt32 of one lane.
    """
    first, second, direction = covariance.principal()
    turned = mi.Vector2f(-direction.y, direction.x)
    share = 2 / PASSES
    lines = [(direction, dr.sqrt(first * share)), (turned, dr.sqrt(second * share))]
    dr.eval(color, weight, guides, lines)
    for number in range(PASSES):
        again = dr.opaque(mi.Bool, number >= PASSES // 2)
        color = _line(color, weight, guides, *lines[number % 2], taps, again, active)
        dr.eval(color)
    return color
