"""Reflectance of the specular lobe of a material towards the viewer, in uniform light."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import drjit as dr
import mitsuba as mi

from gibench.rendering import flags
from gibench.rendering.lobes import lobes_of, sample_specular

SAMPLES = 64
"""Of the lobe, a power of two. A few per cent of a rough lobe's half vectors reflect below the horizon, which fewer
samples miss: 16 are 6 % too bright at GGX alpha 0.2, 64 are 2 %."""


GOLDEN_RATIO = 0.6180339887
"""Multiples of it fill [0, 1) evenly, and have nothing to do with the bits of the other two dimensions."""


@dr.syntax
def directional_albedo(layers, si, bsdf, active):
    """Mean of the specular lobe's sample weights at si.wi, mi.Color3f: the split sum's second factor.

    layers: `Scene.layers`. Exact for a mirror, whose only weight is its Fresnel reflectance. The samples are a
    Hammersley set, the same everywhere, so there is no noise; a third dimension chooses among lobes and blends.
    """
    total = mi.Color3f(0)
    sample = mi.UInt32(0)
    while active & (sample < SAMPLES):
        across = (mi.Float(sample) + 0.5) / SAMPLES
        down = mi.Float(dr.brev(sample)) * 2.0**-32 + 0.5 / SAMPLES
        turns = (mi.Float(sample) + 0.5) * GOLDEN_RATIO
        which = dr.minimum(turns - dr.floor(turns), dr.one_minus_epsilon(mi.Float))
        bounce, weight = _reflected(layers, bsdf, si, which, mi.Point2f(across, down), active)
        # What goes through shows something else than the mirror image.
        total += dr.select(bounce.wo.z * si.wi.z > 0, weight, 0)
        sample += 1
    return total / SAMPLES


def _reflected(layers, bsdf, si, sample1, sample2, active):
    """A sample of the lobes that reflect, and of the holes of masks, without which Mitsuba's masks count as whole.

    Of 64 samples of all lobes of glass all but one to three go through.
    """
    if layers.inseparable:
        return sample_specular(layers, bsdf, si, sample1, sample2, active)
    reflections = flags.NOT_DIFFUSE & ~flags.TRANSMITS
    return bsdf.sample(lobes_of(reflections | int(mi.BSDFFlags.Null)), si, sample1, sample2, active)
