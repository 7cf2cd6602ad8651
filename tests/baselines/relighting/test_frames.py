"""Frames of the methods that relight: finite, linear, black where it is dark, whatever lights the scene."""

from __future__ import annotations

import dataclasses
import gc
import weakref

import numpy as np
import pytest
import trimesh

from gibench.baselines.method import MethodError, View
from gibench.baselines.neural_free_viewpoint_relighting import METHOD as NFVR
from gibench.baselines.neural_precomputed_radiance_transfer import METHOD as NPRT
from gibench.baselines.precomputed_radiance_transfer import METHOD as HARMONICS
from gibench.baselines.relighting.surfaces import Box
from gibench.baselines.stages import Stages
from gibench.baselines.training.artifacts import WEIGHTS
from gibench.baselines.training.files import write_tensors
from gibench.baselines.vertex_features import METHOD as VERTICES
from gibench.baselines.vertex_features.implementation import MESH
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import EnvironmentMap, Lighting, Shot
from gibench.rendering.panoramas import HEIGHT, Panorama
from tests.baselines.material_strips import CAMERA, POLISHED, STRIPS, WALL, strips_parts, strips_rig
from tests.baselines.meshes import write_glb
from tests.baselines.sites import site

RESOLUTION = (40, 32)

METHODS = {
    "nfvr": (NFVR, {"network": "small", "faces": 16, "table": 12}),
    "vertex-features": (VERTICES, {"network": "small", "faces": 16}),
    "nprt": (NPRT, {}),
    "nprt:one-branch": (NPRT, {"separated": False}),
    "sh-prt": (HARMONICS, {"edge": 0.2, "reflected": 4, "paths": 64}),
}
"""Cards, and settings of small networks."""


@pytest.fixture(scope="module")
def rig():
    return strips_rig(panoramas=True)


@pytest.fixture(scope="module", params=METHODS)
def method(request, rig, tmp_path_factory):
    """With a network that has learned nothing."""
    return prepared(request.param, rig, tmp_path_factory.mktemp("method"))


def running(name, **settings):
    card, small = METHODS[name]
    return card.load()(card.settings({"spp": 4, "denoise": False, **small, **settings}))


def prepared(name, rig, folder, **settings):
    """The method after a training of no step, if it trains."""
    made = running(name, **settings)
    parts = ("full", "indirect")
    if not made.method.trains:
        write_glb(folder, strips_parts())
        made.prepare(dataclasses.replace(site(rig.scene, folder), rig=rig, parts=parts))
        return made
    box = Box((-1.5, -1.5, 0.0), (3.0, 3.0, 2.0))
    mesh = trimesh.creation.box((3, 3, 2))
    np.savez(folder / MESH, vertices=mesh.vertices, triangles=mesh.faces)
    made.surveyed(folder, box)
    weights = {"network": made.untrained(0).state_dict()}
    write_tensors(folder / WEIGHTS, {"weights": weights, "facts": box.facts()})
    made.prepare(dataclasses.replace(site(rig.scene, folder), weights=folder, rig=rig, parts=parts))
    return made


def noise(seed=0):
    return np.random.default_rng(seed).uniform(0, 2, (HEIGHT, 2 * HEIGHT, 3)).astype(np.float32)


def environment(pixels, rotation=0.0):
    return EnvironmentMap(Panorama.of("made", pixels), rotation)


def frame(rig, method, light, resolution=RESOLUTION, camera=CAMERA):
    lighting = Lighting(environment=light)
    rig.set(lighting)
    stages = Stages()
    found = method.render(View(Shot(camera, lighting), None, resolution, 0, 0), stages)
    assert {"ray casting", "g-buffer", "light", method.stage, "denoising"} == set(stages.seconds)
    for image in (found.color, found.indirect):
        assert image.shape == (resolution[1], resolution[0], 3)
        assert np.isfinite(image).all()
        assert (image >= 0).all()
    return found


def signed(method, light):
    """Indirect light before what is negative is cut off."""
    images = method._surfaces.read(CAMERA, RESOLUTION)
    view = View(Shot(CAMERA), None, RESOLUTION, 0, 0)
    return method.signed(images, view, method.told(method.light_of(light))).cpu().numpy()


def lamp(radiance, rows=1):
    pixels = np.full((HEIGHT, 2 * HEIGHT, 3), 1e-3, np.float32)
    pixels[20 : 20 + rows, 30 : 30 + rows] = radiance
    return pixels


MAPS = {
    "texel": lamp(1e5),
    "sun": lamp(4e4, 2),
    "white": np.ones((HEIGHT, 2 * HEIGHT, 3)),
    "noise": noise(),
}


@pytest.mark.parametrize("pixels", MAPS.values(), ids=MAPS)
def test_hard_environments_give_finite_light(rig, method, pixels):
    frame(rig, method, environment(pixels))


ROOMS = {
    "all matt": {"strips": {"matt": STRIPS["matt"]}, "rest": WALL},
    "all polished": {"strips": POLISHED, "rest": POLISHED["mirror"]},
}


@pytest.mark.parametrize("denoise", [False, True], ids=["plain", "denoised"])
@pytest.mark.parametrize("materials", ROOMS.values(), ids=ROOMS)
@pytest.mark.parametrize("name", METHODS)
def test_rooms_without_gloss_and_of_nothing_else(name, materials, denoise, tmp_path):
    """Under a sun too, which mirrors and metal of roughness .005 show as it is."""
    rig = strips_rig(panoramas=True, **materials)
    method = prepared(name, rig, tmp_path, denoise=denoise)
    for pixels in (noise(), MAPS["sun"]):
        assert frame(rig, method, environment(pixels)).color.any()
    # A network that has learned nothing may say less than nothing of all polished things.
    one, scaled = (signed(method, environment(scale * noise())) for scale in (1, 2.0**13))
    assert one.any()
    np.testing.assert_allclose(scaled, 2.0**13 * one, rtol=1e-5, atol=2.0**13 * 1e-7)


def test_a_whole_turn_changes_nothing(rig, method):
    one, turned = (frame(rig, method, environment(noise(), turn)).indirect for turn in (0.0, 2 * np.pi))
    np.testing.assert_allclose(one, turned, rtol=1e-5, atol=1e-6 * one.max())


def test_brighter_light_is_as_much_brighter_light(rig, method):
    """From 1e-4 to 1e4 times as bright."""
    one = frame(rig, method, environment(noise())).indirect
    assert one.any()
    for scale in (2.0**-13, 2.0**13):
        scaled = frame(rig, method, environment(scale * noise())).indirect
        np.testing.assert_allclose(scaled, scale * one, rtol=1e-5, atol=1e-7 * scale)


@pytest.mark.parametrize("denoise", [False, True], ids=["plain", "denoised"])
def test_a_black_environment_gives_black(rig, method, denoise):
    """Direct light too, and what a denoiser makes of both; and numbers of a frame that are numbers."""
    black = environment(np.zeros((HEIGHT, 2 * HEIGHT, 3)))
    method.adjust({**method.settings, "denoise": denoise})
    try:
        found = frame(rig, method, black)
    finally:
        method.adjust({**method.settings, "denoise": False})
    assert not found.color.any()
    assert not found.indirect.any()
    assert np.isfinite(list(found.extra.values())).all()


def test_pixels_that_see_no_surface_have_no_indirect_light(rig, method):
    up = PinholeCamera((0.0, 0.0, 3.0), (0.0, 0.1, 9.0), 1.0)
    found = frame(rig, method, environment(noise()), camera=up)
    assert not found.indirect.any()
    assert found.color.any()
    images = method._surfaces.read(CAMERA, RESOLUTION)
    seen = images["normal"].abs().sum(dim=0).numpy() > 0
    assert 0.1 < seen.mean() < 1
    assert not frame(rig, method, environment(noise())).indirect[~seen].any()


def test_a_frame_of_another_size(rig, method):
    frame(rig, method, environment(noise()), resolution=(120, 96))


@pytest.mark.parametrize("name", METHODS)
def test_it_goes_when_nobody_holds_it(rig, name, tmp_path):
    """It holds the scene, which must not be left to the collector of cycles."""
    method = prepared(name, rig, tmp_path)
    frame(rig, method, environment(noise()))
    held = weakref.ref(method)
    gc.disable()
    try:
        del method
        assert held() is None
    finally:
        gc.enable()


def test_denoising_changes_indirect_light_too(rig, method):
    plain = frame(rig, method, environment(noise())).indirect
    method.adjust({**method.settings, "denoise": True})
    try:
        clean = frame(rig, method, environment(noise()))
    finally:
        method.adjust({**method.settings, "denoise": False})
    assert (clean.indirect != plain).any()


def test_networks_that_are_not_there_or_damaged_and_other_light_are_named(rig, method, tmp_path):
    name = method.method.id
    if method.method.trains:
        check_trained(rig, name, tmp_path)
    with pytest.raises(
        MethodError, match=f"{name} is for frames under an environment .* run it on the track relight"
    ):
        method.render(View(Shot(CAMERA), None, RESOLUTION, 0, 0), Stages())


def check_trained(rig, name, tmp_path):
    bare = dataclasses.replace(site(rig.scene, tmp_path), rig=rig)
    with pytest.raises(MethodError, match=f"{name} has not been trained"):
        running(name).prepare(bare)
    (tmp_path / WEIGHTS).write_bytes(b"nothing")
    with pytest.raises(MethodError, match=r"cannot be read .* remove that folder"):
        running(name).prepare(dataclasses.replace(bare, weights=tmp_path))
