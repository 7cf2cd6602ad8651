"""Cost of a dataset: every room built and checked, one frame measured, nothing kept."""

from __future__ import annotations

import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gibench.datasets import exr, pool
from gibench.datasets.making import default_threads
from gibench.datasets.recipes import Recipe
from gibench.datasets.room_making import LoadedRoom, Renderer, sampled_room, written_room
from gibench.generators.parts import Room

if TYPE_CHECKING:
    from gibench.generators.imported.room import ImportedRoom

#: The frame that is measured: at most this wide, and at most this many samples a pixel, which are one pass of the
#: renderer. Fewer would count what a pass costs at any size, such as tracing Python, as if each path cost it.
MEASURED_WIDTH, MEASURED_SPP = 256, 64

#: Rooms that are built and checked of a larger dataset, spread evenly over it; counts are scaled then.
MOST_CHECKED = 100


@dataclass
class Estimate:
    """Cost of a dataset on this machine.

    checked: rooms that were built or refused, all of them or MOST_CHECKED. rooms, frames, rejected_rooms, rejections:
    counted over these (frames: of the rooms that could be built; rejections: reason → count over rooms and views),
    rooms and frames scaled to all rooms. build_seconds: per room, measured on those that were checked.
    paths_per_second, seconds_per_frame, bytes_per_room, bytes_per_frame: scaled from one measured frame. seconds: wall
    time of the whole making.
    With a recipe that stops at an error, samples are taken to reach the cap, so that seconds are the most
    that it can take.
    """

    recipe: Recipe
    workers: int
    checked: int = 0
    rooms: int = 0
    frames: int = 0
    variant: str = ""
    rejected_rooms: dict[int, str] = field(default_factory=dict)
    rejections: Counter[str] = field(default_factory=Counter)
    build_seconds: float = 0.0
    paths_per_second: float = 0.0
    seconds_per_frame: float = 0.0
    bytes_per_room: float = 0.0
    bytes_per_frame: float = 0.0
    load_seconds: float = 0.0

    @property
    def bytes(self) -> float:
        """Size of the dataset."""
        return self.rooms * self.bytes_per_room + self.frames * self.bytes_per_frame

    @property
    def seconds(self) -> float:
        """Wall time. What was measured is one worker's, with its share of the cores."""
        rooms = self.rooms * (self.build_seconds + self.load_seconds)
        return (rooms + self.frames * self.seconds_per_frame) / min(self.workers, max(self.rooms, 1))


@dataclass
class RoomChecker:
    """Builds and checks a room and forgets it; the first of a worker is also rendered, small."""

    recipe: Recipe
    has_measured: bool = False

    def __call__(self, room: int, report: pool.Report) -> dict[str, Any]:
        """Return "frames", "rejections" and "seconds", "measured" once a worker, or "rejected": reason."""
        from gibench.generators.imported.errors import NoPlaceForCamera
        from gibench.generators.rooms import RejectedRoom

        started = time.perf_counter()
        try:
            built = sampled_room(self.recipe, room)
        except (RejectedRoom, NoPlaceForCamera) as reason:
            if len(self.recipe.scenes) == 1:
                raise
            return {"rejected": str(reason)}
        seconds = time.perf_counter() - started
        measured = None if self.has_measured else self._measured(built)
        self.has_measured = True
        return {
            "frames": len(self.recipe.rendered_views(built.given_cameras, room)),
            "rejections": dict(built.rejections),
            "seconds": seconds,
            "measured": measured,
        }

    def _measured(self, room: Room | ImportedRoom) -> dict[str, float]:
        recipe = self.recipe
        width = min(recipe.resolution[0], MEASURED_WIDTH)
        height = max(1, round(recipe.resolution[1] * width / recipe.resolution[0]))
        settings = {
            "resolution": (width, height),
            "spp": min(recipe.spp or MEASURED_SPP, MEASURED_SPP),
            "error": None,
        }
        with tempfile.TemporaryDirectory(prefix="gibench-") as scratch:
            started = time.perf_counter()
            written_room(room, Path(scratch), recipe)
            loaded = LoadedRoom.of(recipe, room, Path(scratch))
            _ = loaded.scene.guide  # which takes as long again for every room
            load_seconds = time.perf_counter() - started
            size = sum(file.stat().st_size for file in Path(scratch).rglob("*") if file.is_file())
            loaded.rendered(0, **settings)  # compiles the kernels
            frame = loaded.rendered(0, **settings)
        started = time.perf_counter()
        content = exr.encode(frame.arrays)
        pixels = width * height
        return {
            "paths_per_second": frame.paths / max(frame.kernel_seconds, 1e-9),
            "pixel_seconds": (frame.seconds - frame.kernel_seconds + time.perf_counter() - started) / pixels,
            "pixel_bytes": len(content) / pixels,
            "room_bytes": size,
            "load_seconds": load_seconds,
        }


def estimate(
    recipe: Recipe,
    *,
    variant: str = "auto",
    workers: int = 1,
    on_room: Callable[[int, int], None] = lambda done, of: None,
    work: pool.Work | None = None,
) -> Estimate:
    """Build and check every room of a recipe; estimate time and disk from one small frame.

    Of more than MOST_CHECKED rooms so many are built, spread evenly over them. on_room: called with (rooms checked,
    rooms to be checked). work: what workers do, by default `RoomChecker`.
    Raises `MakingError`.
    """
    result = Estimate(recipe, workers)
    build_seconds: list[float] = []
    share = max(1.0, recipe.rooms / MOST_CHECKED)
    numbers = [int(number * share) for number in range(min(recipe.rooms, MOST_CHECKED))]

    def ready(facts: dict[str, Any]) -> None:
        result.variant = facts["variant"]

    def done(room: int, answer: dict[str, Any]) -> None:
        if "rejected" in answer:
            result.rejected_rooms[room] = answer["rejected"]
        else:
            result.rooms += 1
            result.frames += answer["frames"]
            result.rejections.update(answer["rejections"])
            build_seconds.append(answer["seconds"])
        if answer.get("measured"):
            _scale(result, answer["measured"])
        result.checked += 1
        on_room(result.checked, len(numbers))

    work = work or pool.Work(Renderer(variant, default_threads(workers), recipe), RoomChecker(recipe))
    listener = pool.Listener(ready, lambda room, kind, content: None, done, lambda room: None)
    pool.run_rooms(work, numbers, listener, workers=min(workers, len(numbers)))
    result.rooms, result.frames = round(result.rooms * share), round(result.frames * share)
    result.build_seconds = sum(build_seconds) / max(len(build_seconds), 1)
    return result


def _scale(result: Estimate, measured: dict[str, float]) -> None:
    recipe = result.recipe
    pixels = recipe.resolution[0] * recipe.resolution[1]
    result.paths_per_second = measured["paths_per_second"]
    paths = pixels * (recipe.spp or recipe.spp_cap)
    # Without radiance there are no paths.
    path_seconds = paths / result.paths_per_second if result.paths_per_second > 0 else 0.0
    result.seconds_per_frame = path_seconds + pixels * measured["pixel_seconds"]
    result.bytes_per_frame = pixels * measured["pixel_bytes"]
    result.bytes_per_room = measured["room_bytes"]
    result.load_seconds = measured["load_seconds"]
