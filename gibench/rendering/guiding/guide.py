"""A learned guide on the device: the lights and the directions that paths choose at a place."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.rendering.guiding.alias import alias_tables, pick
from gibench.rendering.guiding.directions import BINS, bin_of, direction_in
from gibench.rendering.guiding.grid import Grid, facing
from gibench.rendering.guiding.mirrors import Images
from gibench.rendering.light_numbers import keys_of, light_numbers, lights_of, number_of
from gibench.rendering.light_sampling import LightSample, inverse

WORTH = 0.2
"""Share of what the start of a path reflects that a path must be expected to bring, to be followed for certain."""

LEAST = 0.2
"""Smallest probability of following a path: expectations are means over cells, and some are wrong."""


@dataclass(frozen=True)
class Distributions:
    """The learned distributions. Row 0 stands for all places of which nothing is known.

    rows: (places,) uint32, the row of each place of the grid. lights: (E, L) over the lights, the portals as one more,
    and the images of lights in mirrors. directions: (E, BINS), relative. fraction: (E,) of directions that the guide
    chooses, in [0, 1); the BSDF chooses the others. sent: (E,), radiance that surfaces reflect, in the mean over
    directions, and bounced: of it what bounces bring, relative to the largest; 0 where it is not known.
    """

    rows: NDArray[np.uint32]
    lights: NDArray[np.float64]
    directions: NDArray[np.float64]
    fraction: NDArray[np.float64]
    sent: NDArray[np.float64]
    bounced: NDArray[np.float64]


class Guide:
    """Chooses lights and directions for paths.

    All that it returns comes with its exact density, and no light and no direction that reflects light is left out, so
    that estimates are unbiased whatever was learned. directions: whether it chooses directions too; a kernel without
    them takes a tenth less time. images: of lights in mirrors, or None. arrays: those of the device, for kernels that
    are recorded.
    """

    def __init__(
        self,
        mi_scene: Any,
        portals: Any,
        grid: Grid,
        learned: Distributions,
        *,
        directions: bool = True,
        images: Images | None = None,
    ) -> None:
        """portals: `Portals` that light comes in by, or None. Under a vectorised variant, with at least one light."""
        self.grid, self.portals, self.directions, self.images = grid, portals, directions, images
        emitters = lights_of(mi_scene)
        light_table, light_probability = alias_tables(learned.lights)
        table, probability = alias_tables(learned.directions if directions else learned.directions[:1])
        keys = keys_of(emitters)
        if images is not None:
            # The place of the portals is nobody's.
            keys = np.concatenate([keys, keys[:1] if portals is not None else keys[:0], keys[images.lights]])
        self._emitters = dr.reinterpret_array(mi.EmitterPtr, mi.UInt32(keys))
        self._numbers = light_numbers(emitters)
        self._lights = mi.UInt32(learned.lights.shape[1])
        self._portal_light = mi.UInt32(len(emitters))
        self._first_image = mi.UInt32(len(emitters) + (portals is not None))
        self._rows = mi.UInt32(learned.rows)
        self._fraction = mi.Float(learned.fraction)
        self._sent, self._bounced = mi.Float(learned.sent), mi.Float(learned.bounced)
        self._light_table = mi.UInt32(light_table.ravel())
        self._light_probability = mi.Float(light_probability.ravel())
        self._table = mi.UInt32(table.ravel())
        self._density = mi.Float(probability.ravel() * (BINS / (4 * np.pi)))
        self.arrays = [
            self._emitters,
            self._numbers,
            self._lights,
            self._portal_light,
            self._first_image,
            self._rows,
            self._fraction,
            self._sent,
            self._bounced,
            self._light_table,
            self._light_probability,
            self._table,
            self._density,
            *grid.arrays,
            *(images.arrays if images is not None else []),
        ]
        dr.make_opaque(self.arrays)

    def row(self, si, sampler, active):
        """Row of the distributions for the side of a surface that si.wi sees. sampler: independent."""
        shift = mi.Vector3f(sampler.next_1d(), sampler.next_1d(), sampler.next_1d()) - 0.5
        place = self.grid.place_or_outside(si.p, facing(si), shift)
        return dr.gather(mi.UInt32, self._rows, place, active)

    def fraction(self, row, bsdf, active):
        """Probability that a bounce is the guide's: 0 without a diffuse lobe, where the BSDF samples better."""
        diffuse = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.DiffuseReflection)
        return dr.gather(mi.Float, self._fraction, row, diffuse)

    def sent(self, row, active):
        """Radiance that surfaces reflect, by rows; 0 where it is not known. Of the same unit as `bounced`."""
        return dr.gather(mi.Float, self._sent, row, active)

    def survival(self, row, throughput, reflected, active):
        """Probability of following a path on from a place; 0 where nothing is known.

        row: of the place. throughput: of the path, up to there. reflected: what its start reflects in all. A path that
        is expected to bring a fifth of that or more goes on (Vorba and Křivánek 2016): how long to follow depends on
        what there is to be found, not on the albedos met so far.
        """
        expected = dr.gather(mi.Float, self._bounced, row, active) * throughput
        known = active & (expected > 0) & (reflected > 0)
        return dr.select(known, dr.clip(expected * inverse(WORTH * reflected), LEAST, 1), 0)

    def density(self, row, direction, active):
        """Of the guide's directions, per steradian."""
        return dr.gather(mi.Float, self._density, row * BINS + bin_of(direction), active)

    def mixed_density(self, row, fraction, direction, bsdf_pdf, active):
        """Density of the direction of a bounce, chosen by the BSDF or by the guide."""
        return dr.lerp(bsdf_pdf, self.density(row, direction, active), fraction)

    def bounce(self, context, si, bsdf, row, fraction, sampled, weight, sampler, active):
        """The next direction: the BSDF's sample, or the guide's in its place (one-sample MIS, Veach 1997, 9.2.4).

        sampled, weight: of the BSDF. Returns the direction (world), the weight (BSDF value over density), the density,
        whether it is a delta lobe's, the relative index of refraction, and whether the guide has chosen it.
        """
        guided = active & (sampler.next_1d() < fraction)
        item = pick(self._table, row, mi.UInt32(BINS), sampler.next_1d(), guided)
        direction = direction_in(item, sampler.next_2d())
        local = si.to_local(direction)
        value, pdf = bsdf.eval_pdf(context, si, local, guided)
        delta = mi.has_flag(sampled.sampled_type, mi.BSDFFlags.Delta) & (guided ^ True)
        direction = dr.select(guided, direction, si.to_world(sampled.wo))
        value = dr.select(guided, value, weight * sampled.pdf)
        pdf = dr.select(guided, pdf, sampled.pdf)
        mixed = dr.lerp(pdf, self.density(row, direction, active), fraction)
        mixed_weight = dr.select(mixed > 0, value * inverse(mixed), 0)
        # Where nothing guides, the sample stays what it was: the density of a near-mirror may overflow.
        alone = (fraction == 0) | delta
        return (
            direction,
            dr.select(alone, weight / (1 - fraction), mixed_weight),
            dr.select(alone, sampled.pdf, mixed),
            delta,
            dr.select(guided, 1, sampled.eta),
            guided,
        )

    def light_probability(self, row, light, active):
        """With which a light is chosen. light: its number."""
        return dr.gather(mi.Float, self._light_probability, row * self._lights + light, active)

    def _number(self, emitter, active):
        return number_of(self._numbers, emitter, active)

    def _through_portals(self, reference, row, direction, active):
        density = self.portals.density(reference.p, direction)
        return dr.select(active, density * self.light_probability(row, self._portal_light, active), 0)

    def light_density(self, reference, row, emitter, towards, mirror, active):
        """Density with which `sample_light` finds a point of an emitter, per steradian.

        reference: where from, or its image in a mirror, 0 for none. emitter: pointers. towards: mi.DirectionSample3f to
        the point.
        """
        active = active & (emitter != dr.zeros(mi.EmitterPtr))
        light = self._number(emitter, active)
        known = active
        if self.images is not None:
            image = self.images.number(mirror, light, active)
            known = active & ((mirror == 0) | (image > 0))
            light = dr.select(mirror == 0, light, self._first_image + image - 1)
        chosen = self.light_probability(row, light, known)
        density = emitter.pdf_direction(reference, towards, known) * chosen
        if self.portals is None:
            return density
        entering = active & (emitter == self.portals.environment)
        if self.images is not None:
            entering &= mirror == 0
        return density + self._through_portals(reference, row, towards.d, entering)

    def _by_mirror(self, scene, si, mirror, sample, active):
        """By way of mirrors to samples of lights, drawn from the images of si in them.

        Returns the direction to the mirror, the ray from there to the light, and how much is reflected, 0 where the
        mirror does not show the sample.
        """
        towards = self.images.direction(mirror, sample.d, active)
        met = scene.ray_intersect(si.spawn_ray(towards), mi.RayFlags.All, False, active)
        shown = (
            active & self.images.before(mirror, sample.p, active) & (self.images.at(met, active) == mirror)
        )
        _, reflected = met.bsdf().sample(mi.BSDFContext(), met, 0.5, mi.Point2f(0.5), shown)
        return towards, met.spawn_ray_to(sample.p), dr.select(shown, reflected, 0)

    def sample_light(self, scene, si, row, sampler, active, deeper):
        """A `LightSample` of a light that si sees. deeper: whether it may be seen in a mirror."""
        light = pick(self._light_table, row, self._lights, sampler.next_1d(), active)
        u = sampler.next_2d()
        entering = mi.Bool(False) if self.portals is None else active & (light == self._portal_light)
        emitter = dr.gather(mi.EmitterPtr, self._emitters, light, active & (entering ^ True))
        start, mirrored = si, mi.Bool(False)
        if self.images is not None:
            mirrored = active & (light >= self._first_image)
            mirror = self.images.mirror_of(light - self._first_image, mirrored)
            start = mi.SurfaceInteraction3f(si)
            start.p = self.images.point(mirror, si.p, mirrored)
        sample, weight = emitter.sample_direction(start, u, active & (entering ^ True))
        direction, delta = sample.d, sample.delta
        ray = si.spawn_ray_to(sample.p)
        if self.images is not None:
            mirrored &= deeper & (sample.pdf > 0)
            direction, from_mirror, reflected = self._by_mirror(scene, si, mirror, sample, mirrored)
            ray = dr.select(mirrored, from_mirror, ray)
            weight = dr.select(light >= self._first_image, weight * reflected, weight)
        chosen = self.light_probability(row, light, active)
        density = sample.pdf * chosen
        if self.portals is not None:
            environment = self.portals.environment
            through = self.portals.sample(si.p, u)
            entering &= dr.any(through != 0)
            direction = dr.select(entering, through, direction)
            ray = dr.select(entering, si.spawn_ray(direction), ray)
            delta &= entering ^ True
            # One density for both ways to the environment.
            radiance, outside = self.portals.environment_from(direction, entering)
            of_environment = self.light_probability(row, self._number(environment, True), entering)
            density = dr.select(
                entering, environment.pdf_direction(si, outside, entering) * of_environment, density
            )
            by_sky = active & (entering | (emitter == environment))
            density += self._through_portals(si, row, direction, by_sky)
            # As a ratio of densities: that of a lamp far away may be close to overflow.
            weight = dr.select(
                entering, radiance * inverse(density), weight * (sample.pdf * inverse(density))
            )
        else:
            weight *= inverse(chosen)
        found = active & (density > 0) & dr.isfinite(density) & (entering | (sample.pdf > 0))
        if self.images is not None:
            found &= (light < self._first_image) | (mirrored & dr.any(weight > 0))
        found &= scene.ray_test(ray, found) ^ True
        return LightSample(
            direction,
            dr.select(found, density, 0),
            delta,
            dr.select(found, weight, 0),
            emitter if self.portals is None else dr.select(entering, self.portals.environment, emitter),
            entering,
            mirrored,
            light,
        )
