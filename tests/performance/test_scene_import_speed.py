"""Seconds to import and load scenes, and the memory that a large one takes. Run with `pytest -m performance -s`."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from gibench.generators.imported.room import import_room
from gibench.generators.imported.scene import ImportSettings, import_scene
from gibench.generators.parts import Mesh
from gibench.generators.scene_files import write_ply
from tests.generators.imported.files import room_file

LOADING_LIMIT = 5.0  # s a scene, after the first
TRIANGLES = 2_000_000


@pytest.mark.performance
@pytest.mark.skipif(
    "GIBENCH_EXTERNAL" not in os.environ, reason="GIBENCH_EXTERNAL names no folder with scenes/"
)
def test_the_papers_scenes():
    folder = Path(os.environ["GIBENCH_EXTERNAL"]) / "scenes"
    settings = ImportSettings(allow_missing=True)
    _ = import_scene(folder / "living-room/scene.xml", settings).loaded  # loads Mitsuba
    print()
    for name in ("staircase", "living-room", "kitchen"):
        start = time.perf_counter()
        scene = import_scene(folder / name / "scene.xml", settings)
        imported = time.perf_counter()
        _ = scene.loaded
        loaded = time.perf_counter()
        import_room(scene, resolution=(64, 36), views=4, path="walk", path_views=24)
        looked = time.perf_counter() - loaded
        share = (loaded - start) / LOADING_LIMIT
        print(
            f"{name:<12} read {imported - start:.2f} s, loaded {loaded - imported:.2f} s ({share:.2f} × the limit), "
            f"28 views found {looked:.1f} s"
        )


def wavy_floor(path: Path, triangles: int) -> None:
    side = round((triangles / 2) ** 0.5)
    x, y = np.meshgrid(np.linspace(-2.4, 2.4, side + 1), np.linspace(-2.9, 2.9, side + 1))
    z = 0.02 + 0.01 * np.sin(20 * x) * np.sin(20 * y)
    vertices = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    row, column = (index.ravel() for index in np.indices((side, side)))
    corner = (row * (side + 1) + column).astype(np.int32)
    below = corner + side + 1
    faces = np.concatenate(
        [np.stack([corner, corner + 1, below], axis=1), np.stack([below, corner + 1, below + 1], axis=1)]
    )
    normals = np.tile([0.0, 0.0, 1.0], (len(vertices), 1))
    write_ply(Mesh(vertices, faces.astype(np.int32), normals, vertices[:, :2]), path)


@pytest.mark.performance
def test_two_million_triangles(tmp_path):
    """In a process of its own, whose peak is the dataset's."""
    shape = '<shape type="ply" id="floor"><string name="filename" value="floor.ply"/><ref id="wall"/></shape>'
    file = room_file(tmp_path, extra=shape)
    wavy_floor(tmp_path / "floor.ply", TRIANGLES)
    words = ["--scene", str(file), "--views", "1", "--spp", "16", "--out", str(tmp_path / "d")]
    code = (
        "import resource; from gibench.cli import run; from gibench.cli.app import make_app\n"
        "if __name__ == '__main__':\n"
        f"    run(make_app, {words!r})\n"
        "    print('PEAK', resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6)"
    )
    script = tmp_path / "make.py"
    script.write_text(code)
    start = time.perf_counter()
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    peak = float(done.stdout.split("PEAK")[1])
    size = (tmp_path / "d/rooms/000000/room.glb").stat().st_size
    seconds = time.perf_counter() - start
    print(
        f"\n{TRIANGLES / 1e6:g} million triangles: {seconds:.0f} s for two frames, {peak:.2f} GB at the peak of the "
        f"worker, {size / 1e6:.0f} MB of room.glb"
    )
