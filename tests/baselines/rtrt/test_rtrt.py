"""Glossy paths over the lightmap, against mirrors, the path tracer and energy."""

from dataclasses import replace

import numpy as np
import pytest

from gibench.baselines import rtrt
from gibench.baselines.stages import Stages
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.baselines.glossy_rooms import CAMERA, LIGHTMAP, glossy_room, mirror_image, rendered
from tests.baselines.meshes import diffuse, slab
from tests.baselines.sites import site, view
from tests.rendering import scenes, test_portals

RESOLUTION = (40, 30)
RAW = {"denoise": False, "lightmap_denoise": True}


def mirror(tint):
    return scenes.two_sided(type="conductor", material="none", specular_reflectance=scenes.rgb(tint))


@pytest.mark.parametrize("samples", [1, 4])
def test_a_mirror_shows_the_lightmap(tmp_path, samples):
    scene = glossy_room(mirror(0.8))
    where = site(scene, tmp_path)
    found = rendered(rtrt.METHOD, where, RESOLUTION, samples=samples, **RAW)
    np.testing.assert_allclose(
        found.specular, mirror_image(scene, where, RESOLUTION, 2, 0.8), rtol=2e-3, atol=1e-4
    )


def test_nothing_glossy_is_exactly_nothing(tmp_path):
    scene = glossy_room(diffuse(0.5))
    for denoise in (False, True):
        found = rendered(rtrt.METHOD, site(scene, tmp_path), RESOLUTION, denoise=denoise)
        assert not found.specular.any()
    truth = render_frame(scene, CAMERA, resolution=RESOLUTION, channels=["color"], spp=256, denoise=True)
    assert found.color.mean() == pytest.approx(truth.arrays["color"].mean(), rel=0.015)


@pytest.mark.parametrize("material", ["coat", "metal"])
def test_specular_light_has_the_path_tracers_mean(tmp_path, material):
    """One glossy surface, diffuse elsewhere: three bounces miss nothing, so only noise and texels are left."""
    scene = glossy_room(scenes.MATERIALS[material])
    found = rendered(rtrt.METHOD, site(scene, tmp_path), RESOLUTION, samples=16, rays=16, **RAW).specular
    truth = render_frame(scene, CAMERA, resolution=RESOLUTION, channels=["radiance"], spp=1024, seed=3).arrays
    wanted = truth["direct_specular"] + truth["indirect_specular"]
    np.testing.assert_allclose(found.mean(axis=(0, 1)), wanted.mean(axis=(0, 1)), rtol=0.03)
    blocks = np.stack([found, wanted]).reshape(2, 6, 5, 8, 5, 3).mean(axis=(2, 4))
    # Near the lamp's highlight both are noisy.
    assert np.sqrt(np.mean((blocks[0] - blocks[1]) ** 2)) < 0.05 * blocks[1].max()


def test_rough_mirror_in_a_furnace(tmp_path):
    """Under an even sky light samples and lobe samples must add up to one estimate, not two."""
    scene = load_dict(
        {
            "type": "scene",
            "sky": {"type": "constant", "radiance": scenes.rgb(1.0)},
            "floor": slab([-5, -5, -2], [5, 5, -1], scenes.MATERIALS["metal"]),
        }
    )
    truth = render_frame(scene, CAMERA, resolution=RESOLUTION, channels=["radiance"], spp=256).arrays
    found = rendered(rtrt.METHOD, site(scene, tmp_path), RESOLUTION, samples=16, **RAW)
    wanted = truth["direct_specular"] + truth["indirect_specular"]
    np.testing.assert_allclose(found.specular.mean(axis=(0, 1)), wanted.mean(axis=(0, 1)), rtol=0.005)


def test_facing_mirrors_count_bounces(tmp_path):
    """Between two mirrors every further bounce shows the lamp at the end of the path once more."""
    walls = {
        "lower": slab([-3, -3, -1.2], [3, 3, -1], mirror(0.5)),
        "upper": slab([-3, -3, 1], [3, 3, 1.2], mirror(0.5)),
        "sky": {"type": "constant", "radiance": scenes.rgb(1.0)},
    }
    scene = load_dict({"type": "scene", **walls})
    steep = PinholeCamera((0.0, 0.0, 0.0), (0.7, 0.0, -1.0), 0.02)
    # Down at 1.43 m, up at 2.86 m: the paths leave between the mirrors after lower, upper, lower.
    light = {}
    for bounces in (1, 2, 3):
        method = rtrt.METHOD.load()(rtrt.METHOD.settings(LIGHTMAP | RAW | {"bounces": bounces, "rays": 1}))
        method.prepare(site(scene, tmp_path, name=str(bounces)))
        light[bounces] = method.render(view(steep, resolution=(4, 4)), Stages()).specular
    assert not light[1].any()
    assert light[2].max() == pytest.approx(light[2].min())
    np.testing.assert_allclose(light[2], 0.25, rtol=1e-4)
    np.testing.assert_allclose(light[3], 0.25, rtol=1e-4)


def test_frames_differ_by_their_seed_alone(tmp_path):
    scene = glossy_room(scenes.MATERIALS["metal"])
    where = site(scene, tmp_path)
    method = rtrt.METHOD.load()(rtrt.METHOD.settings(LIGHTMAP | RAW | {"rays": 1}))
    method.prepare(where)
    frames = [
        method.render(view(CAMERA, seed=seed, resolution=RESOLUTION), Stages()).specular for seed in (1, 2, 1)
    ]
    np.testing.assert_array_equal(frames[0], frames[2])
    assert np.abs(frames[0] - frames[1]).mean() > 0.01 * frames[0].mean()


def test_denoising_brings_frames_nearer_to_the_truth(tmp_path):
    scene = glossy_room(scenes.MATERIALS["metal"])
    where = site(scene, tmp_path)
    truth = rendered(rtrt.METHOD, where, RESOLUTION, samples=16, rays=16, denoise=False).specular
    method = rtrt.METHOD.load()(rtrt.METHOD.settings(LIGHTMAP | {"samples": 1, "rays": 1}))
    method.prepare(where)
    stages = Stages()
    smooth = method.render(view(CAMERA, resolution=RESOLUTION), stages).specular
    assert list(stages.seconds) == ["g-buffer", "ray casting", "denoising"]
    method.adjust(rtrt.METHOD.settings(LIGHTMAP | {"samples": 1, "rays": 1, "denoise": False}))
    rough = method.render(view(CAMERA, resolution=RESOLUTION), Stages()).specular
    bright = 3 * truth.mean()

    def error(image):
        return np.sqrt(np.mean((np.minimum(image, bright) - np.minimum(truth, bright)) ** 2))

    assert error(smooth) < 0.8 * error(rough)


def test_lights_are_sampled_as_the_path_tracer_samples_them(tmp_path):
    """By daylight through two openings both spend their light samples on these: alike without noise, alike with it."""
    closed = test_portals.room()
    closed["floor"] = scenes.rectangle([0, 0, 0], [0, 0, 1], (1, 1), bsdf=scenes.MATERIALS["metal"])
    del closed["lamp"]
    # An even sky, which lobe samples alone would find by chance.
    closed["sky"] = {"type": "constant", "radiance": scenes.rgb(5.0)}
    camera = PinholeCamera((-0.9, -0.9, 1.5), (0.2, 0.2, 0.0), 0.6)

    def direct_light(scene, name):
        method = rtrt.METHOD.load()(
            rtrt.METHOD.settings(
                {"texels": 4, "lightmap_spp": 16, "samples": 16, "bounces": 1, "rays": 1} | RAW
            )
        )
        method.prepare(site(scene, tmp_path, name=name))
        frames = [
            method.render(view(camera, seed=seed, resolution=(16, 12)), Stages()).specular
            for seed in range(8)
        ]
        return np.array(frames, dtype=np.float64)

    scene = load_dict(closed)
    with_portals = replace(scene, openings=test_portals.OPENINGS_OF_ROOM)
    by_chance, aimed = direct_light(scene, "chance"), direct_light(with_portals, "aimed")
    error = np.sqrt(by_chance.var(axis=0, ddof=1).mean() / len(by_chance) / by_chance[0].size)
    assert abs(by_chance.mean() - aimed.mean()) < 5 * error + 0.01 * aimed.mean()
    noise = [frames.var(axis=0, ddof=1).mean() for frames in (by_chance, aimed)]
    assert noise[1] < 0.6 * noise[0], noise
