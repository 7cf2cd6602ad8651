"""Panoramas of generated rooms: environments to train on, as many as are wanted."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gibench.datasets import pool
from gibench.datasets.checked import plain
from gibench.datasets.errors import FolderError, MakingError
from gibench.datasets.files import as_json, write_whole
from gibench.datasets.making import default_threads
from gibench.datasets.manifest import refuse_other_makers

if TYPE_CHECKING:
    from gibench.generators.parts import Room
    from gibench.rendering.scene import Scene

LANE = 2001
"""Of the seeds of these rooms, so that no dataset of the same seed has one of them."""

HEIGHT = 128
FACE = 96
"""Texels along the faces of the cube that is rendered for HEIGHT rows, half as many again as the panorama has there."""

MAX_DEPTH = 8

RECORD = "environments.json"
"""Beside the panoramas: what decides their pixels."""

LEFTOVER = rf"\.{re.escape(RECORD)}\.partial-[0-9]+"
"""Names of what a run leaves that is killed while it writes RECORD."""


def room_seed(seed: int) -> int:
    """Of the rooms whose panoramas the run `seed` makes."""
    return int(
        np.random.SeedSequence(seed, spawn_key=(LANE,)).generate_state(1, np.uint64)[0] >> np.uint64(1)
    )


def make_environments(
    out: Path,
    *,
    count: int,
    seed: int,
    spp: int,
    height: int = HEIGHT,
    variant: str = "auto",
    workers: int = 1,
    on_done: Callable[[int, int], None] = lambda done, of: None,
) -> list[Path]:
    """Render `count` panoramas of 2·height × height texels into a folder, or those that are not there yet.

    Room i of the run shows from the place of its first camera, with its lamps and its daylight; a room that cannot be
    built is left out, and one more is taken. The same seed, number of samples, variant and versions give the same
    pixels. workers: processes that render at the same time, which do not change them. on_done: told how many are there,
    and of how many. Returns the files, OpenEXR, radiance in W·m⁻²·sr⁻¹.

    Raises FolderError for a folder of other settings, another variant or other versions, or one that cannot be written,
    MakingError when most rooms fail.
    """
    _claimed(out, {"seed": seed, "spp": spp, "height": height})
    work = pool.Work(
        partial(_ready, variant, default_threads(workers)), _Maker(out, seed=seed, spp=spp, height=height)
    )
    rejected: set[int] = set()
    while True:
        numbers = [number for number in range(count + len(rejected)) if number not in rejected]
        left = [number for number in numbers if not _file(out, seed, number).is_file()]
        if not left:
            return [_file(out, seed, number) for number in numbers]
        if len(rejected) > count + 10:
            raise MakingError(f"{len(rejected)} of {len(numbers) + len(rejected)} rooms could not be built")
        there = count - len(left)

        def told(number: int, rejection: str | None) -> None:
            nonlocal there
            if rejection is None:
                there += 1
                on_done(there, count)
            else:
                rejected.add(number)

        listener = pool.Listener(
            partial(_refuse_other_makers, out), lambda *message: None, told, lambda number: None
        )
        pool.run_rooms(work, left, listener, workers=min(workers, len(left)))


def _file(out: Path, seed: int, number: int) -> Path:
    return out / f"room-{seed}-{number:05d}.exr"


def _ready(variant: str, threads: int) -> dict[str, Any]:
    """Make a worker ready. Returns what makes the pixels: `variant` and `versions`."""
    from gibench.datasets.room_making import versions_here
    from gibench.rendering import backend

    variant = backend.select_variant(variant)
    backend.limit_threads(threads)
    return {"variant": variant, "versions": versions_here()}


@dataclass(frozen=True)
class _Maker:
    """The job that workers are given: the panorama of a room, or why there is none."""

    out: Path
    seed: int
    spp: int
    height: int

    def __call__(self, number: int, report: pool.Report) -> str | None:
        from gibench.generators.layouts.placement import RejectedRoom
        from gibench.generators.rooms import sample_room

        try:
            room = sample_room(room_seed(self.seed), number, views=1)
        except RejectedRoom as reason:
            return str(reason)
        panorama = rendered_panorama(room, spp=self.spp, seed=self.seed, height=self.height)
        _written(_file(self.out, self.seed, number), panorama)
        return None


def rendered_panorama(room: Room, *, spp: int, seed: int, height: int = HEIGHT) -> NDArray[np.float32]:
    """What is seen in all directions from the first camera of a room: (height, 2·height, 3) radiance, as `latlong`."""
    from gibench.generators.scene_files import write_room
    from gibench.rendering.scene import load_scene

    with tempfile.TemporaryDirectory(prefix="gibench-") as scratch:
        write_room(room, scratch, max_depth=MAX_DEPTH + 1)
        scene = load_scene(Path(scratch) / "scene.xml", share_kernels=True)
    return panorama_from(scene, room.cameras[0].position, spp=spp, seed=seed + room.index, height=height)


def panorama_from(
    scene: Scene, position: tuple[float, float, float], *, spp: int, seed: int, height: int = HEIGHT
) -> NDArray[np.float32]:
    """(height, 2·height, 3) denoised radiance from a place in a scene, all directions, from six views of a cube."""
    from gibench.rendering.camera import PinholeCamera
    from gibench.rendering.cubemap import FACES, cube_directions, to_latlong
    from gibench.rendering.render import render_frame

    face = height * FACE // HEIGHT
    towards = cube_directions(face)
    faces = np.empty((6, face, face, 3), dtype=np.float32)
    for number in range(len(FACES)):
        axis = towards[number].mean(axis=(0, 1))
        target = np.asarray(position) + axis
        camera = PinholeCamera(position, (float(target[0]), float(target[1]), float(target[2])), np.pi / 2)
        frame_seed = int(np.random.SeedSequence(seed, spawn_key=(LANE, number)).generate_state(1)[0])
        color = render_frame(
            scene,
            camera,
            resolution=(face, face),
            channels=("color",),
            spp=spp,
            seed=frame_seed,
            max_depth=MAX_DEPTH,
            denoise=True,
        ).arrays["color"]
        # A camera that looks up or down has another side on top than the face.
        x, y, _ = camera.project(np.asarray(position) + towards[number], (face, face))
        faces[number] = color[np.floor(y).astype(int), np.floor(x).astype(int)]
    return to_latlong(faces, height)


def _claimed(out: Path, settings: dict[str, Any]) -> None:
    """Make the folder and say in it what decides its pixels. Raises FolderError."""
    record = out / RECORD
    try:
        out.mkdir(parents=True, exist_ok=True)
        if record.is_file():
            made = _recorded(out)
            there = {key: made.get(key) for key in settings}
            if there != settings:
                raise FolderError(
                    f"{out} holds panoramas of other settings ({there}): choose another folder with --out"
                )
        elif any(not re.fullmatch(LEFTOVER, path.name) for path in out.iterdir()):
            raise FolderError(f"{out} holds something else: choose a new folder with --out")
        else:
            write_whole(record, as_json(settings))
    except OSError as problem:
        raise FolderError(f"{problem.filename or out}: {problem.strerror}") from None


def _recorded(out: Path) -> dict[str, Any]:
    try:
        return plain((out / RECORD).read_bytes())
    except ValueError:
        raise FolderError(
            f"{out / RECORD} is damaged: remove the folder, or choose another with --out"
        ) from None


def _refuse_other_makers(out: Path, facts: dict[str, Any]) -> None:
    """Write down what makes the pixels before the first panorama, or refuse to mix others in. Raises FolderError.

    Folders of older versions do not say what made theirs, and go on.
    """
    record = _recorded(out)
    if "variant" in record:
        refuse_other_makers(out, {"versions": {}, **record}, facts)
    elif not any(out.glob("*.exr")):
        try:
            write_whole(out / RECORD, as_json(record | facts))
        except OSError as problem:
            raise FolderError(f"{problem.filename or out}: {problem.strerror}") from None


def _written(file: Path, image: NDArray[np.float32]) -> None:
    import OpenEXR

    with tempfile.TemporaryDirectory(prefix="gibench-") as scratch:
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"RGB": np.ascontiguousarray(image)}).write(f"{scratch}/panorama.exr")
        content = (Path(scratch) / "panorama.exr").read_bytes()
    try:
        write_whole(file, content)
    except OSError as problem:
        raise FolderError(f"{problem.filename or file}: {problem.strerror}") from None
