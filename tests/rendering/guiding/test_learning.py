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
    monkeypatch.setattr(LEARNING + ".PASSES", (1, 1))


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
