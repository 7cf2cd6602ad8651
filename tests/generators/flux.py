"""The flux that leaves a scene of lamps, as rays from around it see it."""

from __future__ import annotations

import math

import numpy as np

from gibench.generators.light import LUMENS_PER_WATT

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def lumens_around(scene, middle, radius: float, count: int) -> float:
    """Lumens that pass through a sphere from within, without what anything reflects.

    Positions are uniform on the sphere, directions inward in proportion to the cosine: flux = 4πR² · π · mean radiance.
    """
    import mitsuba as mi

    rng = np.random.default_rng(0)
    outward = rng.standard_normal((3, count))
    outward /= np.linalg.norm(outward, axis=0)
    inward = rng.standard_normal((3, count))
    inward = inward / np.linalg.norm(inward, axis=0) - outward
    inward /= np.linalg.norm(inward, axis=0)
    origin = (np.asarray(middle)[:, None] + radius * outward).astype(np.float32)
    hit = scene.ray_intersect(mi.Ray3f(mi.Point3f(origin), mi.Vector3f(inward.astype(np.float32))))
    emitted = np.array(hit.emitter(scene).eval(hit, hit.is_valid())).mean(1)
    return float(4 * math.pi * radius**2 * math.pi * LUMENS_PER_WATT * (LUMINANCE @ emitted))
