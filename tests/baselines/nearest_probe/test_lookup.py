"""The naive lookup: what the nearest probe sees of a point, no more."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.nearest_probe import METHOD
from gibench.baselines.nearest_probe.lookup import NearestProbe
from gibench.baselines.probes.baking import ProbeSettings
from gibench.baselines.probes.maps import load_probes
from gibench.baselines.stages import Stages
from gibench.rendering.camera import PinholeCamera, RayGenerator
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.baselines.probes.test_mappings import columns
from tests.baselines.probes.test_maps import written
from tests.baselines.sites import RESOLUTION, site, view
from tests.rendering import scenes

SMALL = {
    "texels": 4,
    "lightmap_spp": 16,
    "lightmap_denoise": False,
    "probes": 8,
    "probe_width": 64,
    "probe_spp": 4,
    "rays": 1,
}


def prepared(scene, folder, **knobs):
    method = METHOD.load()(METHOD.settings(SMALL | knobs))
    where = site(scene, folder)
    method.prepare(where)
    return method, where


def glossy_box():
    """Closed, so that light is all around, with a glossy floor."""
    description = scenes.closed_box(0.5, 1.0)
    for name, shape in description.items():
        if name == "wall2-1":
            shape["bsdf"] = scenes.MATERIALS["metal"]
            del shape["emitter"]
    return description


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    return load_dict(glossy_box()), tmp_path_factory.mktemp("box")


def test_a_camera_at_a_probe_sees_what_the_probe_sees(box):
    """Specular is the probe's own map along the camera's rays, wherever something glossy is hit."""
    scene, folder = box
    method, where = prepared(scene, folder)
    probes = load_probes(where, ProbeSettings(8, 64, 32, 4), ("radiance",))
    position = columns(probes.position(mi.UInt32(3)))[0]
    camera = PinholeCamera(tuple(map(float, position)), (0.2, 0.1, -1.0), 1.2)
    found = method.render(view(camera), Stages()).specular
    x, y = np.meshgrid(np.arange(RESOLUTION[0]) + 0.5, np.arange(RESOLUTION[1]) + 0.5)
    rays = RayGenerator(camera, RESOLUTION).rays(mi.Point2f(mi.Float(x.ravel()), mi.Float(y.ravel())))
    expected = columns(probes.bilinear("radiance", mi.UInt32(3), rays.d)).reshape(found.shape)
    hits = scene.mi_scene.ray_intersect(rays)
    floor = (np.array(hits.p)[2] < -0.999).reshape(found.shape[:2])
    assert floor.any()
    np.testing.assert_allclose(found[floor], expected[floor], rtol=1e-3, atol=1e-4)
    assert not found[~floor].any()


def test_the_nearest_probe_is_taken_and_nothing_asks_whether_it_sees_the_point(tmp_path):
    colors = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    probes = written(
        tmp_path,
        [[0, 0, 0], [4, 0, 0], [8, 0, 0]],
        radiance=(lambda probe, d: np.tile(colors[probe], (len(d), 1)), np.float16),
    )
    points = mi.Point3f(np.random.default_rng(0).uniform(-9, 9, (3, 50)).astype(np.float32))
    for camera, probe in (((1.9, 3, 0), 0), ((2.1, 3, 0), 1), ((90, 0, 0), 2)):
        found = columns(NearestProbe.glossy(probes, points, mi.Point3f(*camera), mi.Bool(True), {}))
        np.testing.assert_allclose(found, np.tile(colors[probe], (50, 1)), atol=1e-6)


def test_without_gloss_specular_is_zero(tmp_path):
    method, _ = prepared(load_dict(scenes.closed_box(0.5, 1.0)), tmp_path)
    found = method.render(view(PinholeCamera((0.1, 0, 0), (1, 0.2, 0.1), 1.0)), Stages())
    assert not found.specular.any()
    assert (found.color > 0).all()


def test_color_is_emission_and_diffuse_and_specular(tmp_path):
    """Against the reference without its specular part: the lightmap's error is all there is."""
    scene = load_dict(glossy_box())
    method, _ = prepared(scene, tmp_path, lightmap_spp=256, texels=8)
    camera = PinholeCamera((0.1, 0.0, 0.0), (1.0, 0.2, -0.6), 1.2)
    found = method.render(view(camera), Stages())
    truth = render_frame(scene, camera, resolution=RESOLUTION, spp=256, channels=["radiance"]).arrays
    expected = truth["emission"] + truth["direct_diffuse"] + truth["indirect_diffuse"]
    matte = found.color - found.specular
    np.testing.assert_allclose(np.median(matte / np.maximum(expected, 1e-3)[..., :]), 1, atol=0.05)
    assert np.isfinite(found.color).all()
    assert (found.color >= found.specular).all()


def test_one_preparation_serves_all_numbers_of_rays(box):
    scene, folder = box
    method, _ = prepared(scene, folder)
    camera = PinholeCamera((0.1, 0.0, 0.0), (1.0, 0.2, -0.6), 1.2)
    sharp, fine = [], []
    for rays, frames in ((1, sharp), (16, fine), (1, sharp)):
        method.adjust(METHOD.settings(SMALL | {"rays": rays}))
        frames.append(method.render(view(camera), Stages()).color)
    np.testing.assert_array_equal(*sharp)
    assert fine[0].shape == sharp[0].shape
    assert 0 < np.abs(fine[0] - sharp[0]).mean() < 0.1 * sharp[0].mean()


def test_stages_and_bakes(box):
    scene, folder = box
    method, where = prepared(scene, folder)
    assert {bake.kind for bake in where.bakes.used} == {"lightmap", "probes"}
    stages = Stages()
    method.render(view(PinholeCamera((0, 0, 0), (1, 0, 0), 1.0)), stages)
    assert set(stages.seconds) == {"g-buffer", "gather"}
