"""The reflection search of Guo et al. 2022 ("Efficient Light Probes for Real-time Global Illumination"), section 4.3.

A pixel sees z mirrored at x. A probe at p sees z mirrored at another point of that surface, and light that leaves the
two points is alike. The search walks over the surface as the camera sees it: the tangent plane at the current point
is a mirror with a virtual image z′ behind it; where the line from p to z′ meets the plane lies the next candidate.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.baselines.probes.maps import Probes
from gibench.rendering.replay import ray_generator

CONFIDENT = 0.999
"""Confidence at which a search ends, T_max (section 5)."""

DECAY = 100.0
"""Of a probe's weight with its lack of confidence, τ (section 5)."""

SHORTER = 0.5
"""Of a step that leads to another material or to a lower confidence. The paper gives no factor."""

WITHIN = 0.999
"""Of the way to the border of the screen, for a step that would leave it."""

SHORTEST = 0.5
"""Sizes of a pixel below which a step that leads nowhere is not halved any more: the screen has nothing in between."""

LONGER = 2.0
"""Of the step after one that has been taken, up to the whole."""

GRAZING = 1e-4
"""Cosine between a ray and a plane below which they do not meet."""

EDGE_ON = 0.05
"""Cosine of the angle of view down to which a pixel's tangent plane stands for its surface."""

HIDDEN = 4.0
"""Taken from the confidence of a probe that reflects something else; more than any two can differ by."""

NONE = -2.0
"""Confidence of a probe that cannot see the reflection; those that can have it in [−1, 1]."""


@dataclass
class Screen:
    """G-buffer of the camera, a lane a camera ray in row order.

    position: mi.Point3f, m. normal: unit mi.Vector3f, towards the viewer. material: mi.UInt32, 0 on a miss. width,
    height: mi.Int32 of one lane. camera: from `replay.camera_arrays`, of a grid of that size.
    """

    position: Any
    normal: Any
    material: Any
    camera: dict[str, Any]
    width: Any
    height: Any

    def seen_at(self, point: Any, active: Any) -> tuple[Any, Any, Any, Any]:
        """G-buffer in the direction of points: position, normal, material and whether it is on the screen.

        The position lies where the camera ray through the point meets the tangent plane of the pixel that it falls
        into: on a plane it is the point itself, not the centre of a pixel.
        """
        camera = ray_generator(self.camera)
        origin, offset = camera.origin, point - camera.origin
        at, depth = camera.project(point)
        inside = active & (depth > 0) & (at.x >= 0) & (at.y >= 0) & (at.x < self.width) & (at.y < self.height)
        column, row = mi.Int32(dr.select(inside, at.x, 0)), mi.Int32(dr.select(inside, at.y, 0))
        lane = mi.UInt32(row * self.width + column)
        position = dr.gather(mi.Point3f, self.position, lane, inside)
        normal = dr.gather(mi.Vector3f, self.normal, lane, inside)
        material = dr.gather(mi.UInt32, self.material, lane, inside)
        slope = dr.dot(offset, normal)
        along = dr.dot(position - origin, normal) / dr.select(slope == 0, 1, slope)
        on_plane = origin + along * offset
        # Seen from the side, the plane leaves the pixel's own surface far behind.
        cosine = dr.maximum(dr.abs(slope) / dr.maximum(dr.norm(offset), 1e-20), EDGE_ON)
        pixel = depth * camera.scale / cosine
        near = (slope != 0) & (dr.norm(on_plane - position) <= 2 * pixel)
        return dr.select(near, on_plane, position), normal, material, inside

    def share_within(self, point: Any, step: Any) -> Any:
        """Share of a step (mi.Vector3f) from a point on the screen that stays on it, mi.Float in [0, 1]."""
        camera = ray_generator(self.camera)
        (right, down, depth), (move_right, move_down, move_depth) = (
            [dr.dot(axis, vector) for axis in camera.axes] for vector in (point - camera.origin, step)
        )
        result = mi.Float(1)
        # Distances to the four planes through the eye and the sides of the screen, and how fast they change.
        for size, before, at, move in (
            (mi.Float(self.width), camera.centre.x, right, move_right),
            (mi.Float(self.height), camera.centre.y, down, move_down),
        ):
            for side, pixels in ((-1.0, size - before), (1.0, before)):
                reach = pixels * camera.scale
                left, change = reach * depth + side * at, reach * move_depth + side * move
                share = WITHIN * dr.maximum(left, 0) / dr.select(change < 0, -change, 1)
                result = dr.select(change < 0, dr.minimum(result, share), result)
        return result

    def pixel(self, point: Any) -> Any:
        """Size of a pixel at points, mi.Float, m."""
        camera = ray_generator(self.camera)
        return camera.scale * dr.norm(point - camera.origin)


@dataclass
class Reflected:
    """Target of the search: mi.Point3f, m, or a unit direction where a mirror ray leaves the scene (`far`, mi.Bool)."""

    target: Any
    far: Any

    def direction(self, point: Any) -> Any:
        """Unit mi.Vector3f from points towards the reflected point."""
        return dr.select(self.far, mi.Vector3f(self.target), dr.normalize(self.target - point))


def mirror_point(probe: Any, reflected: Reflected, point: Any, normal: Any) -> tuple[Any, Any]:
    """Point of a plane that mirrors the reflected point to a probe: mi.Point3f, and whether it does (mi.Bool).

    probe: mi.Point3f. The plane goes through `point`; probe and what is reflected must lie on the side of its normal.
    """
    above = dr.dot(probe - point, normal)
    target = mi.Vector3f(reflected.target)
    height = dr.select(reflected.far, dr.dot(target, normal), dr.dot(reflected.target - point, normal))
    image = target - 2 * height * normal
    towards = dr.select(reflected.far, image, image - probe)
    fall = -dr.dot(towards, normal)
    meets = (above > 0) & (height > 0) & (fall > GRAZING * dr.norm(towards))
    return probe + dr.select(meets, above / fall, 0) * towards, meets


def confidence(probe: Any, reflected: Reflected, point: Any, normal: Any) -> Any:
    """Cosine between the normal and the half vector of probe and what is reflected (equation 3), mi.Float in [−1, 1].

    1 where the surface mirrors the one to the other; NONE where the probe lies behind it.
    """
    to_probe = probe - point
    half = dr.normalize(to_probe) + reflected.direction(point)
    length = dr.norm(half)
    value = dr.dot(half, normal) / dr.select(length > 0, length, 1)
    front = (dr.dot(to_probe, normal) > 0) & (length > 0)
    return dr.select(front, dr.clip(value, -1, 1), NONE)


@dr.syntax
def search(
    screen: Screen,
    probe: Any,
    reflected: Reflected,
    start: Any,
    normal: Any,
    material: Any,
    steps: Any,
    active: Any,
):
    """The point of the surface that mirrors what is reflected to a probe, as far as the camera sees it.

    probe: mi.Point3f. start, normal, material: of each lane's own pixel. steps: mi.UInt32, N_max. Returns the best
    point that was met, its confidence and the steps that were made; points stay on the screen and on the material.
    """
    point, facing = mi.Point3f(start), mi.Vector3f(normal)
    value = confidence(probe, reflected, start, normal)
    share = mi.Float(1)
    done = mi.UInt32(0)
    searching = mi.Bool(active)

    while searching & (done < steps):
        mirrored, meets = mirror_point(probe, reflected, point, facing)
        step = share * (mirrored - point)
        step *= screen.share_within(point, step)
        candidate = point + step
        seen, seen_normal, seen_material, inside = screen.seen_at(candidate, meets)
        there = confidence(probe, reflected, seen, seen_normal)
        holds = inside & (seen_material == material) & (there > value)
        point = dr.select(holds, seen, point)
        facing = dr.select(holds, seen_normal, facing)
        value = dr.select(holds, there, value)
        share = dr.select(holds, dr.minimum(LONGER * share, 1), share * SHORTER)
        done += 1
        # Without a mirror image in the tangent plane there is nowhere to go.
        searching &= meets & (value < CONFIDENT)
        searching &= holds | (dr.norm(step) > SHORTEST * screen.pixel(point))

    return point, value, done


def looked_up(
    probes: Probes, probe: Any, towards: Any, reflected: Reflected, material: Any, tolerance: Any, active: Any
) -> tuple[Any, Any]:
    """Glossy radiance that probes (mi.UInt32) hold along directions, mi.Color3f, and whether it is the one to be found.

    Mixed from those of the four texels around the direction that show the same material: all others hold light of
    another surface, which would darken whatever is as thin as a texel. It is the one if they reflect, in the mean or
    one of them, what lies within `tolerance` (m) of what is reflected. Positions move from texel to texel by more
    than that where what is reflected is far away, but on a plane nearly linearly; across an edge the mean lies on
    neither side.
    """
    color, place, total = mi.Color3f(0), mi.Point3f(0), mi.Float(0)
    near = mi.Bool(False)
    for texel, weight in probes.corners(probe, towards):
        same = active & (probes.fetch("material_id", texel, active) == material)
        share = dr.select(same, weight, 0)
        missed = probes.fetch("reflected_material_id", texel, same) == 0
        there = mi.Point3f(probes.fetch("reflected_position", texel, same))
        near |= same & (missed == reflected.far) & (missed | (dr.norm(there - reflected.target) <= tolerance))
        color += share * mi.Color3f(probes.fetch("radiance", texel, same))
        place += share * there
        total += share
    inverse = dr.select(total > 0, dr.rcp(total), 0)
    near |= ~reflected.far & (dr.norm(place * inverse - reflected.target) <= tolerance)
    return color * inverse, near & (total > 0)


@dr.syntax
def blended(
    probes: Probes,
    candidates: Any,
    number: Any,
    screen: Screen,
    reflected: Reflected,
    steps: Any,
    tolerance: Any,
    active: Any,
):
    """Glossy radiance, mi.Color3f, from the points that searches find in several probes (equation 4).

    candidates: mi.UInt32, of which the first `number` (mi.UInt32) are searched. steps: mi.UInt32. tolerance: m. Probes
    that do not reflect the same thing there count only where none does. Returns the radiance and the steps of all
    searches.
    """
    color, total = mi.Color3f(0), mi.Float(0)
    top = mi.Float(2 * NONE)
    made = mi.UInt32(0)
    index = mi.UInt32(0)
    start = mi.Point3f(screen.position)
    normal = mi.Vector3f(screen.normal)
    material = mi.UInt32(screen.material)

    while index < number:
        probe = dr.gather(mi.UInt32, candidates, index)
        centre = probes.position(probe)
        point, value, done = search(screen, centre, reflected, start, normal, material, steps, active)
        towards = point - centre
        radiance, visible = looked_up(probes, probe, towards, reflected, material, tolerance, active)
        # Below all that do, whatever their confidence.
        value = dr.select(visible, value, value - HIDDEN)
        # Weights relative to the best so far: the exponentials of all others may underflow, its own is 1.
        highest = dr.maximum(top, value)
        kept, added = dr.exp(DECAY * (top - highest)), dr.exp(DECAY * (value - highest))
        color = color * kept + radiance * added
        total = total * kept + added
        top = highest
        made += done
        index += 1

    return dr.select(total > 0, color / total, 0), made
