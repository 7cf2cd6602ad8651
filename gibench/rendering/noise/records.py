"""All contributions of a launch of paths: what each light sample and each emitter that was met has added to a pixel."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.rendering.camera import PinholeCamera, RayGenerator
from gibench.rendering.channels import PARTS
from gibench.rendering.integrator import trace_paths
from gibench.rendering.light_numbers import light_numbers, lights_of, number_of
from gibench.rendering.sampling import StratifiedSampler
from gibench.rendering.scene import Scene

SEEN, LIGHT_SAMPLING, PORTALS, MIRRORS, BSDF_SAMPLING, GUIDE = range(6)

TECHNIQUES = ("seen straight", "light sampling", "portals", "mirrors", "BSDF sampling", "guide")
"""Ways in which a path finds a light; the last is a bounce that the guide has chosen. By portals and in mirrors light
is sampled too."""


class _Slots:
    """An array with one entry a lane and a depth, written while a kernel runs."""

    def __init__(self, dtype: Any, lanes: int, depths: int) -> None:
        self._depths, self._lanes = depths, lanes
        self.array = dr.zeros(dtype, lanes * max(depths, 1))
        dr.eval(self.array)

    def put(self, value, slot, active):
        dr.scatter(self.array, value, slot, active)

    def numpy(self) -> NDArray[Any]:
        """(depths, lanes)."""
        return np.array(self.array).reshape(-1, self._lanes)[: self._depths]


class ContributionRecorder:
    """A `PathRecorder` that takes down every contribution and every vertex, one slot for each depth of a lane."""

    def __init__(self, scene: Scene, lanes: int, max_depth: int) -> None:
        """lanes: paths that are launched. max_depth: their largest number of scattering events."""
        self._scene, self._lanes, self._max_depth = scene, lanes, max_depth
        self._lane = dr.arange(mi.UInt32, lanes)
        self._numbers = light_numbers(lights_of(scene.mi_scene))
        dr.make_opaque(self._numbers)

        def slots(dtype: Any, depths: int, count: int = 3) -> list[_Slots]:
            return [_Slots(dtype, lanes, depths) for _ in range(count)]

        # By depth − 1, but for what is seen straight: its depth is 0.
        self.met_value, self.lit_value = slots(mi.Float, max_depth), slots(mi.Float, max_depth)
        self.met_light, self.lit_light, self.seen_light = (
            _Slots(mi.UInt32, lanes, depths) for depths in (max_depth, max_depth, 1)
        )
        self.sampling, self.guided = slots(mi.UInt32, max_depth, 2)
        self.shape, self.material = slots(mi.UInt32, max_depth, 2)
        self.position = slots(mi.Float, max_depth)
        # Of the first vertex, by lobe.
        self.lit_first, self.weight = slots(mi.Float, 1, 6), slots(mi.Float, 1, 6)

    def _slot(self, depth, active):
        inside = active & (depth >= 1) & (depth <= self._max_depth)
        return self._lane + (depth - 1) * self._lanes, inside

    def _light(self, emitter, active):
        return number_of(self._numbers, emitter, active & (emitter != dr.zeros(mi.EmitterPtr)))

    def seen(self, emitter, emitted):
        """See `integrator.PathRecorder`. emitted is a part of the path's sample."""
        self.seen_light.put(self._light(emitter, True), self._lane, True)

    def met(self, emitter, emitted, depth, active):
        """See `integrator.Recorder`."""
        slot, active = self._slot(depth, active & (dr.max(emitted) > 0))
        for component, value in zip(self.met_value, emitted, strict=True):
            component.put(value, slot, active)
        self.met_light.put(self._light(emitter, active), slot, active)

    def vertex(self, row, si, bsdf, scattering, throughput, before, depth, active):
        """See `integrator.Recorder`."""
        slot, active = self._slot(depth, active)
        self._place(si, bsdf, scattering, slot, active)
        reflected = scattering.value * scattering.incident
        lit = active & (dr.max(reflected) > 0)
        for component, value in zip(self.lit_value, throughput * reflected, strict=True):
            component.put(value, slot, lit)

    def first(self, si, bsdf, scattering, lit, weights, active):
        """See `integrator.PathRecorder`."""
        if self._max_depth < 1:
            return
        self._place(si, bsdf, scattering, self._lane, active)
        for slots, pair in ((self.lit_first, lit), (self.weight, weights)):
            for component, value in zip(slots, (c for lobe in pair for c in lobe), strict=True):
                component.put(value, self._lane, active)

    def _place(self, si, bsdf, scattering, slot, active):
        light = scattering.light
        self.lit_light.put(self._light(light.emitter, active & (light.pdf > 0)), slot, active)
        sampling = dr.select(light.entering, mi.UInt32(PORTALS), LIGHT_SAMPLING)
        self.sampling.put(dr.select(light.mirrored, mi.UInt32(MIRRORS), sampling), slot, active)
        self.guided.put(dr.select(scattering.guided, mi.UInt32(1), 0), slot, active)
        self.shape.put(self._scene.shape_ids(si.shape, active), slot, active)
        self.material.put(self._scene.material_ids(bsdf, active), slot, active)
        for component, value in zip(self.position, si.p, strict=True):
            component.put(value, slot, active)


@dataclass(frozen=True)
class Contributions:
    """Light that paths have found, one row for each time that a path found some: (N,) arrays.

    lane: of the path, in order of pixels. depth: scattering events. technique: place in TECHNIQUES. light: number of
    the light. value: (N, 2, 3), radiance by the path's first lobe (diffuse or seen straight, specular) and component.
    shape, material: (max_depth, lanes), ids of the vertices of paths from the first on; position: (max_depth, lanes,
    3), m. invalid: paths with NaN or infinity, which count as 0.
    """

    lane: NDArray[np.int64]
    depth: NDArray[np.int64]
    technique: NDArray[np.int64]
    light: NDArray[np.int64]
    value: NDArray[np.float64]
    shape: NDArray[np.uint32]
    material: NDArray[np.uint32]
    position: NDArray[np.float32]
    invalid: int


def contributions(
    scene: Scene,
    camera: PinholeCamera,
    resolution: tuple[int, int],
    *,
    seed: int,
    first_pixel: int,
    pixels: int,
    samples: int,
    levels: int,
    max_depth: int,
) -> Contributions:
    """Traces a block of pixels as `estimate` does, with the same samples for the same seed."""
    lanes = pixels * samples
    sampler = StratifiedSampler(dr.opaque(mi.UInt32, seed), lanes, levels)
    recorder = ContributionRecorder(scene, lanes, max_depth)
    pixel = dr.arange(mi.UInt32, lanes) // dr.opaque(mi.UInt32, samples) + dr.opaque(mi.UInt32, first_pixel)
    row = pixel // dr.opaque(mi.UInt32, resolution[0])
    corner = mi.Point2f(mi.Float(pixel - row * dr.opaque(mi.UInt32, resolution[0])), mi.Float(row))
    path = trace_paths(
        scene.mi_scene,
        sampler,
        RayGenerator(camera, resolution).rays(corner + sampler.next_2d()),
        max_depth=max_depth,
        portals=scene.portals,
        layers=scene.layers,
        guide=scene.guide,
        recorder=recorder,
    )
    finite = dr.all(dr.isfinite(sum(getattr(path, name) for name in PARTS)))
    emission = path.emission
    # With what was recorded on the way, in the same kernel.
    dr.eval(emission, finite)
    return _gathered(recorder, np.array(emission).T, np.array(finite))


def _gathered(recorder: ContributionRecorder, emission: NDArray[Any], finite: NDArray[Any]) -> Contributions:
    def stacked(slots: list[_Slots]) -> NDArray[Any]:
        return np.stack([s.numpy() for s in slots], axis=-1)

    weight = stacked(recorder.weight)[0].reshape(-1, 2, 3).astype(np.float64)
    lit_first = stacked(recorder.lit_first)[0].reshape(-1, 2, 3).astype(np.float64)
    guided, sampling = recorder.guided.numpy(), recorder.sampling.numpy()
    met_light, lit_light = recorder.met_light.numpy(), recorder.lit_light.numpy()
    rows: list[tuple[Any, ...]] = []

    def add(depth: int, value: NDArray[Any], technique: Any, light: NDArray[Any]) -> None:
        lane = np.flatnonzero((value > 0).any(axis=(1, 2)) & finite)
        technique = np.broadcast_to(technique, len(value))[lane]
        # A mirror is a scattering event more.
        rows.append((lane, depth + (technique == MIRRORS), technique, light[lane], value[lane]))

    straight = np.zeros((len(finite), 2, 3))
    straight[:, 0] = emission
    add(0, straight, SEEN, recorder.seen_light.numpy()[0])
    if len(guided):
        add(1, lit_first, sampling[0], lit_light[0])
    met_value, lit_value = stacked(recorder.met_value), stacked(recorder.lit_value)
    with np.errstate(invalid="ignore", over="ignore"):
        for depth in range(1, len(guided) + 1):
            bounced = np.where(guided[depth - 1], GUIDE, BSDF_SAMPLING)
            add(depth, weight * met_value[depth - 1][:, None], bounced, met_light[depth - 1])
            if depth > 1:
                add(depth, weight * lit_value[depth - 1][:, None], sampling[depth - 1], lit_light[depth - 1])
    *numbers, value = (np.concatenate(column) for column in zip(*rows, strict=True))
    lanes, depths, techniques, lights = (column.astype(np.int64) for column in numbers)
    return Contributions(
        lanes,
        depths,
        techniques,
        lights,
        value,
        recorder.shape.numpy(),
        recorder.material.numpy(),
        stacked(recorder.position),
        int((~finite).sum()),
    )
