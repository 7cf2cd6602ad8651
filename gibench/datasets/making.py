"""Making a dataset: rooms handed to workers, records gathered, anything that stops a run survived."""

from __future__ import annotations

import contextlib
import errno
import os
import shlex
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gibench.datasets import folder, pool
from gibench.datasets import manifest as manifests
from gibench.datasets.card import card
from gibench.datasets.errors import Interrupted, MakingError
from gibench.datasets.files import write_whole
from gibench.datasets.previews import contact_sheet, write_picture
from gibench.datasets.recipes import Recipe
from gibench.datasets.room_making import Renderer, RoomMaker, imported
from gibench.datasets.unfinished import unfinished_rooms
from gibench.rendering.machine import machine


@dataclass
class Progress:
    """Progress of a run. rooms, frames: of the whole dataset; before: what was whole when the run began.

    paths: camera paths traced by this run. kernel_seconds: time in the renderer, summed over workers.
    rejected_rooms: number → reason. remarks: what happened that the user should know of, a line each.
    """

    rooms: int
    frames: int
    rooms_before: int = 0
    frames_before: int = 0
    rooms_done: int = 0
    frames_done: int = 0
    paths: int = 0
    kernel_seconds: float = 0.0
    rejected_views: int = 0
    rejected_rooms: dict[int, str] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Summary:
    """Result of a run. totals: as in `dataset.json`. seconds: wall time of this run.

    made: rooms that this run made; 0 where the dataset was complete already. frames: that it rendered.
    """

    root: Path
    made: int
    frames: int
    seconds: float
    manifest: dict[str, Any]

    @property
    def totals(self) -> dict[str, Any]:
        """Totals over the whole dataset."""
        return dict(self.manifest["totals"])


def default_threads(workers: int) -> int:
    """CPU threads for each of a number of workers."""
    return max(1, (os.cpu_count() or 1) // workers)


def make(
    root: Path,
    recipe: Recipe,
    *,
    variant: str = "auto",
    workers: int = 1,
    cluster: str | None = None,
    command: str = "",
    on_progress: Callable[[Progress], None] = lambda progress: None,
    work: pool.Work | None = None,
) -> Summary:
    """Make a dataset, continue one that was stopped, or extend one by rooms.

    root: its folder; new, empty, or holding a dataset of the same recipe. workers: processes that render at
    the same time; pixels do not depend on it. cluster: where rooms are made instead, see
    `cluster.run_tasks`. command: how to do the same again, for the record and for
    messages. work: what workers do, by default `RoomMaker` under the `Renderer` of `variant`.

    Raises `FolderError`, `RecipeError` before anything is made; `MakingError` and `Interrupted` half-way,
    when what is whole is in the table and the same call continues.
    """
    if not 1 <= workers <= pool.MOST_WORKERS:
        raise MakingError(f"{workers} workers are not possible: ask for 1 to {pool.MOST_WORKERS}")
    started = time.perf_counter()
    if cluster is not None:
        root = Path(os.path.abspath(root))  # workers start in folders of their own
    work = work or pool.Work(Renderer(variant, default_threads(workers), recipe), RoomMaker(root, recipe))
    with folder.claimed(root):
        run = _Run(root, recipe, command, on_progress)
        try:
            run.do(work, workers, cluster)
            run.finish(started)
        except KeyboardInterrupt:
            run.tidy(started)
            whole, waiting = len(folder.whole_rooms(root)), sum(unfinished_rooms(root).values())
            kept = f" and {waiting} frames of others" if waiting else ""
            how = f"to continue run `{command}`" if command else "the same call continues"
            raise Interrupted(f"stopped with {whole} of {recipe.rooms} rooms whole{kept}; {how}") from None
        except MakingError:
            run.tidy(started)
            raise
        except OSError as problem:
            run.tidy(started)
            raise MakingError(_why(root, problem)) from None
        assert run.manifest is not None
        made = run.progress.rooms_done - run.progress.rooms_before
        frames = run.progress.frames_done - run.progress.frames_before
        return Summary(root, made, frames, time.perf_counter() - started, run.manifest)


def _why(root: Path, problem: OSError) -> str:
    if problem.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{root}: the disk is full: free some space, then run the same command again to continue"
    return f"{problem.filename or root}: {problem.strerror}"


def command_line(program: str, *arguments: str) -> str:
    """Return a command as one would type it."""
    return shlex.join([program, *arguments])


class _Run:
    """One run over one folder, whose lock is held."""

    def __init__(
        self, root: Path, recipe: Recipe, command: str, on_progress: Callable[[Progress], None]
    ) -> None:
        self.root, self.recipe, self.command, self.on_progress = root, recipe, command, on_progress
        self.manifest: dict[str, Any] | None = None
        self.began = datetime.now(UTC)
        self.before: list[dict[str, Any]] | None = None
        if (root / folder.MANIFEST).exists():
            self.manifest = manifests.read_manifest(root)
            manifests.refuse_other(root, self.manifest, recipe)
        whole = folder.whole_rooms(root)
        frames = [
            len(recipe.rendered_views(self._given_cameras(room, whole), room)) for room in range(recipe.rooms)
        ]
        frames_before = sum(frames[room] for room in whole if room < len(frames))
        self.frames_of: Counter[int] = Counter()
        self.progress = Progress(
            rooms=recipe.rooms,
            frames=sum(frames),
            rooms_before=len(whole),
            frames_before=frames_before,
            rooms_done=len(whole),
            frames_done=frames_before,
        )
        rejected = {int(room): why for room, why in (self.manifest or {}).get("rejected_rooms", {}).items()}
        self.progress.rejected_rooms.update(rejected)
        self.rooms = sorted(set(range(recipe.rooms)) - set(whole) - set(rejected))

    def _given_cameras(self, room: int, whole: list[int]) -> int:
        """Of a scene that is still to be made: it is read, so that a wrong one is refused before anything is made."""
        if not self.recipe.scenes:
            return 0
        if room in whole:
            return int(manifests.room_record(self.root, room).get("given_cameras", 0))
        return len(imported(self.recipe, room).cameras)

    def do(self, work: pool.Work, workers: int, cluster: str | None) -> None:
        self.on_progress(self.progress)
        if self.rooms and cluster is not None:
            from gibench.datasets.cluster import run_tasks

            # What a dead worker left of a room is removed at the end: another may be making it by now.
            listener = pool.Listener(self._ready, self._message, self._done, self._forget_frames, self._told)
            run_tasks(work, self.rooms, listener, cluster=cluster, root=self.root)
        elif self.rooms:
            listener = pool.Listener(self._ready, self._message, self._done, self._died, self._told)
            pool.run_rooms(work, self.rooms, listener, workers=min(workers, len(self.rooms)))

    def _ready(self, facts: dict[str, Any]) -> None:
        """Write down what makes the pixels before the first room, or refuse to mix others in."""
        first = self.manifest is None
        if self.manifest is None:
            self.manifest = manifests.new_manifest(self.recipe, facts, machine(), self.command)
        else:
            manifests.refuse_other_makers(self.root, self.manifest, facts)
        grown = self.manifest["recipe"]["rooms"] != self.recipe.rooms
        if first or grown or self.manifest["complete"]:
            self.manifest["recipe"]["rooms"] = self.recipe.rooms
            self.manifest["command"] = self.command
            self.manifest["complete"] = False
        if self.before is None:  # other workers of this run have nothing new to tell
            self.before = list(self.manifest["runs"])
            self.manifest["runs"] = [*self.before, self._record(time.perf_counter(), ended=False)]
            manifests.write_manifest(self.root, self.manifest)

    def _message(self, room: int, kind: str, content: dict[str, Any]) -> None:
        assert kind == "frame"
        self.progress.frames_done += 1
        self.frames_of[room] += 1
        self.progress.paths += content["paths"]
        self.progress.kernel_seconds += content["seconds"]
        self.on_progress(self.progress)

    def _done(self, room: int, record: dict[str, Any]) -> None:
        if "rejected" in record:
            self.progress.rejected_rooms[room] = record["rejected"]
        else:
            self.progress.rooms_done += 1
            self.progress.rejected_views += sum(record["rejections"].values())
        self.on_progress(self.progress)

    def _forget_frames(self, room: int) -> None:
        self.progress.frames_done -= self.frames_of.pop(room, 0)

    def _died(self, room: int) -> None:
        self._forget_frames(room)
        folder.remove_partials(self.root, room)

    def _told(self, remark: str) -> None:
        self.progress.remarks.append(f"{remark}; once more in a new worker")
        self.on_progress(self.progress)

    def finish(self, started: float, *, ended: bool = True) -> None:
        """Gather what is whole. Nothing is touched where the dataset was complete before."""
        assert self.manifest is not None
        if not self.rooms and self.manifest["complete"] and (self.root / folder.TABLE).exists():
            return
        rejected = {str(room): why for room, why in self.progress.rejected_rooms.items()}
        before = self.manifest["runs"] if self.before is None else self.before
        runs = [*before, *([self._record(started, ended=ended)] if self.rooms else [])]
        manifest, table = manifests.gathered(
            self.root, {**self.manifest, "rejected_rooms": rejected, "runs": runs}
        )
        manifests.write_table(self.root, table)
        if len(table):
            write_picture(self.root / folder.PREVIEW, contact_sheet(self.root, table))
            write_whole(self.root / folder.CARD, card(self.root, manifest, table).encode())
            manifest["card"] = True
        manifests.write_manifest(self.root, manifest)
        self.manifest = manifest

    def tidy(self, started: float) -> None:
        """Leave a valid dataset behind a run that was stopped; the next run writes what cannot be written."""
        folder.remove_partials(self.root)
        if not folder.whole_rooms(self.root) and not unfinished_rooms(self.root):
            folder.remove_empty_dataset(self.root)
        elif self.manifest is not None:
            with contextlib.suppress(OSError):
                self.finish(started, ended=False)

    def _record(self, started: float, *, ended: bool) -> dict[str, Any]:
        """Record of this run so far; one that is killed leaves that it began, and did not end."""
        return {
            "command": self.command,
            "began": self.began.isoformat(timespec="seconds"),
            "ended": ended,
            "rooms": len(folder.whole_rooms(self.root)) - self.progress.rooms_before,
            "wall_seconds": time.perf_counter() - started,
            "kernel_seconds": self.progress.kernel_seconds,
        }
