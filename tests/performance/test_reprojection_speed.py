"""What finding reflections in probes costs: the search of `elp-search` against gather and filter of `gpr`.

Guo et al. 2022, section 6: 6 ms against 20.5.
"""

from __future__ import annotations

import numpy as np
import pytest

from gibench.baselines.efficient_light_probes import SEARCH
from gibench.baselines.glossy_probe_reprojection import METHOD as GPR
from gibench.baselines.method import View
from gibench.baselines.stages import Stages
from gibench.generators.rooms import sample_room
from gibench.generators.scene_files import write_room
from gibench.rendering.backend import select_variant
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import Shot
from gibench.rendering.scene import load_scene

pytestmark = pytest.mark.performance

RESOLUTION = (320, 180)
FRAMES = 6
PROBES = {"probes": 32, "probe_width": 256, "probe_spp": 4, "texels": 8, "lightmap_spp": 16}


def test_the_search_and_the_gather_on_the_same_frames(tmp_path):
    from tests.baselines.sites import site

    select_variant("auto")
    built = sample_room(0, 0, kind="bathroom")
    write_room(built, tmp_path, max_depth=9, resolution=RESOLUTION, spp=1)
    cameras = [PinholeCamera(c.position, c.target, c.fov) for c in built.cameras]
    where = site(load_scene(tmp_path / "scene.xml", share_kernels=True), tmp_path)
    seconds = {}
    for method in (SEARCH, GPR):
        implementation = method.load()(method.settings(PROBES))
        implementation.prepare(where)
        stages = Stages()
        for frame in range(FRAMES + 2):
            if frame == 2:  # two that compile and record
                stages = Stages()
            implementation.render(
                View(Shot(cameras[frame % len(cameras)]), None, RESOLUTION, frame, frame), stages
            )
        seconds[method.id] = {name: 1e3 * spent / FRAMES for name, spent in stages.seconds.items()}
    search = seconds["elp-search"]["search"]
    both = seconds["gpr"]["gather"] + seconds["gpr"]["filter"]
    print(
        f"\nelp-search: {search:.0f} ms a search; gpr: {seconds['gpr']['gather']:.0f} ms to gather, "
        f"{seconds['gpr']['filter']:.0f} to filter: {both / search:.1f} times as long"
    )
    assert np.isfinite(both / search)
