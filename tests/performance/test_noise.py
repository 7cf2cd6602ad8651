"""Noise times time: guided and plain paths against Mitsuba's `path`, in ten rooms by night and by day."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gibench.rendering.backend import select_variant
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.guiding import learning as learning_module
from gibench.rendering.render import render_frame
from gibench.rendering.scene import GUIDED, load_scene
from gibench.stress import views

pytestmark = pytest.mark.performance

ROOMS = int(os.environ.get("GIBENCH_NOISE_ROOMS", "10"))
REPEATS = int(os.environ.get("GIBENCH_NOISE_REPEATS", "12"))
RESOLUTION, SPP = (96, 64), 64

SCENES = ("kitchen", "living-room", "staircase")
"""Files of papers."""

FRAMES = 24
"""Frames that share the cost of what a room's guide takes to learn, of 256 × 192 pixels."""

FRAME_PATHS = 256 * 192 * SPP


@pytest.fixture(scope="module", autouse=True)
def variant():
    return select_variant("auto")


def _room(index, folder):
    from gibench.generators.rooms import sample_room
    from gibench.generators.scene_files import write_room

    room = sample_room(0, index, views=1, environment="sunsky" if index % 2 else "none")
    write_room(room, folder)
    camera = room.cameras[0]
    return room, load_scene(folder / "scene.xml"), PinholeCamera(camera.position, camera.target, camera.fov)


def _cpu_seconds(function, clock=time.process_time):
    start = clock()
    result = function()
    return result, clock() - start


def measured(runs, repeats=REPEATS, clock=time.process_time):
    """Of renderers name → function of a seed and a resolution: (relative variance, the same without the 1 % noisiest
    pixels, 99.9th percentile of the error, CPU seconds of a frame less those of a frame of next to nothing).

    clock: CPU seconds so far, of all processes that render.
    """
    images = {name: [] for name in runs}
    seconds = {name: [] for name in runs}
    fixed = {}
    for name, run in runs.items():
        run(999, RESOLUTION)
        fixed[name] = min(_cpu_seconds(lambda run=run: run(1, (4, 4)), clock)[1] for _ in range(3))
    for seed in range(repeats):
        for name, run in runs.items():
            image, taken = _cpu_seconds(lambda run=run, seed=seed: run(seed, RESOLUTION), clock)
            images[name].append(image)
            seconds[name].append(taken - fixed[name])
    values = {name: np.array(list_, dtype=float).reshape(repeats, -1, 3) for name, list_ in images.items()}
    mean = np.mean([v.mean(axis=0) for v in values.values()], axis=0)
    scale = mean**2 + 0.01 * mean.mean() ** 2
    found = {}
    for name, value in values.items():
        variance = (value.var(axis=0, ddof=1) / scale).mean(axis=1)
        quiet = np.sort(variance)[: int(0.99 * len(variance))]
        error = np.abs(value - mean).mean(axis=2) / np.sqrt(scale.mean(axis=1))
        found[name] = (
            variance.mean(), quiet.mean(), np.quantile(error, 0.999), float(np.median(seconds[name]))
        )  # fmt: skip
    return found


def tell_room(found, learning, paths, ratios, beside="path"):
    """Print what `measured` found beside one of the renderers, and add it to `ratios` by name.

    learning: CPU seconds of the guide, which guided renderers share by their `paths`.
    """
    base = found[beside]
    for name, (variance, quiet, worst, seconds) in found.items():
        shared = learning * paths / (FRAMES * FRAME_PATHS) if name.startswith("guided") else 0.0
        slower = (seconds + shared) / base[3]
        row = (variance / base[0] * slower, quiet / base[1] * slower, worst / base[2], slower)
        ratios.setdefault(name, []).append(row)
        print(
            f"  {name:20} variance {variance:.3f} ({quiet:.3f} trimmed), CPU s {seconds:.2f}, "
            f"variance x time {row[0]:.2f} ({row[1]:.2f} trimmed), 99.9 % of errors below {worst:.2f}"
        )


def tell_means(ratios):
    """Print the ratios of all rooms."""
    for name, rows in ratios.items():
        means, largest = np.exp(np.log(rows).mean(axis=0)), np.max(rows, axis=0)
        print(
            f"  {name:20} variance x time {means[0]:.2f} ({largest[0]:.2f}), "
            f"trimmed {means[1]:.2f} ({largest[1]:.2f}), 99.9 % of errors {means[2]:.2f}, "
            f"time {means[3]:.2f}; {len(rows)} rooms"
        )


def _with_bulbs(room):
    """The room with bulbs in its cloth shades, which then do not glow; None where it has no such shade."""
    lights, bulbs = [], {}
    for light in room.lights:
        if light.shape == "shade":
            radius = 0.2 * min(light.size[:2])
            bulbs[light.name.rpartition(".")[0]] = replace(
                light, shape="sphere", size=(radius,), lumens=light.lumens / light.share, slot=""
            )
    for light in room.lights:
        if light.name.rpartition(".")[0] not in bulbs:
            lights.append(light)
    return replace(room, lights=(*lights, *bulbs.values())) if bulbs else None


def test_shades_that_glow_against_bulbs_in_them(tmp_path):
    """By night. Bulbs stand in the middle of opaque shades, without sockets."""
    from gibench.generators.rooms import sample_room
    from gibench.generators.scene_files import write_room

    rows = []
    for index in range(ROOMS):
        room = sample_room(1, index, views=1, environment="none")
        other = _with_bulbs(room)
        if other is None:
            continue
        camera = room.cameras[0].pinhole
        runs = {}
        for name, made in (("glow", room), ("bulbs", other)):
            write_room(made, tmp_path / f"{index}-{name}")
            scene = load_scene(tmp_path / f"{index}-{name}/scene.xml")
            runs[name] = lambda seed, resolution, scene=scene, camera=camera: render_frame(
                scene, camera, resolution=resolution, spp=SPP, seed=seed, channels=["color"]
            ).arrays["color"]
        # Each against its own mean: how bright the rooms are differs.
        found = {name: measured({name: run})[name] for name, run in runs.items()}
        ratios = [a / b for a, b in zip(found["glow"], found["bulbs"], strict=True)]
        rows.append([ratios[0], ratios[1], ratios[0] * ratios[3]])
        print(
            f"\nroom {index}, {room.kind}: variance {found['glow'][0]:.3f} against {found['bulbs'][0]:.3f}: "
            f"{ratios[0]:.2f} ({ratios[1]:.2f} trimmed), CPU s {ratios[3]:.2f}, variance x time {rows[-1][2]:.2f}"
        )
    means, largest = np.exp(np.log(rows).mean(axis=0)), np.max(rows, axis=0)
    print(
        f"\nof bulbs, geometric means over {len(rows)} rooms (largest): variance {means[0]:.2f} ({largest[0]:.2f}), "
        f"trimmed {means[1]:.2f} ({largest[1]:.2f}), variance x time {means[2]:.2f} ({largest[2]:.2f})"
    )


def _compared(scene, camera, monkeypatch, *, daylight):
    """Renderers of a scene for `measured`, and the CPU seconds in which its guide was learned."""
    guided, lights = replace(scene, sampling=GUIDED), replace(scene, sampling=GUIDED)
    _, learning = _cpu_seconds(lambda: guided.guide)
    with monkeypatch.context() as patch:
        patch.setattr(learning_module, "DIRECTIONS_PAY", 1.0)
        assert lights.guide is not None

    def ours(scene):
        return lambda seed, resolution: render_frame(
            scene, camera, resolution=resolution, spp=SPP, seed=seed, channels=["color"]
        ).arrays["color"]

    runs = {
        "path": lambda seed, resolution: views.render_path(
            scene.mi_scene, camera, resolution, spp=SPP, seed=seed, max_depth=8, rr_depth=5
        ),
        "plain": ours(scene),
        "guided": ours(guided),
        "guided, lights alone": ours(lights),
    }
    if daylight:
        runs["plain, no portals"] = ours(replace(scene, openings=None))
    return runs, learning


def test_guided_and_plain_against_path(tmp_path, monkeypatch):
    """In generated rooms. Portals are to cost nothing where they bring nothing."""
    ratios = {}
    for index in range(ROOMS):
        room, scene, camera = _room(index, tmp_path / str(index))
        day = room.environment.kind != "none"
        runs, learning = _compared(scene, camera, monkeypatch, daylight=day and len(room.openings) > 0)
        found = measured(runs)
        print(
            f"\nroom {index}: {room.kind}, {'day' if day else 'night'}; guide learned in {learning:.1f} CPU s"
        )
        tell_room(found, learning, RESOLUTION[0] * RESOLUTION[1] * SPP, ratios)
        if "plain, no portals" in found:
            on, off = (found[name][1] * found[name][3] for name in ("plain", "plain, no portals"))
            print(f"  portals on / off: variance x time, trimmed, {on / off:.2f}")
    print("\nof path, geometric means over rooms (largest):")
    tell_means(ratios)


@pytest.mark.skipif("GIBENCH_EXTERNAL" not in os.environ, reason="needs the scenes of GIBENCH_EXTERNAL")
def test_guided_and_plain_in_scenes_of_papers(monkeypatch):
    from gibench.datasets.room_view import open_view
    from gibench.generators.imported.scene import ImportSettings

    ratios = {}
    for name in SCENES:
        file = Path(os.environ["GIBENCH_EXTERNAL"]) / "scenes" / name / "scene.xml"
        view = open_view(file, 0, "plain", ImportSettings(allow_missing=True))
        runs, learning = _compared(view.scene, view.camera, monkeypatch, daylight=False)
        print(f"\n{name}; guide learned in {learning:.1f} CPU s")
        tell_room(measured(runs), learning, RESOLUTION[0] * RESOLUTION[1] * SPP, ratios)
    print("\nof path, geometric means over scenes (largest):")
    tell_means(ratios)
