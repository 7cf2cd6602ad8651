"""The factorized render against Mitsuba's own `path`: same scene, sampler, samples, filter and machine."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from gibench.rendering.backend import select_variant
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.performance.turns import seconds
from tests.rendering import scenes

pytestmark = pytest.mark.performance

REPEATS = 5


@pytest.fixture(scope="module", autouse=True)
def variant():
    return select_variant("auto")


def _median_ratio(first, second):
    """Medians of two functions of a seed, which is another in each run, and their ratio."""

    def seeded(run):
        seeds = itertools.count()
        return lambda: run(next(seeds))

    a, b = seconds(seeded(first), seeded(second), repeats=REPEATS)
    return a, b, a / b


@pytest.mark.parametrize("spp", [64, 256])
@pytest.mark.parametrize("material", ["coat", "metal"])
def test_factorized_render_against_path(spp, material):
    scene = load_dict(scenes.box(material))
    options = {"resolution": (256, 256), "spp": spp, "max_depth": 8}

    def factorized(seed):
        render_frame(
            scene, scenes.CAMERA, channels=["radiance", "surface", "reflection"], seed=seed, **options
        )

    def path(seed):
        scenes.render_path(scene.mi_scene, scenes.CAMERA, 256, spp, seed, 8)

    ours, theirs, ratio = _median_ratio(factorized, path)
    print(
        f"\n{material}, {spp} spp, 256²: factorized {ours:.2f} s, path {theirs:.2f} s, ratio {ratio:.2f} (reach 1.15)"
    )


def test_stratified_against_independent_samples():
    """Variance of color at equal samples: what stratification saves, in the unit of samples."""
    from gibench.rendering import estimate

    scene = load_dict(scenes.box("coat"))

    def variance(levels):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(estimate, "group_levels", lambda spp: levels)
            frames = [
                render_frame(scene, scenes.CAMERA, resolution=(64, 64), spp=64, seed=s, channels=["color"])
                for s in range(12)
            ]
        return np.array([f.arrays["color"] for f in frames], dtype=float).var(axis=0, ddof=1).mean()

    plain = variance(0)
    for levels in (1, 2, 3):
        print(f"\nvariance with groups of {4**levels}: {variance(levels) / plain:.2f} of independent samples")


@pytest.mark.parametrize("index", [5, 7, 10])
def test_portals_against_none(tmp_path, index):
    """Squared median error times time in a room by daylight, with windows as portals and without."""
    from dataclasses import replace

    from gibench.generators.rooms import sample_room
    from gibench.generators.scene_files import write_room
    from gibench.rendering.camera import PinholeCamera
    from gibench.rendering.scene import load_scene

    room = sample_room(0, index, views=1, environment="sunsky")
    write_room(room, tmp_path)
    scene = load_scene(tmp_path / "scene.xml")
    camera = PinholeCamera(room.cameras[0].position, room.cameras[0].target, room.cameras[0].fov)
    errors = {True: [], False: []}

    def render(portals):
        def run(seed):
            frame = render_frame(
                scene if portals else replace(scene, openings=None),
                camera,
                resolution=(160, 120),
                spp=64,
                seed=seed,
                channels=["color", "color_se"],
            )
            errors[portals].append(frame.median_error)

        return run

    _, _, time_ratio = _median_ratio(render(True), render(False))
    variance = (np.mean(errors[True]) / np.mean(errors[False])) ** 2
    print(
        f"\nroom {index} ({room.kind}, {len(room.openings)} windows): variance {variance:.2f}, time {time_ratio:.2f}, "
        f"variance x time {variance * time_ratio:.2f} of the same without portals"
    )
