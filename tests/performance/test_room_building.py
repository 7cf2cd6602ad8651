"""Seconds to build and check a room, and to write it. Run with `pytest -m performance -s`."""

import time

import numpy as np
import pytest

from gibench.generators.rooms import KINDS, sample_room
from gibench.generators.scene_files import write_room

BUILD_LIMIT = 0.3  # s, the aim for building and checking without rendering


@pytest.mark.performance
def test_building_and_writing(tmp_path):
    sample_room(0, 0, kind="living")  # loads Mitsuba and compiles its one kernel
    build, write = [], []
    for index in range(20):
        start = time.perf_counter()
        room = sample_room(0, index, kind=KINDS[index % len(KINDS)])
        built = time.perf_counter()
        write_room(room, tmp_path / str(index))
        build.append(built - start)
        write.append(time.perf_counter() - built)
    print(
        f"\nbuild and check a room: median {np.median(build):.3f} s, {np.median(build) / BUILD_LIMIT:.2f} × the aim"
    )
    print(f"write a room: median {np.median(write):.3f} s")
