"""Baking a lightmap should be path tracing and little else."""

from __future__ import annotations

import time

import pytest

from gibench.rendering.backend import select_variant

select_variant("auto")  # before what loads Dr.Jit, which must know by then where LLVM is

from gibench.baselines.lightmap.bake import bake_atlas  # noqa: E402
from gibench.generators.rooms import sample_room  # noqa: E402
from gibench.generators.scene_files import write_room  # noqa: E402
from gibench.rendering.camera import PinholeCamera  # noqa: E402
from gibench.rendering.estimate import estimate_radiance  # noqa: E402
from gibench.rendering.scene import load_scene  # noqa: E402

pytestmark = pytest.mark.performance


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    folder = tmp_path_factory.mktemp("room")
    write_room(sampled := sample_room(3, 0), folder)
    camera = sampled.cameras[0]
    scene = load_scene(folder / "scene.xml", share_kernels=True)
    return scene, PinholeCamera(tuple(camera.position), tuple(camera.target), camera.fov)


@pytest.mark.parametrize("texels", [8, 16])
def test_bake_against_render(room, texels):
    """Paths from texels against paths from a camera, at the same depth; and what comes before and after them."""
    scene, camera = room
    spp = 64
    for _ in range(2):  # the first compiles
        start = time.perf_counter()
        baked = bake_atlas(scene, texels_per_metre=texels, spp=spp, denoise=True)
        seconds = time.perf_counter() - start
        frame = estimate_radiance(scene, camera, (320, 200), spp=spp)
    texel_rate = baked.traced * spp / baked.seconds["paths"]
    frame_rate = 320 * 200 * spp / frame.seconds
    steps = ", ".join(f"{name} {value:.2f} s" for name, value in baked.seconds.items())
    print(
        f"\n{texels} texels a metre: {baked.traced} texels, atlas {baked.atlas.shape[1]} × {baked.atlas.shape[0]}"
        f"\n{steps}; {spp} paths a texel: {100 * baked.seconds['paths'] / seconds:.0f} % of {seconds:.2f} s is tracing"
        f"\n{texel_rate / 1e6:.2f} million paths/s, from a camera {frame_rate / 1e6:.2f}, "
        f"ratio {texel_rate / frame_rate:.2f}"
    )
