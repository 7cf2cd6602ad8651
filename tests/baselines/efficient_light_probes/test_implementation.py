"""The method `elp-search` as a whole, on scenes whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.baselines.efficient_light_probes import SEARCH
from gibench.baselines.nearest_probe import METHOD as NEAREST
from gibench.baselines.stages import Stages
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.baselines.meshes import diffuse, room, slab
from tests.baselines.probes.test_narrowed import metal
from tests.baselines.sites import RESOLUTION, lit_box, site, view
from tests.rendering import scenes

SMALL = {
    "texels": 8,
    "lightmap_spp": 64,
    "lightmap_denoise": False,
    "probes": 8,
    "probe_width": 256,
    "probe_spp": 16,
    "rays": 1,
}
CAMERA = PinholeCamera((0.7, 0.8, 0.3), (-0.4, -0.5, -0.8), 1.2)


def mirror_floor(roughness):
    """A closed room with a coloured box on a floor of metal, all lit by a lamp."""
    lamp = scenes.rectangle([0.2, 0, 0.98], [0, 0, -1], (0.3, 0.3), emitter=scenes.area(8, 7, 6))
    return {
        "type": "scene",
        **room(diffuse(0.7, 0.6, 0.5)),
        "lamp": lamp,
        "box": slab([-0.7, -0.7, -1.001], [-0.2, -0.2, -0.3], diffuse(0.2, 0.5, 0.7)),
        "floor": slab([-1.05, -1.05, -1.05], [1.05, 1.05, -0.999], metal(roughness)),
    }


def rendered(method, where, camera=CAMERA, **given):
    knobs = {name: value for name, value in (SMALL | given).items() if name in {k.name for k in method.knobs}}
    implementation = method.load()(method.settings(knobs))
    implementation.prepare(where)
    stages = Stages()
    return implementation.render(view(camera), stages), stages


def true_gloss(scene, spp):
    """What the reference renderer says of the specular part."""
    truth = render_frame(scene, CAMERA, resolution=RESOLUTION, spp=spp, channels=["radiance"]).arrays
    return truth["direct_specular"] + truth["indirect_specular"]


def error(found, expected):
    """Box and wall reflect up to 0.5, the lamp 8: its edge alone would decide a linear mean."""
    return np.sqrt(np.mean((np.minimum(found.specular, 1) - np.minimum(expected, 1)) ** 2))


@pytest.mark.parametrize("roughness", [0.005, 0.05, 0.5])
def test_nearer_to_the_truth_than_the_nearest_probe(tmp_path, roughness):
    """On a near-mirror the parallax is all there is to get right; on a rough floor there is little of it."""
    scene = load_dict(mirror_floor(roughness))
    where = site(scene, tmp_path)
    expected = true_gloss(scene, 1024)
    ours, stages = rendered(SEARCH, where)
    naive, _ = rendered(NEAREST, where)
    assert np.isfinite(ours.color).all()
    assert error(ours, expected) < (0.6 if roughness < 0.1 else 1.0) * error(naive, expected)
    assert set(stages.seconds) == {"g-buffer", "ray casting", "search"}
    assert 0 < ours.extra["search_steps"] <= 8 * 20


def test_without_gloss_the_image_is_the_diffuse_one(tmp_path):
    scene = load_dict(scenes.closed_box(0.5, 1.0))
    found, _ = rendered(SEARCH, site(scene, tmp_path))
    assert not found.specular.any()
    assert (found.color > 0).all()
    assert found.extra["search_steps"] == 0


@pytest.mark.parametrize(("half", "tolerance"), [(100.0, 10.0), (0.01, 0.001)])
def test_a_scene_of_another_size_gives_the_same_image(tmp_path, half, tolerance):
    def image(half, tolerance, folder):
        camera = PinholeCamera(
            (0.5 * half, 0.6 * half, 0.3 * half), (-0.4 * half, -0.5 * half, -0.8 * half), 1.2
        )
        where = site(load_dict(lit_box(metal(0.1), half=half)), folder)
        found, _ = rendered(SEARCH, where, camera, probe_width=128, probe_spp=4, tolerance=tolerance)
        return found.specular

    once, other = image(1.0, 0.1, tmp_path / "one"), image(half, tolerance, tmp_path / "other")
    assert once.max() > 1
    # The probes are sampled anew, where rounding may place one beside where it was.
    assert np.sqrt(np.mean((once - other) ** 2)) < 0.05 * once.mean()


def test_one_preparation_serves_all_settings_that_do_not_bake(tmp_path):
    where = site(load_dict(mirror_floor(0.05)), tmp_path)
    method = SEARCH.load()(SEARCH.settings(SMALL))
    method.prepare(where)
    images = {}
    for steps, candidates in ((20, 8), (1, 1), (20, 8)):
        method.adjust(SEARCH.settings(SMALL | {"steps": steps, "candidates": candidates}))
        found = method.render(view(CAMERA), Stages())
        if (steps, candidates) in images:
            np.testing.assert_array_equal(found.specular, images[steps, candidates])
        images[steps, candidates] = found.specular
    assert np.abs(images[20, 8] - images[1, 1]).max() > 0.01
