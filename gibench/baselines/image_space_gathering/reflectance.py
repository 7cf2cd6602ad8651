"""How much of uniform light the specular lobe of a material reflects towards the viewer."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import drjit as dr
import mitsuba as mi

from gibench.rendering.integrator import NOT_DIFFUSE

SAMPLES = 64
"""Of the lobe, a power of two. A few per cent of a rough lobe's half vectors reflect below the horizon, which fewer
samples miss: 16 are 6 % too bright at GGX alpha 0.2, 64 are 2 %."""


def specular_context():
    """Evaluate everything but the diffuse lobe."""
    return mi.BSDFContext(mi.TransportMode.Radiance, NOT_DIFFUSE)


@dr.syntax
def directional_albedo(si, bsdf, active):
    """Mean of the specular lobe's sample weights at si.wi, mi.Color3f: the split sum's second factor.

    Exact for a mirror, whose only weight is its Fresnel reflectance. The samples are a Hammersley set, the same
    everywhere, so there is no noise.
    """
    context = specular_context()
    total = mi.Color3f(0)
    sample = mi.UInt32(0)
    while active & (sample < SAMPLES):
        across = (mi.Float(sample) + 0.5) / SAMPLES
        down = mi.Float(dr.brev(sample)) * 2.0**-32 + 0.5 / SAMPLES
        _, weight = bsdf.sample(context, si, mi.Float(0.5), mi.Point2f(across, down), active)
        total += weight
        sample += 1
    return total / SAMPLES
