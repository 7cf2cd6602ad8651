"""The method `gpr` as a whole, on scenes whose answer is known."""

from __future__ import annotations

import gc

import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.glossy_probe_reprojection import METHOD as GPR
from gibench.baselines.method import View
from gibench.baselines.nearest_probe import METHOD as NEAREST
from gibench.baselines.probes import placement
from gibench.baselines.stages import Stages
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import Shot
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.baselines.efficient_light_probes.test_implementation import CAMERA, SMALL, mirror_floor
from tests.baselines.probes.test_narrowed import metal, saved
from tests.baselines.sites import RESOLUTION, lit_box, site, view
from tests.rendering import scenes

PLAIN = {"halved": False, "parameterization": "plain"}
"""What needs neither a scene's file nor a solver."""

CHEAP = PLAIN | {"texels": 4, "lightmap_spp": 16, "probe_width": 128, "probe_spp": 4}


@pytest.fixture(autouse=True, scope="module")
def let_go():
    """A scene that is alive is traced into the kernels of the next."""
    yield
    gc.collect()


def prepared(method, where, **given):
    names = {knob.name for knob in method.knobs}
    knobs = {name: value for name, value in (SMALL | given).items() if name in names}
    implementation = method.load()(method.settings(knobs))
    implementation.prepare(where)
    return implementation


def rendered(method, where, **given):
    stages = Stages()
    return prepared(method, where, **given).render(view(CAMERA), stages), stages


def adjusted(implementation, given):
    implementation.adjust(GPR.settings(SMALL | given))
    return implementation.render(view(CAMERA), Stages())


@pytest.fixture(scope="module")
def mirror(tmp_path_factory):
    """The method on the floor, cheaply baked, for what asks for no accuracy."""
    where = site(load_dict(mirror_floor(0.1)), tmp_path_factory.mktemp("mirror"))
    return prepared(GPR, where, **CHEAP)


@pytest.mark.parametrize(("roughness", "halved"), [(0.005, True), (0.5, False)])
def test_nearer_to_the_truth_than_the_nearest_probe(tmp_path, roughness, halved):
    """On a near-mirror the parallax is all there is to get right; on a rough floor there is little of it.

    The latter mirrors most of its light from beyond the image, which no filter over the screen brings in.
    """
    scene = saved(mirror_floor(roughness), tmp_path)
    where = site(scene, tmp_path)
    truth = render_frame(scene, CAMERA, resolution=RESOLUTION, spp=1024, channels=["radiance"]).arrays
    expected = truth["direct_specular"] + truth["indirect_specular"]

    def error(found):
        # Box and wall reflect up to 0.5, the lamp 8: its edge alone would decide a linear mean.
        return np.sqrt(np.mean((np.minimum(found.specular, 1) - np.minimum(expected, 1)) ** 2))

    ours, stages = rendered(GPR, where, parameterization="plain", halved=halved)
    naive, _ = rendered(NEAREST, where)
    assert np.isfinite(ours.color).all()
    assert error(ours) < (0.7 if roughness < 0.1 else 1.0) * error(naive)
    assert set(stages.seconds) == {"g-buffer", "ray casting", "gather", "filter"}
    assert ours.extra["found"] > 0.9


def test_adaptive_maps_show_the_same_image(tmp_path, monkeypatch):
    """One probe, whose texels are elsewhere: what differs is their noise, and edges, which are finer or coarser."""
    monkeypatch.setattr(
        placement, "place", lambda scene, count: np.array([[0.5, 0.6, 0.4]], dtype=np.float32)
    )
    where = site(saved(mirror_floor(0.1), tmp_path), tmp_path)
    knobs = CHEAP | {"probe_spp": 64}
    plain, _ = rendered(GPR, where, **knobs)
    adaptive, _ = rendered(GPR, where, **knobs | {"parameterization": "adaptive"})
    # What is found mirrors what is wanted as nearly as in the plain map.
    assert adaptive.extra["found"] > 0.9
    assert adaptive.extra["energy"] < 1.3 * plain.extra["energy"]
    one, other = (np.minimum(found.specular, 1) for found in (plain, adaptive))
    assert (one != other).any()
    np.testing.assert_allclose(other.mean(), one.mean(), rtol=0.05)


def test_without_gloss_the_image_is_the_diffuse_one(tmp_path):
    where = site(saved(scenes.closed_box(0.5, 1.0), tmp_path), tmp_path)
    found, _ = rendered(GPR, where, **CHEAP | {"halved": True})
    assert not found.specular.any()
    assert (found.color > 0).all()
    assert found.extra == {"found": 1.0, "energy": 0.0}


def test_a_camera_at_a_probe_sees_what_the_probe_does(tmp_path, monkeypatch):
    """The reprojection is the identity: the image is that of a plain lookup."""
    monkeypatch.setattr(
        placement, "place", lambda scene, count: np.array([CAMERA.position] * count, dtype=np.float32)
    )
    where = site(load_dict(mirror_floor(0.05)), tmp_path)
    knobs = CHEAP | {"probe_width": 256, "probes": 8, "used": 1, "filter": False}
    ours, _ = rendered(GPR, where, **knobs)
    plain, _ = rendered(NEAREST, where, **knobs)
    inner = plain.specular[:, :, 0] > 0
    off = np.abs(ours.specular - plain.specular)[inner]
    assert np.median(off) < 0.02 * plain.specular[inner].mean()
    # Half a texel: 1.2 cm on the floor 2 m away, and as much again in the walls.
    assert ours.extra["energy"] < 0.04


def test_a_scene_of_another_size_gives_the_same_image(tmp_path):
    def image(half, unit, folder):
        camera = PinholeCamera(
            (0.5 * half, 0.6 * half, 0.3 * half), (-0.4 * half, -0.5 * half, -0.8 * half), 1.2
        )
        scene = load_dict(lit_box(metal(0.1), half=half))
        implementation = prepared(GPR, site(scene, folder), **CHEAP, unit=unit)
        return implementation.render(view(camera), Stages()).specular

    once, other = image(1.0, 1.0, tmp_path / "one"), image(100.0, 100.0, tmp_path / "other")
    assert once.max() > 1
    # The probes are sampled anew, where rounding may place one beside where it was.
    assert np.sqrt(np.mean((once - other) ** 2)) < 0.05 * once.mean()


def test_knobs_that_do_not_bake_change_the_image_and_change_it_back(mirror):
    plain = adjusted(mirror, CHEAP).specular
    for given in (
        {"used": 1},
        {"window": 1},
        {"levels": 1},
        {"order": 0},
        {"unit": 0.01},
    ):
        assert np.abs(adjusted(mirror, CHEAP | given).specular - plain).max() > 1e-3, given
        np.testing.assert_array_equal(adjusted(mirror, CHEAP).specular, plain)
    # Probes of the whole roughness leave nothing to the filter.
    np.testing.assert_allclose(adjusted(mirror, CHEAP | {"filter": False}).specular, plain, atol=1e-3)


def test_two_steps_make_the_roughness_of_one(tmp_path):
    """Probes of half the roughness and the filter, against the truth, and against those without the filter.

    It takes noise of the probes away: with 64 paths in place of 4 their errors are alike here.
    """
    scene = saved(mirror_floor(0.4), tmp_path)
    where = site(scene, tmp_path)
    size = (64, 48)
    truth = render_frame(scene, CAMERA, resolution=size, spp=1024, channels=["radiance"]).arrays
    expected = np.minimum(truth["direct_specular"] + truth["indirect_specular"], 1)
    knobs = {"probe_spp": 4, "parameterization": "plain"}
    implementation = prepared(GPR, where, **knobs)

    def error(**given):
        implementation.adjust(GPR.settings(SMALL | knobs | given))
        found = implementation.render(View(Shot(CAMERA), None, size, 0, 0), Stages()).specular
        return np.sqrt(np.mean((np.minimum(found, 1) - expected) ** 2))

    assert error() < 0.85 * error(filter=False)


def test_the_frame_before_stands_in_where_no_probe_has_a_sample(mirror, monkeypatch):
    """Probes that do not show the floor: all comes from the frame that was, which the first does not have."""
    before = adjusted(mirror, CHEAP)
    gather = mirror.kernels["gather"]
    monkeypatch.setitem(mirror.kernels, "gather", lambda *arguments: _nothing(gather(*arguments)))
    following = View(Shot(CAMERA), Shot(CAMERA), RESOLUTION, 1, 0)
    again = mirror.render(following, Stages())
    np.testing.assert_allclose(again.specular, before.specular, atol=1e-4)
    alone = mirror.render(view(CAMERA), Stages())
    assert not alone.specular.any()
    assert alone.extra["found"] == 0
    # What was not known then is not known now.
    assert not mirror.render(following, Stages()).specular.any()


def _nothing(found):
    color, energy = found
    return mi.Color3f(0) * color, mi.Float(1e3) + 0 * energy


def test_very_bright_and_small_highlights_stay_finite(tmp_path):
    scene = mirror_floor(0.005)
    scene["spark"] = scenes.rectangle(
        [0, 0.3, 0.9], [0, 0, -1], (2e-3, 2e-3), emitter=scenes.area(1e7, 1e7, 1e7)
    )
    found, _ = rendered(GPR, site(load_dict(scene), tmp_path), **CHEAP)
    assert np.isfinite(found.color).all()
    assert (found.specular >= 0).all()
