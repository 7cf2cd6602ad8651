"""What probes cost: paths a second while they are baked, and milliseconds a frame for the methods that read them."""

from __future__ import annotations

import statistics
import time

import numpy as np
import pytest

from gibench.baselines.method import View
from gibench.baselines.nearest_probe import METHOD as NEAREST
from gibench.baselines.path_traced import METHOD as PATH_TRACED
from gibench.baselines.stages import Stages
from gibench.baselines.unstructured_lumigraph import METHOD as ULR
from gibench.generators.rooms import sample_room
from gibench.generators.scene_files import write_room
from gibench.rendering.backend import select_variant
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import Shot
from gibench.rendering.scene import load_scene

pytestmark = pytest.mark.performance

RESOLUTION = (320, 180)
FRAMES = 8
PROBES = {"probes": 32, "probe_width": 128, "probe_spp": 16, "texels": 8, "lightmap_spp": 16}


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    select_variant("auto")
    folder = tmp_path_factory.mktemp("room")
    built = sample_room(0, 0, kind="living")
    write_room(built, folder, max_depth=9, resolution=RESOLUTION, spp=1)
    cameras = [PinholeCamera(c.position, c.target, c.fov) for c in built.cameras]
    return load_scene(folder / "scene.xml", share_kernels=True), cameras, folder


def test_paths_a_second_while_probes_are_baked(room):
    from gibench.baselines.probes.baking import ProbeSettings
    from gibench.baselines.probes.maps import load_probes
    from tests.baselines.sites import site

    scene, _, folder = room
    for spp in (16, 64):
        where = site(scene, folder / str(spp))
        probes = load_probes(where, ProbeSettings(32, 128, 64, spp), ("radiance",))
        seconds = where.bakes.used[-1].seconds
        paths = probes.count * 128 * 64 * spp
        rate = f"{seconds:.1f} s, {paths / seconds / 1e6:.2f} M paths/s"
        print(f"\n{probes.count} probes of 128 × 64 at {spp} paths a texel: {rate}")


@pytest.mark.parametrize(
    ("method", "knobs"),
    [
        (NEAREST, PROBES),
        (ULR, PROBES),
        *((PATH_TRACED, {"spp": spp, "denoise": False}) for spp in (1, 2, 4, 8)),
        (PATH_TRACED, {"spp": 2}),
    ],
    ids=lambda value: (
        getattr(value, "id", None)
        or " ".join(f"{k}={v}" for k, v in value.items() if k in ("spp", "denoise"))
    ),
)
def test_milliseconds_a_frame(room, method, knobs):
    from tests.baselines.sites import site

    scene, cameras, folder = room
    implementation = method.load()(method.settings(knobs))
    implementation.prepare(site(scene, folder))
    times, stages = [], Stages()
    for frame in range(FRAMES + 2):
        if frame == 2:  # two that compile and record
            stages = Stages()
        start = time.perf_counter()
        implementation.render(
            View(Shot(cameras[frame % len(cameras)]), None, RESOLUTION, frame, frame), stages
        )
        times.append(time.perf_counter() - start)
    parts = ", ".join(f"{name} {1e3 * seconds / FRAMES:.0f}" for name, seconds in stages.seconds.items())
    print(f"\n{method.id}: {1e3 * statistics.median(times[2:]):.0f} ms a frame ({parts})")
    assert np.isfinite(times).all()
