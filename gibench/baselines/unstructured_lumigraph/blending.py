"""Unstructured lumigraph rendering (Buehler et al. 2001): at each point the probes that see it best are blended.

The papers' baseline (Rodriguez et al. 2020, section 7.3.1; Guo et al. 2022, section 5): the probes are the cameras, the
scene's own geometry is the proxy, and weights are found at every pixel. It is right for light that a surface sends into
all directions alike; what a glossy surface sends depends on the direction, so reflections stick to their surface.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.baselines.method import Setting
from gibench.baselines.probes.deferred import ProbeLookup
from gibench.baselines.probes.maps import Probes

BLENDED = 4
"""Probes that are blended, k in section 4.1 of Buehler et al."""

RESOLUTION_WEIGHT = 0.1
"""Of the resolution penalty against the angle, in radians."""

LEAST_RESOLUTION = 1e-4
"""Of the resolution penalty: a probe that is nearer than the camera is no better for it."""

DEPTH_TOLERANCE = 1e-2
"""Relative difference of distance up to which a probe sees a point."""

HIDDEN = 10.0
"""Added to the penalty of a probe that does not see the point; above any sum of angle and resolution."""


def penalty(point: Any, probe: Any, camera: Any) -> Any:
    """Difference between a probe's view of a point and the camera's: mi.Float > 0. Arguments: mi.Point3f.

    The angle between the two at the point, radians, and how much farther away the probe is than the camera (sections
    4.1 and 4.2 of Buehler et al.).
    """
    to_probe, to_camera = probe - point, camera - point
    angle = dr.atan2(dr.norm(dr.cross(to_probe, to_camera)), dr.dot(to_probe, to_camera))
    distance = dr.maximum(dr.norm(to_probe), 1e-6)
    resolution = (distance - dr.norm(to_camera)) / distance
    return angle + RESOLUTION_WEIGHT * dr.maximum(resolution, LEAST_RESOLUTION)


def weights(penalties: list[Any]) -> list[Any]:
    """Weights of the BLENDED best, which sum to 1, from the penalties of those and of the next, in ascending order.

    (1 − p/p₅)/p: a probe comes in with weight 0 as it overtakes another, and one where the camera is counts alone. A
    probe that does not see the point counts only where none does.
    """
    lost = penalties[0] >= HIDDEN
    p = [value - dr.select(lost, HIDDEN, 0) for value in penalties]
    # Above 0 even where all five are equal.
    shares = [dr.maximum(1 - value / p[-1], 1e-6) * dr.rcp(value) for value in p[:-1]]
    shares = [dr.select(value < HIDDEN, share, 0) for value, share in zip(p, shares, strict=False)]
    total = sum(shares)
    return [share / total for share in shares]


def sees(probes: Probes, probe: Any, point: Any, active: Any) -> Any:
    """Whether probes (mi.UInt32) have points (mi.Point3f) where their maps of distances say that something is.

    The inverse distance is interpolated, since that is linear on a plane; the distance itself differs from texel
    to texel by far more than the tolerance where a floor is seen at a flat angle. A miss counts as infinitely far.
    """
    offset = point - probes.position(probe)
    inverse = mi.Float(0)
    for texel, weight in probes.corners(probe, offset):
        stored = probes.fetch("distance", texel, active)
        inverse += dr.select(stored > 0, weight * dr.rcp(stored), 0)
    return dr.abs(dr.norm(offset) * inverse - 1) <= DEPTH_TOLERANCE


@dr.syntax
def best_probes(
    probes: Probes, candidates: Any, number: Any, point: Any, camera: Any, active: Any
) -> tuple[list[Any], list[Any]]:
    """Penalties of the BLENDED + 1 best candidates in ascending order, and which probes they are.

    candidates: mi.UInt32, of which the first `number` (mi.UInt32 of one lane) are weighed at every point.
    """
    penalties = [mi.Float(2 * HIDDEN) for _ in range(BLENDED + 1)]
    best = [mi.UInt32(0) for _ in range(BLENDED + 1)]
    index = mi.UInt32(0)
    while index < number:
        probe = dr.gather(mi.UInt32, candidates, index)
        value = penalty(point, probes.position(probe), camera)
        value += dr.select(sees(probes, probe, point, active), 0, HIDDEN)
        for k in range(BLENDED + 1):
            closer = value < penalties[k]
            value, penalties[k] = (
                dr.select(closer, penalties[k], value),
                dr.select(closer, value, penalties[k]),
            )
            probe, best[k] = dr.select(closer, best[k], probe), dr.select(closer, probe, best[k])
        index += 1
    return penalties, best


class UnstructuredLumigraph(ProbeLookup):
    """Method `ulr`."""

    maps = ("radiance", "distance")

    @staticmethod
    def glossy(probes: Probes, point: Any, camera: Any, active: Any, settings: Mapping[str, Setting]) -> Any:
        """The blend of the best probes among those nearest to the camera."""
        count = min(int(settings["candidates"]), probes.count)
        candidates = dr.concat(probes.nearest(camera, count))
        dr.eval(candidates)  # one search a frame, not one a point
        number = dr.opaque(mi.UInt32, count)
        penalties, best = best_probes(probes, candidates, number, point, camera, active)
        color = mi.Color3f(0)
        for probe, weight in zip(best, weights(penalties), strict=False):
            used = active & (weight > 0)
            found = probes.bilinear("radiance", probe, point - probes.position(probe), used)
            color += weight * mi.Color3f(found)
        return color
