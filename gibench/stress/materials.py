"""Materials at the ends of their ranges: near-mirrors, nothing absorbed, everything absorbed, grazing views."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.datasets import exr
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from gibench.stress.answers import RAY_OFFSET, ggx_albedo, mean_check, not_finite, worst
from gibench.stress.registry import Check, Found, case
from gibench.stress.scenes import (
    area,
    closed_answer,
    closed_box,
    coat,
    constant,
    diffuse,
    metal,
    rectangle,
    rgb,
    two_sided,
)
from gibench.stress.views import INSIDE, POINT, SURFACE_SETS, seen, spot

ALPHAS = (1e-4, 1e-3, 1e-2)

COAT_INDEX = 1.5 / 1.000277
"""Of a coat of index 1.5 in air, which is what Mitsuba puts outside."""

GRAZING = 89.9
"""Degrees from the normal."""

QUADRATURE = "quadrature over GGX slopes in float64; noise"
SERIES = "sum of the series; noise"

COAT_ENERGY = (
    "Mitsuba's roughplastic loses it, and the mean weight of its own samples is as low: a white base comes out 2.2 % "
    "dark"
)


def floor_under_sky(bsdf: dict[str, Any]) -> Any:
    """A floor of 2 × 2 m under uniform light."""
    floor = rectangle([0, 0, 0], [0, 0, 1], (1, 1), bsdf=bsdf)
    return load_dict({"type": "scene", "sky": constant(1.0), "floor": floor})


def alpha_kept(scene: Any, alpha: float) -> Found:
    """Roughness as the G-buffer gives it and as a file keeps it."""
    frame = render_frame(scene, spot(45), resolution=(4, 4), channels=["surface"])
    roughness = frame.arrays["roughness"].astype(np.float64)
    stored = exr.decode(exr.encode({"roughness": frame.arrays["roughness"]}), widen=True)["roughness"]
    error = float(np.abs(roughness / alpha - 1).max())
    yield Check("surface", "roughness", error, 2.0**-23, "float32 holds alpha to its last bit")
    error = float(np.abs(stored / np.float64(alpha) - 1).max())
    yield Check("files", "roughness read again", error, exr.HALF_TOLERANCE, "the file's promise")


@case("metal, alpha {alpha:g}", alpha=ALPHAS, quick=(1e-4,))
def metal_in_uniform_light(alpha: float) -> Found:
    """Facets that absorb nothing reflect all but what one scattering loses."""
    scene = floor_under_sky(metal(alpha))
    checks = []
    for degrees in (0.1, 45, 80):
        answer = ggx_albedo(alpha, np.radians(degrees))
        checks.append(
            mean_check("light", "uniform light reflected", seen(scene, spot(degrees)), answer, QUADRATURE)
        )
    yield worst(checks)
    yield from alpha_kept(scene, alpha)
    yield split_sum(scene, alpha)


def split_sum(scene: Any, alpha: float) -> Check:
    """Factor of image space gathering for its blurred mirror image, against the quadrature."""
    import mitsuba as mi

    from gibench.baselines.first_hits import first_hits
    from gibench.baselines.image_space_gathering import reflectance

    checks = []
    for degrees in (0.1, 45, 80):
        hits = first_hits(scene, spot(degrees), (1, 1))
        share = mi.Color3f(reflectance.directional_albedo(scene.layers, hits.si, hits.bsdf, hits.active))
        error = abs(float(np.array(share)[0, 0]) / ggx_albedo(alpha, np.radians(degrees)) - 1)
        bound = 1 / reflectance.SAMPLES
        checks.append(Check("methods", "isg: directional albedo", error, bound, "one of its 64 samples"))
    return worst(checks)


@case("coat, alpha {alpha:g}", alpha=ALPHAS, quick=(1e-4,))
def coat_in_uniform_light(alpha: float) -> Found:
    """The coat alone reflects what its facets do; over a white base nothing is absorbed."""
    for base in (0.0, 1.0):
        scene = floor_under_sky(coat(alpha, base))
        checks = []
        for degrees in (0.1, 45, 80):
            mirrored = ggx_albedo(alpha, np.radians(degrees), index=COAT_INDEX)
            lost = 1 - ggx_albedo(alpha, np.radians(degrees))
            answer = mirrored if base == 0 else 1 - lost
            what = "uniform light reflected, black base" if base == 0 else "the same, white base"
            known = COAT_ENERGY if base else ""
            frame = seen(scene, spot(degrees))
            checks.append(mean_check("light", what, frame, answer, QUADRATURE, known=known))
        yield worst(checks)
    yield from alpha_kept(scene, alpha)


@case("grazing view at 89.9°, metal, alpha {alpha:g}", alpha=ALPHAS, quick=(1e-3,))
def grazing_metal(alpha: float) -> Found:
    """Half of the facets are hidden, and half of what the others reflect goes down."""
    frame = seen(floor_under_sky(metal(alpha)), spot(GRAZING))
    answer = ggx_albedo(alpha, np.radians(GRAZING))
    yield mean_check("light", "uniform light reflected", frame, answer, QUADRATURE)


@case("grazing view at 89.9°, coat, alpha {alpha:g}", alpha=ALPHAS)
def grazing_coat(alpha: float) -> Found:
    """The same facets of a dielectric, over a base that is black."""
    frame = seen(floor_under_sky(coat(alpha, 0.0)), spot(GRAZING))
    answer = ggx_albedo(alpha, np.radians(GRAZING), index=COAT_INDEX)
    yield mean_check("light", "uniform light reflected", frame, answer, QUADRATURE)


@case("grazing view at 89.9°, matt", quick=True)
def grazing_matt() -> Found:
    """A matt floor looks the same from everywhere."""
    scene = floor_under_sky(diffuse(0.5))
    yield mean_check(
        "light", "uniform light reflected", seen(scene, spot(GRAZING)), 0.5, "reflectance; noise"
    )
    frame = render_frame(scene, spot(GRAZING), resolution=(1, 1), channels=SURFACE_SETS)
    cosine = np.cos(np.radians(GRAZING))
    # The height of the ray is rounded at both ends, and meets the floor at this angle.
    bound = float(8 * 2.0**-24 / cosine)
    error = abs(float(frame.arrays["distance"].item()) / 4 - 1)
    yield Check("surface", "distance", error, bound, "rounding of float32 / cos 89.9°")
    error = float(np.abs(frame.arrays["normal"].ravel() - [0, 0, 1]).max())
    yield Check("surface", "normal (absolute)", error, 2.0**-22, "float32 of a unit vector")
    misses = float(frame.arrays["reflected_distance"].any())
    yield Check("surface", "mirror rays that hit the floor again", misses, 0, "the floor is flat")
    yield Check("surface", "values that are not finite", not_finite(frame.arrays), 0, "the contract")


@case("reflectance {reflectance:g}, closed, depth 64", reflectance=(0.0, 0.9999, 1.0), quick=(0.0, 1.0))
def closed_furnace(reflectance: float) -> Found:
    """A closed box that emits and reflects everywhere: the series, cut at depth 64, through Russian roulette."""
    scene = load_dict(closed_box(reflectance, 1.0))
    frame = seen(scene, INSIDE, max_depth=64)
    answer = closed_answer(reflectance, 1.0, 64)
    yield mean_check("light", "radiance", frame, answer, SERIES)
    once = seen(scene, INSIDE, max_depth=1)
    yield mean_check("light", "radiance at depth 1", once, 1 + reflectance, SERIES)
    lobes = sum(float(frame.arrays[name].max()) for name in ("direct_specular", "indirect_specular"))
    yield Check("light", "specular light of a matt box", lobes, 0, "a lobe that is not there is exactly 0")


@case("black walls", quick=True)
def black_walls() -> Found:
    """Nothing but the lamp itself is seen."""
    walls = closed_box(0.0, 0.0)
    for wall in walls.values():
        if isinstance(wall, dict):
            del wall["emitter"]
    lamp = rectangle([0, 0, 0.9], [0, 0, -1], (0.2, 0.2), bsdf=diffuse(0.0), emitter=area(7.0))
    frame = seen(load_dict({**walls, "lamp": lamp}), INSIDE, channels=["radiance", "surface"], spp=64)
    reflected = sum(float(frame.arrays[name].max()) for name in frame.arrays if "direct" in name)
    yield Check("light", "light that black walls reflect", reflected, 0, "exactly 0")
    yield Check("error bars", "of what has no noise", float(frame.arrays["color_se"].max()), 0, "exactly 0")
    yield Check("surface", "values that are not finite", not_finite(frame.arrays), 0, "the contract")


@case("mirror facing mirror, 40 reflections", quick=True)
def facing_mirrors() -> Found:
    """A ray climbs between two mirrors, at each of which it loses 2 %, until it comes out under the sky.

    It moves up 5 cm from one to the next, so it meets the mirrors, 4 m long around it, 40 times.
    """
    mirror = two_sided(type="conductor", material="none", specular_reflectance=rgb(0.98))
    scene = load_dict(
        {
            "type": "scene",
            "sky": constant(1.0),
            "left": rectangle([-0.5, 0, 0], [1, 0, 0], (2, 2), bsdf=mirror),
            "right": rectangle([0.5, 0, 0], [-1, 0, 0], (2, 2), bsdf=mirror),
        }
    )
    camera = PinholeCamera((0.0, 0.0, 0.0), (1.0, 0.05, 0.0), POINT)
    frame = seen(scene, camera, max_depth=64)
    yield mean_check("light", "radiance at the end", frame, 0.98**40, "0.98⁴⁰; noise")
    matt = float(frame.arrays["direct_diffuse"].max() + frame.arrays["indirect_diffuse"].max())
    yield Check("light", "diffuse light of mirrors", matt, 0, "a lobe that is not there is exactly 0")
    found = render_frame(scene, camera, resolution=(1, 1), channels=["reflection"]).arrays
    error = float(np.abs(found["reflected_position"].ravel() - [-0.5, 0.075, 0]).max())
    bound = RAY_OFFSET * 1.5 * 0.05 + 2.0**-21
    yield Check("surface", "where the mirror ray ends (m)", error, bound, "unfolded; offset of rays at 5 %")


@case("lamp in a near-mirror, alpha {alpha:g}", alpha=ALPHAS, quick=(1e-4,))
def lamp_in_near_mirror(alpha: float) -> Found:
    """Sampling the lamp finds the lobe once in ten million; sampling the lobe finds the lamp always.

    The lamp is so near that what the lobe's tail misses is below (alpha / 0.2)².
    """
    lamp = rectangle([0, 0.5, 0.5], [0, -1, -1], (0.5, 0.5), bsdf=diffuse(0.0), emitter=area(5.0))
    floor = rectangle([0, 0, 0], [0, 0, 1], (1, 1), bsdf=metal(alpha))
    frame = seen(load_dict({"type": "scene", "lamp": lamp, "floor": floor}), spot(45), max_depth=1)
    check = mean_check("light", "radiance of the image", frame, 5.0, "")
    bound = check.bound + (alpha / 0.2) ** 2 + 1 - ggx_albedo(alpha, np.radians(45))
    yield Check("light", check.what, check.error, bound, "the lamp's own radiance; the lobe's tail; noise")
