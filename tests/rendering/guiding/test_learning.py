"""A guide is part of its scene: learned alike whatever the threads, and again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gibench.rendering.render import render_frame
from gibench.rendering.scene import GUIDED, SceneError, load_dict, load_scene
from tests.rendering import scenes

LEARNING = "gibench.rendering.guiding.learning"


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(LEARNING + ".LANES", 1 << 14)
    monkeypatch.setattr(LEARNING + ".LOOKS", 1 << 16)
    monkeypatch.setattr(LEARNING + ".DIRECTIONS_PAY", -1.0)


def test_threads_and_loads_change_no_bit():
    import drjit as dr

    def pixels():
        scene = replace(load_dict(scenes.box("coat")), sampling=GUIDED)
        assert scene.guide is not None
        return render_frame(
            scene, scenes.CAMERA, resolution=(24, 24), channels=["radiance"], spp=16, seed=3
        ).arrays["color"]

    threads = dr.thread_count()
    first = pixels()
    dr.set_thread_count(1)
    try:
        np.testing.assert_array_equal(pixels(), first)
    finally:
        dr.set_thread_count(threads)


def test_probabilities_are_positive_and_sum_to_one():
    scene = replace(load_dict(scenes.box("coat")), sampling=GUIDED)
    guide = scene.guide
    from gibench.rendering.guiding.directions import BINS

    density = np.array(guide._density).reshape(-1, BINS)
    np.testing.assert_allclose(density.mean(axis=1), 1 / (4 * np.pi), rtol=1e-5)
    assert density.min() > 0
    lights = np.array(guide._light_probability).reshape(len(density), -1)
    np.testing.assert_allclose(lights.sum(axis=1), 1, rtol=1e-5)
    assert lights.min() > 0
    share = np.array(guide._fraction)
    assert share[0] == 0
    assert ((share >= 0) & (share < 1)).all()


def test_an_unknown_sampling_is_refused(tmp_path):
    with pytest.raises(SceneError, match="plain or guided"):
        load_scene(tmp_path / "scene.xml", sampling="best")


def judged(brought, guide_density):
    """`Sums` of a place whose bounces brought some radiance, a bin each, of a uniform BSDF; (N,), (BINS,)."""
    from gibench.rendering.guiding.directions import BIN_AREA, BINS
    from gibench.rendering.guiding.guide import Distributions
    from gibench.rendering.guiding.paths import NONE, Samples
    from gibench.rendering.guiding.sums import Sums

    count, even = len(brought), 1 / (BINS * BIN_AREA)
    place = np.zeros(count, np.uint32)
    density = np.full(count, even, np.float32)
    nothing = np.zeros(count)
    samples = Samples(
        place, np.arange(count, dtype=np.uint32) % BINS, density, density, brought, place, nothing, nothing
    )
    assert samples.direction.max() < NONE
    sums = Sums((1, 1, 1), place, 1)
    directions = np.tile(guide_density, (2, 1))
    guide = Distributions(sums.rows, np.ones((2, 1)), directions, np.zeros(2), np.zeros(2), np.zeros(2))
    sums.add_moments(samples, guide)
    return sums


def test_a_place_is_guided_as_much_as_it_pays():
    from gibench.rendering.guiding.directions import BINS
    from gibench.rendering.guiding.sums import FRACTIONS

    rng = np.random.default_rng(0)
    number = np.arange(64 * BINS) % BINS
    # All light comes from an eighth of the directions, which the guide knows, or takes for dark.
    bright = number % 8 == 0
    knows = np.where(np.arange(BINS) % 8 == 0, 8.0, 1e-3) / BINS
    brought = np.where(bright, rng.exponential(1.0, len(number)), 0.0)
    assert judged(brought, knows).fractions()[1] == FRACTIONS[-1]
    assert judged(brought, np.roll(knows, 1)).fractions()[1] == 0
    # Light that is the same from everywhere is best left to the BSDF, and what brings nothing tells nothing.
    assert judged(np.ones(len(number)), knows).fractions()[1] == 0
    assert judged(np.zeros(len(number)), knows).fractions()[1] == 0
    # So much of the second moment is gone: that of .4 even and .6 of the guide, which is where the light is.
    assert judged(brought, knows).gain_of_directions() == pytest.approx(1 - 1 / (0.4 + 0.6 * 8), rel=1e-2)
    assert judged(np.ones(len(number)), knows).gain_of_directions() == 0
    assert judged(np.zeros(len(number)), knows).gain_of_directions() == 0
    huge = judged(1e100 * brought, knows).gain_of_directions()  # radiance over throughput, both float32
    assert huge == pytest.approx(judged(brought, knows).gain_of_directions())


def test_moments_are_those_of_the_other_densities():
    """By the closed form: brought² · drawn / mixture, bin by bin."""
    from gibench.rendering.guiding.directions import BINS
    from gibench.rendering.guiding.sums import FRACTIONS

    rng = np.random.default_rng(1)
    brought, guide = rng.exponential(1.0, BINS), rng.dirichlet(np.ones(BINS))
    found = judged(brought, guide).moments[1]
    for fraction, moment in zip(FRACTIONS, found, strict=True):
        mixture = (1 - fraction) / BINS + fraction * guide
        np.testing.assert_allclose(moment, np.sum(brought**2 / BINS / mixture), rtol=1e-5)


def test_what_lies_outside_of_the_grid_has_places_of_its_own():
    """A place a face, whatever the distance: the ground before a window, a facade."""
    import mitsuba as mi

    from gibench.rendering.guiding.grid import FACES, Grid

    grid = Grid(np.zeros(3), np.ones(3), cells=27)
    assert grid.places == (27 + 1) * FACES
    points = np.array([[0.1, 0.1, 0.1], [0.9, 0.9, 0.9], [5, 0.5, 0.5], [-90, 3, 0.5], [0.5, 0.5, -0.1]])
    normals = np.array([[0, 0, 1], [0, 0, -1], [0, 0, 1], [1, 0, 0], [0, -1, 0]])
    found = grid.place_or_outside(
        mi.Point3f(points.T.astype(np.float32)), mi.Vector3f(normals.T.astype(np.float32)), mi.Vector3f(0)
    )
    np.testing.assert_array_equal(found, [4, 26 * FACES + 5, 27 * FACES + 4, 27 * FACES, 27 * FACES + 3])


def test_outside_a_light_is_learned_too():
    """The ground before a window is lit by the sky, and the lamp of the room is not asked for there."""
    from gibench.rendering.guiding.grid import FACES
    from tests.rendering import test_portals

    white = scenes.two_sided(type="diffuse", reflectance=scenes.rgb(0.6))
    ground = scenes.rectangle([9, 0, -0.5], [0, 0, 1], (7, 20), bsdf=white)
    scene = replace(load_dict(test_portals.room() | {"ground": ground}), sampling=GUIDED)
    guide = scene.guide
    rows = np.array(guide._rows)
    assert len(rows) == guide.grid.places
    facing_up = rows[-FACES:][4]
    assert facing_up > 0
    lamp, sky = np.array(guide._light_probability).reshape(-1, 2)[facing_up]
    assert sky > 0.9
    assert lamp > 0.04


def learner_in(description):
    """`_Learner` of a scene that paths start in the middle of."""
    from gibench.rendering.guiding.learning import _Learner, _unguided
    from gibench.rendering.light_numbers import lights_of

    scene = load_dict(description)
    middle = np.random.default_rng(0).uniform(-0.5, 0.5, (50, 3))
    return _Learner(scene, None, _unguided(lights_of(scene.mi_scene)), middle)


def test_a_look_brings_what_is_there():
    """Radiance alike from everywhere comes in by the cosine; where all is dark, emission has its share alone."""
    from gibench.rendering.guiding.directions import BINS, direction_in
    from gibench.rendering.guiding.sights import look_around
    from gibench.stress.scenes import closed_box

    learner = learner_in(closed_box(0.6, 1.0))
    guide = learner.guide(directions=False)

    def looks(radiance):
        everywhere = np.full(learner.grid.places, radiance)
        return look_around(learner.scene, guide, learner._starts, everywhere, 1 << 14)

    import mitsuba as mi

    dark, bright = looks(0.0), looks(2.5)
    assert len(dark.place) == 1 << 14
    np.testing.assert_allclose(bright.brought - dark.brought, 2.5, rtol=1e-5)
    # Walls of radiance 1: less than that, since they are also found by samples of lights.
    assert 0 < dark.brought.mean() < 0.9
    assert dark.brought.max() <= 1
    # Their density is the cosine over π, to the width of a bin.
    towards = np.array(direction_in(mi.UInt32(np.arange(BINS)), mi.Point2f(0.5))).T[bright.direction]
    face = bright.place % 6
    cosine = np.where(face % 2 == 0, 1, -1) * towards[np.arange(len(face)), face // 2]
    np.testing.assert_allclose(bright.density, np.maximum(cosine, 0) / np.pi, atol=0.09)


def test_what_a_place_sends_is_what_it_reflects():
    """In a furnace of reflectance ρ whose walls shine with 1 it is ρ + ρ² + …, as far as paths go."""
    from gibench.stress.scenes import closed_box

    sums = learner_in(closed_box(0.3, 1.0)).lights()
    np.testing.assert_allclose(sums.radiance()[sums.rows > 0].mean(), 0.3 / 0.7, rtol=0.03)
    np.testing.assert_allclose(sums.sent.sum() / sums.met.sum(), 0.3 / 0.7, rtol=0.02)
    # What is sampled of the lights is another half of it.
    assert 0 < sums.bounced.sum() < sums.sent.sum()
    sent, bounced = sums.learned(np.ones(1)).sent, sums.learned(np.ones(1)).bounced
    assert sent[0] == bounced[0] == 0
    assert max(sent.max(), bounced.max()) == 1


def test_radiance_beyond_single_precision_is_no_harm():
    from gibench.rendering.guiding.sights import look_around

    learner = learner_in(scenes.box("coat"))
    huge = np.full(learner.grid.places, 1e100)
    sights = look_around(learner.scene, learner.guide(directions=False), learner._starts, huge, 1 << 10)
    assert len(sights.place)
    assert np.isfinite(sights.brought).all()
