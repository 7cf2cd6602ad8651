"""Glossy surfaces of a frame and their mirror hits, for methods that search probes for reflections."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.baselines.first_hits import FirstHits
from gibench.rendering.gbuffer import mirror_direction
from gibench.rendering.scene import Scene


def surfaces_of(scene: Scene, hits: FirstHits) -> dict[str, Any]:
    """By name, a lane a camera ray: "glossy", "position" (m), "normal" towards the viewer, "material"; 0 on a miss."""
    return {
        "glossy": hits.glossy,
        "position": dr.select(hits.active, mi.Point3f(hits.si.p), 0),
        "normal": hits.normal,
        "material": scene.material_ids(hits.bsdf, hits.active),
    }


@dataclass
class Mirrored:
    """Mirror hits of hits.

    ray: mi.Ray3f. found: mi.PreliminaryIntersection3f. far: mi.Bool, whether that is nothing. target: mi.Point3f, m, or
    the direction of the ray where it is.
    """

    ray: Any
    found: Any
    far: Any
    target: Any


def mirrored_by(scene: Scene, hits: FirstHits, active: Any) -> Mirrored:
    """Trace the mirror rays of hits."""
    ray = hits.si.spawn_ray(mirror_direction(hits.si, hits.ray.d))
    found = scene.mi_scene.ray_intersect_preliminary(ray, coherent=False, active=active)
    far = ~found.is_valid()
    return Mirrored(ray, found, far, dr.select(far, mi.Point3f(ray.d), ray(dr.select(far, 0, found.t))))
