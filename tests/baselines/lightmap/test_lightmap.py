"""The method `lightmap`, its files, and a real room."""

import numpy as np
import pytest

from gibench.baselines import lightmap
from gibench.baselines.lightmap.bake import baked_lightmap
from gibench.baselines.lightmap.lookup import ATLAS, CORNERS, read_lightmap, write_lightmap
from gibench.baselines.lightmap.unwrapping import LightmapError
from gibench.baselines.stages import Stages
from gibench.generators.rooms import sample_room
from gibench.generators.scene_files import write_room
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict, load_scene
from tests.baselines.meshes import diffuse, looked_up, room, slab
from tests.baselines.sites import site, view
from tests.rendering import scenes

CAMERA = PinholeCamera((0.7, 0.8, 0.3), (-0.5, -0.6, -0.4), 1.2)


def lit_room(**more):
    lamp = scenes.rectangle([0.2, 0, 0.98], [0, 0, -1], (0.3, 0.3), emitter=scenes.area(8, 7, 6))
    return load_dict({"type": "scene", **room(diffuse(0.7, 0.6, 0.5)), "lamp": lamp, **more})


def prepared(scene, folder, **given):
    settings = lightmap.METHOD.settings({"texels": 16, "lightmap_spp": 256} | given)
    method = lightmap.METHOD.load()(settings)
    method.prepare(site(scene, folder))
    return method


def test_agrees_with_the_path_tracer_where_all_is_diffuse(tmp_path):
    scene = lit_room(box=slab([-0.6, -0.6, -1.001], [-0.1, -0.1, -0.4], diffuse(0.2, 0.5, 0.7)))
    stages = Stages()
    found = prepared(scene, tmp_path).render(view(CAMERA, resolution=(48, 36)), stages)
    truth = render_frame(
        scene, CAMERA, resolution=(48, 36), channels=["color"], spp=256, denoise=True
    ).arrays["color"]
    assert found.color.shape == (36, 48, 3)
    assert found.color.dtype == np.float32
    assert not found.specular.any()
    assert found.color.mean() == pytest.approx(truth.mean(), rel=0.01)
    error = np.abs(found.color - truth).mean(axis=-1) / truth.mean()
    # Edges of shadows are as soft as a texel.
    assert np.sqrt(np.mean(np.minimum(error, 1) ** 2)) < 0.06
    assert list(stages.seconds) == ["g-buffer"]


@pytest.mark.parametrize(
    ("low", "high", "dtype"), [(0.2, 30.0, np.float16), (0.2, 1e6, np.float32), (1e-7, 1e-6, np.float32)]
)
def test_the_file_keeps_what_half_floats_cannot(tmp_path, low, high, dtype):
    import OpenEXR

    atlas = np.random.default_rng(0).uniform(low, high, (16, 16, 3)).astype(np.float32)
    atlas[:4] = 0
    write_lightmap(tmp_path, atlas, np.zeros((1, 3, 2), np.float32), np.zeros(2, np.uint32))
    stored = OpenEXR.File(str(tmp_path / ATLAS)).channels()["RGB"].pixels
    assert stored.dtype == dtype
    np.testing.assert_allclose(stored, atlas, rtol=1e-3)


def test_agrees_with_the_path_tracer_in_a_furnished_room(tmp_path):
    """The diffuse channels of a generated room, in blocks of pixels, against noise and texture in them."""
    # A small one: most of the time goes into filtering charts, of which it has few.
    sampled = sample_room(2, 0, kind="bathroom", width=3.0, depth=3.5, height=2.3, views=1)
    write_room(sampled, tmp_path)
    scene = load_scene(tmp_path / "scene.xml")
    camera = sampled.cameras[0].pinhole
    options = {"resolution": (64, 48), "channels": ["radiance"], "spp": 256}
    truth = render_frame(scene, camera, **options).arrays
    wanted = truth["emission"] + truth["direct_diffuse"] + truth["indirect_diffuse"]
    method = prepared(scene, tmp_path, texels=8, lightmap_spp=256, rays=16)
    found = method.render(view(camera, resolution=(64, 48)), Stages()).color
    bright = np.minimum(np.stack([found, wanted]), 5 * np.median(wanted))
    blocks = bright.reshape(2, 6, 8, 8, 8, 3).mean(axis=(2, 4, 5))
    bias = blocks[0].mean() / blocks[1].mean() - 1
    error = np.sqrt(np.mean((blocks[0] - blocks[1]) ** 2)) / blocks[1].mean()
    print(f"bias {bias:.3f}, relative error of blocks {error:.3f}")
    # In a larger room the bias spread by some 1.5 % over seeds of the bake.
    assert abs(bias) < 0.04
    assert error < 0.1


def test_finer_rays_serve_the_same_bake(tmp_path):
    scene = lit_room()
    method = prepared(scene, tmp_path, lightmap_spp=16)
    coarse = method.render(view(CAMERA), Stages()).color
    method.adjust(lightmap.METHOD.settings({"texels": 16, "lightmap_spp": 16, "rays": 16}))
    fine = method.render(view(CAMERA), Stages()).color
    assert fine.shape == coarse.shape
    assert 0 < np.abs(fine - coarse).mean() < 0.1 * fine.mean()


def test_replayed_frames_follow_the_camera(tmp_path):
    """The kernel of the first frame is replayed for the others, with all that changes between them."""
    scene = lit_room()
    other = PinholeCamera((-0.7, 0.5, 0.1), (0.5, -0.6, -0.9), 0.9)
    method = prepared(scene, tmp_path, lightmap_spp=16)
    frames = [method.render(view(camera), Stages()).color for camera in (CAMERA, other, CAMERA)]
    again = prepared(scene, tmp_path, lightmap_spp=16).render(view(other), Stages()).color
    np.testing.assert_array_equal(frames[0], frames[2])
    np.testing.assert_array_equal(frames[1], again)
    assert np.abs(frames[0] - frames[1]).mean() > 0.01


def test_a_bake_is_shared_and_comes_back_from_its_files(tmp_path):
    scene, where = lit_room(), site(lit_room(), tmp_path)
    settings = lightmap.METHOD.settings({"texels": 4, "lightmap_spp": 16})
    first = baked_lightmap(where, settings)
    folder = where.bakes.used[0].folder
    written = (folder / ATLAS).stat().st_mtime_ns
    second = baked_lightmap(where, settings | {"rays": 1})
    assert (folder / ATLAS).stat().st_mtime_ns == written
    assert len(where.bakes.used) == 1
    assert where.bakes.used[0].size > 1000
    rays = (np.zeros((50, 3)), np.random.default_rng(0).normal(size=(50, 3)))
    for a, b in zip(looked_up(first, scene, *rays), looked_up(second, scene, *rays), strict=True):
        np.testing.assert_array_equal(a, b)


def test_damaged_files_are_refused(tmp_path):
    scene = lit_room()
    where = site(scene, tmp_path)
    baked_lightmap(where, lightmap.METHOD.settings({"texels": 4, "lightmap_spp": 16}))
    folder = where.bakes.used[0].folder
    with pytest.raises(LightmapError, match="another scene"):
        read_lightmap(
            folder,
            load_dict(
                {
                    "type": "scene",
                    **room(diffuse(0.5), prefix="a"),
                    "b": {"type": "cube"},
                    "c": {"type": "cube"},
                }
            ),
        )
    (folder / CORNERS).write_bytes(b"")
    with pytest.raises(LightmapError, match="remove"):
        read_lightmap(folder, scene)
    (folder / ATLAS).write_bytes(b"no image")
    with pytest.raises(LightmapError, match="remove"):
        read_lightmap(folder, scene)


def test_a_scene_without_diffuse_surfaces(tmp_path):
    mirrors = load_dict({"type": "scene", **room(scenes.MATERIALS["metal"], emitter=scenes.area(1.0))})
    found = prepared(mirrors, tmp_path).render(view(CAMERA), Stages())
    np.testing.assert_allclose(found.color, 1.0, rtol=1e-6)
