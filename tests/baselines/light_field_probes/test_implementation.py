"""The method `light-field-probes` as a whole, on scenes whose answer is known."""

from __future__ import annotations

import gc

import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.light_field_probes import METHOD
from gibench.baselines.nearest_probe import METHOD as NEAREST
from gibench.baselines.stages import Stages
from gibench.rendering.camera import PinholeCamera, RayGenerator
from gibench.rendering.scene import load_dict
from tests.baselines.efficient_light_probes.test_implementation import SMALL, error, rendered, true_gloss
from tests.baselines.glossy_rooms import CAMERA, glossy_room
from tests.baselines.sites import RESOLUTION, emitted, lit_box, site, view, where_rays_leave
from tests.rendering import scenes

MIRROR = {"type": "conductor", "material": "none", "specular_reflectance": scenes.rgb(0.8)}


@pytest.fixture(autouse=True)
def _let_go():
    """Every scene that is alive is traced into the kernels of later tests."""
    yield
    gc.collect()


def metal(roughness):
    return {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": roughness}


@pytest.mark.parametrize("roughness", [0.005, 0.5])
def test_nearer_to_the_truth_than_the_nearest_probe(tmp_path, roughness):
    scene = glossy_room(metal(roughness))
    where = site(scene, tmp_path)
    expected = true_gloss(scene, 512)
    # On a rough floor the lamp is found by chance: rays enough that its noise is not what is compared.
    ours, stages = rendered(METHOD, where, glossy_rays=16, rays=1 if roughness < 0.1 else 4)
    naive, _ = rendered(NEAREST, where)
    assert np.isfinite(ours.color).all()
    assert (ours.color >= 0).all()
    assert error(ours, expected) < (0.5 if roughness < 0.1 else 0.9) * error(naive, expected)
    assert set(stages.seconds) == {"g-buffer", "search", "denoising"}
    assert ours.extra["unknown_rays"] < 0.05
    assert ours.extra["texels_per_ray"] > 1


def test_a_mirror_shows_the_walls(tmp_path):
    """Walls of one radiance each, seen in a floor of 0.8: exact but where a texel or a pixel sees two of them."""
    camera = PinholeCamera((0.2, -0.6, 0.4), (-0.1, 0.3, -1.0), 1.0)
    found, _ = rendered(
        METHOD, site(load_dict(lit_box(MIRROR)), tmp_path), camera, denoise=False, glossy_rays=1
    )
    x, y = np.meshgrid(np.arange(RESOLUTION[0]) + 0.5, np.arange(RESOLUTION[1]) + 0.5)
    ray = RayGenerator(camera, RESOLUTION).rays(mi.Point2f(mi.Float(x.ravel()), mi.Float(y.ravel())))
    origin, towards = np.array(ray.o).T.astype(float), np.array(ray.d).T.astype(float)
    hit, face = where_rays_leave(np.broadcast_to(origin, towards.shape), towards)
    floor = (face == (2, -1)).all(axis=1)
    _, mirrored = where_rays_leave(hit * (1 - 1e-6), towards * [1, 1, -1])
    expected = np.array(
        [emitted(*which) if on else (0, 0, 0) for which, on in zip(mirrored, floor, strict=True)]
    )
    specular = found.specular.reshape(-1, 3)
    assert not specular[~floor].any()
    right = (np.abs(specular - 0.8 * expected) < 0.02).all(axis=1)
    assert floor.sum() > 300
    assert right[floor].mean() > 0.9


def test_without_gloss_the_image_is_the_diffuse_one(tmp_path):
    found, _ = rendered(METHOD, site(load_dict(scenes.closed_box(0.5, 1.0)), tmp_path))
    assert not found.specular.any()
    assert (found.color > 0).all()
    assert found.extra == {"texels_per_ray": 0, "unknown_rays": 0}


def test_what_leaves_the_scene_sees_the_environment(tmp_path):
    """A mirror on the floor of a box that is open to one side, under a sky of one radiance."""
    description = lit_box(MIRROR)
    del description["wall0+"]
    description["sky"] = {"type": "constant", "radiance": scenes.rgb(7.0)}
    camera = PinholeCamera((-0.8, 0.0, -0.6), (0.2, 0.0, -1.0), 0.2)
    found, _ = rendered(METHOD, site(load_dict(description), tmp_path), camera, denoise=False, glossy_rays=1)
    assert found.extra["unknown_rays"] < 0.02
    assert (np.abs(found.specular - 0.8 * 7.0) < 1e-3).mean() > 0.97


def test_one_preparation_serves_all_settings_that_do_not_bake(tmp_path):
    where = site(glossy_room(metal(0.2)), tmp_path)
    method = METHOD.load()(METHOD.settings(SMALL))
    method.prepare(where)
    images = {}
    for given in ({"glossy_rays": 1}, {"glossy_rays": 8, "denoise": False}, {"glossy_rays": 1}):
        method.adjust(METHOD.settings(SMALL | given))
        found = method.render(view(CAMERA), Stages())
        key = tuple(given.items())
        if key in images:
            np.testing.assert_array_equal(found.specular, images[key])
        images[key] = found.specular
    first, second = images.values()
    assert np.abs(first - second).max() > 0.01
