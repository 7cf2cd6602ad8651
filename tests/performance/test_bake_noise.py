"""Noise times time of what is baked, lightmap texels and probes: guided and plain paths against Mitsuba's `path`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gibench.rendering.backend import select_variant

select_variant("auto")  # before what loads Dr.Jit, which must know by then where LLVM is

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

from gibench.baselines.lightmap.coverage import Coverage, cover  # noqa: E402
from gibench.baselines.lightmap.texel_paths import TexelPoints, hidden, trace_texels  # noqa: E402
from gibench.baselines.lightmap.unwrapping import unwrap  # noqa: E402
from gibench.baselines.probes import baking, placement  # noqa: E402
from gibench.rendering import surface  # noqa: E402
from gibench.rendering.scene import GUIDED  # noqa: E402
from tests.performance.test_noise import (  # noqa: E402
    REPEATS,
    RESOLUTION,
    ROOMS,
    _cpu_seconds,
    _room,
    measured,
    tell_means,
    tell_room,
)

pytestmark = pytest.mark.performance

SPP, MAX_DEPTH = 64, 8

TEXELS_PER_METRE = 8

CLEARANCE = 1e-3
"""Metres above a texel at which the rays of `path` begin that look at it."""

PROBES = 4


def path_along(mi_scene: Any, rays: Any, sampler: Any):
    """Radiance that Mitsuba's `path` finds along rays, mi.Color3f."""
    integrator = mi.load_dict({"type": "path", "max_depth": MAX_DEPTH + 1, "rr_depth": 5})
    return integrator.sample(mi_scene, sampler, mi.RayDifferential3f(rays))[0]


def means(radiance: Any, count: int):
    """Of SPP lanes each, (count, 3)."""
    radiance = dr.select(dr.isfinite(radiance), radiance, 0)
    dr.eval(radiance)
    sums = [dr.block_sum(part, SPP) for part in radiance]
    dr.eval(sums)
    return np.stack([np.array(part) for part in sums], axis=-1)[:count] / SPP


def independent(seed: int, lanes: int):
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, lanes)
    return sampler


def from_above(si):
    """Rays that look at surfaces."""
    return mi.Ray3f(si.p + CLEARANCE * si.sh_frame.n, -si.sh_frame.n)


def texel_runs(scenes):
    """Irradiance at texels of matt surfaces that do not glow, whose one lobe is all that `path` sees there.

    Renderers by name, as `measured` takes them, of the first of a fixed choice of texels.
    """
    scene = scenes["plain"]
    unwrapping = unwrap(scene, TEXELS_PER_METRE)
    coverage = cover(unwrapping, 2)
    coverage = coverage.without(hidden(TexelPoints(scene, unwrapping, coverage), len(coverage.faces)))
    # One point a texel, so that all renderers have the same integral.
    firsts = coverage.first[:-1]
    faces, barycentrics = coverage.faces[firsts], coverage.barycentrics[firsts]

    def chosen(rows):
        texels, charts = coverage.texels[rows], coverage.charts[rows]
        return Coverage(texels, charts, np.arange(len(rows) + 1), faces[rows], barycentrics[rows])

    everything = TexelPoints(scene, unwrapping, chosen(np.arange(len(firsts))))
    si = everything.interaction(dr.arange(mi.UInt32, len(firsts)))
    valid = mi.Bool(True)
    glossy = np.array(surface.specular_albedo(scene, si.bsdf(), si, valid)).max(axis=0)
    albedo = np.array(surface.albedo(scene, si.bsdf(), si, valid))
    glows = np.array(si.shape.is_emitter())
    # Rays that begin above a texel are to meet it, not what lies on it or the other side of a thin sheet.
    seen = scene.mi_scene.ray_intersect(from_above(si))
    same = np.array(
        seen.is_valid() & (dr.abs(seen.t - CLEARANCE) < 0.1 * CLEARANCE) & (seen.shape == si.shape)
    )
    matt = np.flatnonzero((glossy == 0) & (albedo.min(axis=0) > 0.02) & ~glows & same)
    order = np.random.default_rng(0).permutation(matt)

    def of(count):
        rows = order[:count]
        assert len(rows) == count, f"{len(order)} matt texels"
        return rows

    def ours(scene):
        def run(seed, resolution):
            rows = of(resolution[0] * resolution[1])
            points, first = TexelPoints(scene, unwrapping, chosen(rows)), np.arange(len(rows) + 1)
            return trace_texels(points, first, spp=SPP, max_depth=MAX_DEPTH, seed=seed * 1000003)[0]

        return run

    def path(seed, resolution):
        rows = of(resolution[0] * resolution[1])
        lanes = len(rows) * SPP
        si = TexelPoints(scene, unwrapping, chosen(rows)).interaction(dr.arange(mi.UInt32, lanes) // SPP)
        found = means(path_along(scene.mi_scene, from_above(si), independent(seed, lanes)), len(rows))
        return found * np.pi / albedo.T[rows]

    return {"path": path, **{name: ours(one) for name, one in scenes.items()}}


def probe_runs(scenes, monkeypatch):
    """Light that arrives at probes, from the directions of lat-long maps."""
    positions = placement.place(scenes["plain"], PROBES)

    def settings(resolution):
        return baking.ProbeSettings(len(positions), resolution[1], resolution[1] // 2, SPP)

    def ours(scene):
        def run(seed, resolution):
            chosen = settings(resolution)
            with monkeypatch.context() as patch:
                patch.setattr(baking, "SEED", seed)
                baker = baking._Baker(scene, positions, chosen, max_depth=MAX_DEPTH)
                image = np.zeros((len(positions), chosen.height, chosen.width, 3), dtype=np.float32)
                baker.run(baker.light, SPP, {"light": image})
            return image.reshape(-1, 3)

        return run

    def path(seed, resolution):
        chosen = settings(resolution)
        baker = baking._Baker(scenes["plain"], positions, chosen, max_depth=MAX_DEPTH)
        count = len(positions) * chosen.height * chosen.width
        sampler = independent(seed, count * SPP)
        lane = dr.arange(mi.UInt32, count * SPP) // SPP
        rays = baking._rays(baker.positions, baker.mapping, None, lane, sampler.next_2d())
        return means(path_along(scenes["plain"].mi_scene, rays, sampler), count)

    return {"path": path, **{name: ours(one) for name, one in scenes.items()}}


def assert_alike(runs):
    """All of them see the same, where what is bright and rare has not much more weight than the rest."""
    other = np.mean([runs["guided"](REPEATS + n, RESOLUTION) for n in range(1, 5)], axis=0)
    weights = 1 / (other + other.mean())
    light = {name: float((weights * run(REPEATS, RESOLUTION)).mean()) for name, run in runs.items()}
    assert max(light.values()) < 1.1 * min(light.values()), light


@pytest.mark.parametrize("baked", ["texels", "probes"])
def test_guided_and_plain_bakes_against_path(tmp_path, monkeypatch, baked):
    ratios: dict[str, list[tuple[float, ...]]] = {}
    for index in range(ROOMS):
        room, scene, _ = _room(index, tmp_path / str(index))
        guided = replace(scene, sampling=GUIDED)
        _, learning = _cpu_seconds(lambda guided=guided: guided.guide)
        scenes = {"plain": scene, "guided": guided}
        runs = texel_runs(scenes) if baked == "texels" else probe_runs(scenes, monkeypatch)
        assert_alike(runs)
        paths = len(runs["path"](0, RESOLUTION)) * SPP
        print(f"\nroom {index}: {room.kind}, {'night' if room.environment.kind == 'none' else 'day'}")
        tell_room(measured(runs, REPEATS), learning, paths, ratios)
    print(f"\n{baked}, of path, geometric means over rooms (largest):")
    tell_means(ratios)
