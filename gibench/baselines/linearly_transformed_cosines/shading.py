"""Direct light of a rectangle: in closed form without shadows, times a ratio of samples with and without them.

Heitz et al. 2018 ("Combining Analytic Direct Illumination and Stochastic Shadows"). The samples of the denominator are
of the closed form that they divide, those of the numerator of the scene's own material: so the ratio also mends what a
transformed cosine, or Fresnel's equations by Schlick, leaves out. Both are filtered with the same weights.

Perfect mirrors and what lets light through have no lobe for a cosine to be: their samples follow a ray.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.baselines.first_hits import FirstHits, hits_of_rays
from gibench.baselines.linearly_transformed_cosines.polygons import above_horizon, irradiance_vector
from gibench.baselines.linearly_transformed_cosines.rectangle import Receiver, cosine_density
from gibench.baselines.linearly_transformed_cosines.table import TransformTable
from gibench.rendering import surface
from gibench.rendering.light_cues import ALPHAS
from gibench.rendering.light_sampling import emission, inverse
from gibench.rendering.lobes import diffuse_lobe, sample_specular, split
from gibench.rendering.replay import ray_generator
from gibench.rendering.scene import Scene

FOLLOWED = int(
    mi.BSDFFlags.Delta
    | mi.BSDFFlags.Null
    | mi.BSDFFlags.GlossyTransmission
    | mi.BSDFFlags.DiffuseTransmission
)
"""Lobes for which a ray is followed."""

DARK = 1e-4
"""Of the light in closed form: where samples found less of it, they are no measure, and the ratio is 1."""

SMALLEST = 1e-36
"""Of such sums, whose inverse a float still holds."""

LARGEST_RATIO = 4.0
"""Of a filtered ratio: where samples of the closed form found almost nothing, they are no measure."""

GOLDEN = 0.6180339887498949

REACH, WIDEST = 4, 2.0
"""Pixels to each side that are filtered, and standard deviation of the filter where samples disagree most."""


def luminance(color: Any) -> Any:
    """Of a mi.Color3f, linear Rec. 709."""
    return sum(weight * part for weight, part in zip(surface.LUMINANCE, color, strict=True))


@dataclass
class Surfaces:
    """First hits, ready to be lit.

    roughness: GGX alpha, mi.Float. f0: reflectance at normal incidence, mi.Color3f. followed: whether what is not
    diffuse is left to rays. plain: whether the material is a diffuse one.
    """

    hits: FirstHits
    receiver: Receiver
    roughness: Any
    f0: Any
    followed: Any
    plain: Any

    @staticmethod
    def of(scene: Scene, hits: FirstHits, light: dict[str, Any]) -> Surfaces:
        """light: `light_arrays`."""
        flags, si = hits.bsdf.flags(), hits.si
        followed = hits.glossy & ((flags & FOLLOWED) != 0)
        # A material that is not there on this side reflects nothing.
        shows = (si.wi.z > 0) | mi.has_flag(flags, mi.BSDFFlags.BackSide)
        glossy = hits.glossy & ~followed & shows
        return Surfaces(
            hits,
            Receiver(si, light),
            surface.roughness(scene, hits.bsdf, si, hits.active),
            dr.select(glossy, surface.specular_albedo(scene, hits.bsdf, si, hits.active), 0),
            followed,
            hits.active & ~hits.glossy,
        )


def unshadowed(scene: Scene, table: TransformTable, light, camera, cues: bool, width: int, height: int):
    """Light in closed form, and what is needed to shadow it.

    cues: whether also for the basis materials of `light_cues`. Returns the preliminary hits; what is emitted
    (mi.Color3f); by lobe ("diffuse", "specular", and the bases by number) the colour, mi.Color3f in units of the
    light's radiance, and the luminance that a sample's cosine is multiplied by, mi.Float; and guides of the filter.
    """
    hits = hits_of_rays(scene, ray_generator(camera), (width, height))
    seen = Surfaces.of(scene, hits, light)
    receiver = seen.receiver
    above = above_horizon(receiver.edges)
    vector = irradiance_vector(above)
    length = dr.norm(vector)
    lit = hits.active & receiver.lit & (length > 0)
    mean = dr.select(lit, vector / dr.select(lit, length, 1), mi.Vector3f(0, 0, 1))
    matt = diffuse_lobe(scene.layers, hits.bsdf, hits.si, receiver.for_bsdf(mean), lit)
    matt = dr.select(lit & (mean.z > 0), matt * inverse(mean.z), 0)
    irradiance = receiver.form_factor(above)

    def glossy(alpha: Any, f0: Any) -> tuple[Any, Any]:
        transform = table.transform(alpha, receiver.view.z)
        reflected = dr.clip(f0 * transform.share + (1 - f0) * transform.grazing, 0, 1)
        reflected = dr.select(lit & (dr.max(f0) > 0), reflected, 0)
        return reflected * receiver.form_factor(above, transform), luminance(reflected)

    lobes = {
        "diffuse": (matt * (dr.pi * irradiance), luminance(matt)),
        "specular": glossy(seen.roughness, seen.f0),
    }
    if cues:
        white = dr.select(lit & ~seen.plain, mi.Color3f(1), 0)
        lobes["0"] = (white * irradiance, luminance(white) * dr.inv_pi)
        for number, alpha in enumerate(ALPHAS, 1):
            lobes[str(number)] = glossy(mi.Float(alpha), white)
    guides = {
        "position": hits.si.p,
        "normal": hits.normal,
        "active": hits.active,
        "distance": hits.si.t,
        "plain": seen.plain,
    }
    result = hits.preliminary, hits.emission, lobes, guides
    dr.eval(result)
    return result


def sampled(
    scene: Scene,
    table: TransformTable,
    light,
    camera,
    preliminary,
    models,
    seed,
    spp: int,
    width: int,
    height: int,
):
    """Samples of a frame, added up by pixel: lobe → those with and without shadows, mi.Float each.

    models: luminances by lobe, from `unshadowed`. Returns also how much the samples of a pixel disagree on whether they
    see the light, mi.Float in [0, 1], and what rays have found, mi.Color3f in W·m⁻²·sr⁻¹.
    """
    lane = dr.arange(mi.UInt32, width * height * spp)
    pixel, number = lane // spp, lane % spp
    preliminary = dr.gather(mi.PreliminaryIntersection3f, preliminary, pixel)
    columns = dr.opaque(mi.UInt32, width)
    row = pixel // columns
    ray = ray_generator(camera).rays(mi.Point2f(mi.Float(pixel - row * columns) + 0.5, mi.Float(row) + 0.5))
    si = preliminary.compute_surface_interaction(ray, mi.RayFlags.All)
    active = si.is_valid()
    hits = FirstHits((width, height), ray, preliminary, si, si.bsdf(ray), active, None)
    seen = Surfaces.of(scene, hits, light)
    receiver = seen.receiver

    # One shifted lattice a pixel: its points are as far apart as so few can be.
    shift = mi.Point2f(mi.sample_tea_float32(pixel, seed), mi.sample_tea_float32(pixel, seed + 1))
    order = mi.Float(number)
    u = mi.Point2f(shift.x + order * (1 / spp), shift.y + order * GOLDEN)
    u -= dr.floor(u)
    choice = mi.sample_tea_float32(lane, seed + 2)

    # Every other sample of a glossy surface is drawn from its lobe, which a broad light fills and a mirror needs.
    by_lobe = hits.glossy & ~seen.followed & (number % 2 == 1)
    point, direction = receiver.drawn(u)
    bounce, _ = hits.bsdf.sample(mi.BSDFContext(), si, choice, u, active & by_lobe)
    onward = si.to_world(bounce.wo)
    there, meets = receiver.met(onward)
    by_lobe_hits = by_lobe & meets & (bounce.pdf > 0)
    point = dr.select(by_lobe, there, point)
    direction = dr.select(by_lobe, receiver.turned(onward), direction)
    found = active & receiver.lit & (direction.z > 0) & (by_lobe_hits | ~by_lobe)
    wo = receiver.for_bsdf(direction)

    drawn_lobes = dr.select(hits.glossy & ~seen.followed, mi.Float(spp // 2), 0)
    density = (spp - drawn_lobes) * receiver.density(point)
    density += drawn_lobes * hits.bsdf.pdf(mi.BSDFContext(), si, wo, found & (drawn_lobes > 0))
    weight = dr.select(found & (density > 0), inverse(density), 0)
    shadow = scene.mi_scene.ray_test(si.spawn_ray_to(point), found)
    visible = dr.select(found & ~shadow, weight, 0)

    whole = hits.bsdf.eval(mi.BSDFContext(), si, wo, found)
    matt, rest = split(hits.bsdf, whole, diffuse_lobe(scene.layers, hits.bsdf, si, wo, found))
    sums = {}
    for name, model in models.items():
        scale = dr.gather(mi.Float, model, pixel)
        if name in ("diffuse", "0"):
            expected = scale * dr.maximum(direction.z, 0)
            value = luminance(matt) if name == "diffuse" else expected
        else:
            alpha = seen.roughness if name == "specular" else mi.Float(ALPHAS[int(name) - 1])
            expected = scale * cosine_density(table.transform(alpha, receiver.view.z), direction)
            value = luminance(rest) if name == "specular" else basis(receiver.view, direction, alpha)
            value = dr.select(scale > 0, value, 0)
        sums[name] = (value * visible, expected * weight)

    bounce, share = sample_specular(scene.layers, hits.bsdf, si, choice, u, active & seen.followed)
    follows = active & seen.followed & (dr.max(share) > 0)
    far = scene.mi_scene.ray_intersect(si.spawn_ray(si.to_world(bounce.wo)), mi.RayFlags.All, False, follows)
    mirrored = dr.select(follows, emission(scene.mi_scene, far, follows) * share * (1 / spp), 0)

    aims, sees = dr.select(found, mi.Float(1), 0), dr.select(found & ~shadow, mi.Float(1), 0)
    # A sample that overflows counts as none.
    sums = {name: tuple(dr.select(dr.isfinite(a + b), c, 0) for c in (a, b)) for name, (a, b) in sums.items()}
    mirrored = dr.select(dr.all(dr.isfinite(mirrored)), mirrored, 0)
    values = (sums, aims, sees, mirrored)
    # One kernel for all of it. A reduction of what is not evaluated yet would trace the samples once more.
    dr.eval(values)
    sums = {name: tuple(dr.block_sum(c, spp) for c in pair) for name, pair in sums.items()}
    aims, sees = dr.block_sum(aims, spp), dr.block_sum(sees, spp)
    mirrored = mi.Color3f(*(dr.block_sum(c, spp) for c in mirrored))
    share = sees * inverse(dr.maximum(aims, 1))
    disagreement = 4 * share * (1 - share)
    dr.eval(sums, disagreement, mirrored)
    return sums, disagreement, mirrored


def basis(view: Any, direction: Any, alpha: Any) -> Any:
    """A GGX lobe of the reflectance 1, cosine included, as `light_cues` has it. view, direction: above the surface."""
    lobe = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha)
    half = dr.normalize(view + direction)
    value = lobe.eval(half) * lobe.G(view, direction, half) * 0.25 * inverse(view.z)
    return dr.select((direction.z > 0) & (view.z > 0), value, 0)


def _mean_around(values, x, y, columns, rows):
    """Of a pixel and its neighbours."""
    total, counted = mi.Float(0), mi.Float(0)
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            inside = (x + right >= 0) & (x + right < columns) & (y + down >= 0) & (y + down < rows)
            total += dr.gather(mi.Float, values, mi.UInt32((y + down) * columns + x + right), inside)
            counted += dr.select(inside, mi.Float(1), 0)
    return total / counted


@dr.syntax
def ratios(sums, closed, disagreement, guides, width: int, height: int):
    """Light with shadows over light without, by lobe, mi.Float in [0, LARGEST_RATIO].

    closed: by lobe the light that the samples without shadows are to find, mi.Color3f.

    A pixel takes as much of its neighbours as the samples around it disagree, from surfaces that go on.
    """
    lane = dr.arange(mi.UInt32, width * height)
    columns, rows = dr.opaque(mi.Int32, width), dr.opaque(mi.Int32, height)
    y = mi.Int32(lane) // columns
    x = mi.Int32(lane) - y * columns
    position, normal, active = guides["position"], guides["normal"], guides["active"]

    spread = WIDEST * dr.sqrt(_mean_around(disagreement, x, y, columns, rows))
    narrow = -0.5 * inverse(dr.maximum(dr.square(spread), 1e-4))
    # How far a pixel next to this one is, on a surface that is seen at right angles.
    step = guides["distance"] * (2 / mi.Float(columns))

    lit = {name: mi.Float(0) for name in sums}
    unlit = {name: mi.Float(0) for name in sums}
    offset = mi.Int32(0)
    side = 2 * REACH + 1
    while offset < side * side:
        down = offset // side - REACH
        right = offset - (down + REACH) * side - REACH
        inside = active & (x + right >= 0) & (x + right < columns) & (y + down >= 0) & (y + down < rows)
        at = mi.UInt32((y + down) * columns + x + right)
        inside &= dr.gather(mi.Bool, active, at, inside)
        beside = dr.gather(mi.Point3f, position, at, inside) - position
        other = dr.gather(mi.Vector3f, normal, at, inside)
        apart = dr.abs(dr.dot(beside, normal)) / step
        weight = dr.exp(mi.Float(right * right + down * down) * narrow - dr.square(apart))
        weight *= dr.maximum(dr.dot(normal, other), 0) ** 32
        weight = dr.select(inside & dr.isfinite(weight), weight, 0)
        for name, (above, below) in sums.items():
            lit[name] += weight * dr.gather(mi.Float, above, at, inside)
            unlit[name] += weight * dr.gather(mi.Float, below, at, inside)
        offset += 1
    found = {}
    for name in sums:
        enough = unlit[name] > dr.maximum(DARK * luminance(closed[name]), SMALLEST)
        found[name] = dr.clip(dr.select(enough, lit[name] * inverse(unlit[name]), 1), 0, LARGEST_RATIO)
    dr.eval(found)
    return found
