"""What a light costs: moves and swaps in a furnished room, frames that each have another light, a thousand cameras."""

from __future__ import annotations

import gc
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from gibench.datasets.recipes import check_recipe
from gibench.datasets.room_making import LoadedRoom, sampled_room, written_room
from gibench.generators.shots import shot_of
from gibench.rendering.lighting import AreaLight, EnvironmentMap, Lighting
from gibench.rendering.panoramas import Panorama
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_scene
from tests.performance.turns import seconds
from tests.rendering.test_light_rig import kernels_compiled

pytestmark = pytest.mark.performance

FRAMES = 12
"""After two that compile and record."""


@pytest.fixture(scope="module")
def loaded(tmp_path_factory) -> LoadedRoom:
    """A furnished room with windows."""
    folder = Path(tmp_path_factory.mktemp("room"))
    recipe = check_recipe(
        {
            "kinds": ["living"],
            "environment": "sunsky",
            "lighting": "environments",
            "environments": "indoor",
            "views": 2,
        }
    )
    room = sampled_room(recipe, 0)
    written_room(room, folder, recipe)
    return LoadedRoom.of(recipe, room, folder)


def lightings(kind: str) -> list[Lighting]:
    rng = np.random.default_rng(0)
    if kind == "environment":
        return [
            Lighting(environment=EnvironmentMap(Panorama.of(str(n), rng.random((128, 256, 3)) ** 5), n))
            for n in range(FRAMES + 2)
        ]
    return [
        Lighting(
            AreaLight(
                rng.uniform((-0.5, -0.5, 1.1), (0.5, 0.5, 2.1)), rng.normal(size=3), 0.5, 0.4, (8, 8, 8)
            )
        )
        for _ in range(FRAMES + 2)
    ]


@pytest.mark.parametrize("kind", ["area light", "environment"])
def test_a_move_or_a_swap(loaded, kind):
    import drjit as dr

    assert loaded.rig is not None
    camera = shot_of(loaded.room, 0).camera
    wall, cpu = [], []

    def moved(lighting):
        """Light the scene anew, which is timed, and render what it shows, which is not."""
        dr.sync_thread()
        start, spent = time.perf_counter(), time.process_time()
        loaded.rig.set(lighting)
        dr.sync_thread()
        wall.append(time.perf_counter() - start)
        cpu.append(time.process_time() - spent)
        channels = ("radiance", "surface", "lighting")
        render_frame(loaded.scene, camera, resolution=(16, 16), spp=4, channels=channels)

    def recordings():
        return [replay.recordings for replay in loaded.scene.replays.values()]

    first, others = lightings(kind)[:2], lightings(kind)[2:]
    gc.collect()  # scenes that die in between change what kernels call
    with kernels_compiled():  # recordings are told apart by such settings too
        for lighting in first:
            moved(lighting)
    before = recordings()
    with kernels_compiled() as compiled:
        for lighting in others:
            moved(lighting)
        after = recordings()
    print(
        f"\n{kind}: {1e3 * np.median(wall[2:]):.0f} ms (median of {FRAMES}; {1e3 * np.median(cpu[2:]):.0f} ms of CPU; "
        f"{len(loaded.scene.shapes)} shapes), {compiled[0]} kernels compiled, {sum(after) - sum(before)} recordings"
    )
    assert np.median(cpu[2:]) <= 0.06
    assert compiled == [0]
    assert after == before


@pytest.mark.parametrize("denoise", [False, True])
@pytest.mark.parametrize("kind", ["area light", "environment"])
def test_frames_with_another_light_each_cost_little_beside_their_kernels(loaded, kind, denoise):
    import drjit as dr

    assert loaded.rig is not None
    camera = shot_of(loaded.room, 0).camera
    settings = {"resolution": (128, 128), "spp": 64, "denoise": denoise, "channels": ("radiance", "surface")}
    history = dr.flag(dr.JitFlag.KernelHistory)
    dr.set_flag(dr.JitFlag.KernelHistory, True)
    ratios, kernels = [], []
    try:
        for number, lighting in enumerate(lightings(kind)):
            dr.kernel_history_clear()
            start = time.perf_counter()
            loaded.rig.set(lighting)
            frame = render_frame(loaded.scene, camera, seed=number, **settings)
            wall = time.perf_counter() - start - frame.denoise_seconds
            inside = sum(kernel["execution_time"] for kernel in dr.kernel_history()) / 1e3
            ratios.append(wall / inside)
            kernels.append(inside)
    finally:
        dr.set_flag(dr.JitFlag.KernelHistory, history)
    print(
        f"\n{kind}, {'denoised' if denoise else 'not denoised'}: {np.median(ratios[2:]):.3f} × the time inside of the "
        f"kernels ({np.median(kernels[2:]):.2f} s a frame)"
    )
    assert np.median(ratios[2:]) <= 1.15


def test_cameras_of_the_file_cost_frames_nothing(tmp_path):
    """Rooms of presets whose light moves have a camera for each of a thousand views."""
    recipe = check_recipe({"kinds": ["living"], "views": 2})
    room = sampled_room(recipe, 0)
    written_room(room, tmp_path, recipe)
    file = tmp_path / "scene.xml"
    text = file.read_text()
    start, end = text.index("<sensor"), text.index("</sensor>") + len("</sensor>")
    sensor = text[start:end]
    cameras = "".join(sensor.replace('"camera.0"', f'"camera.{number}"') for number in range(1000))
    file.with_name("many.xml").write_text(f"{text[:start]}{cameras}</scene>")
    few, many = (load_scene(one, share_kernels=True) for one in (file, file.with_name("many.xml")))

    def frame(scene):
        render_frame(scene, shot_of(room, 0).camera, resolution=(8, 8), spp=1, channels=["color"])

    ours, other = seconds(partial(frame, few), partial(frame, many))
    print(f"\na small frame: {1e3 * ours:.0f} ms, of a file of a thousand cameras {1e3 * other:.0f} ms")
    assert other < 1.5 * ours
