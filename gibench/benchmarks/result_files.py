"""The folder of a run: where everything lies, and how a result is keyed, written and read.

RESULTS/run.json                    track, preset, scenes, machines, and what every command did
RESULTS/scenes/reference/           the dataset of the frames on the paths; scenes/reference-again: the same frames with
                                    independent samples; scenes/training: that of the views
RESULTS/scenes/panoramas/           environments of rooms that light views to train on
RESULTS/scenes/sites/room-000000/   the files of a room that methods may see: without any frame
RESULTS/bakes/room-000000/          what methods prepared; bakes/rooms: what they trained on rooms
RESULTS/results/<id>.json           a result, never changed once it is written
RESULTS/results/<id>/0000.exr       what it predicted
RESULTS/set-aside/<id>-<n>.json     failed results that were tried again
RESULTS/scores/<id>.json            metrics of a result; scores/room-000000.json: of the reference's own noise
RESULTS/logs/                       what the process of a result that failed wrote to the terminal
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from pydantic import BaseModel

import gibench
from gibench import gate
from gibench.baselines.bakes import remove_abandoned
from gibench.benchmarks import records
from gibench.benchmarks.errors import ResultsError
from gibench.datasets.checked import checked, plain, shown
from gibench.datasets.errors import FolderError
from gibench.datasets.files import as_json, process_number, sync_folder, write_whole
from gibench.datasets.folder import (
    lock_folder,
    refuse_links,
    remove_empty,
    remove_tokens,
    unlock_folder,
)

#: Version of the layout on disk; a reader refuses what it does not know.
FORMAT = 1

RUN = "run.json"

#: What a result is called: the first 16 digits of its key.
ID = "[0-9a-f]{16}"


def canonical(config: Mapping[str, Any]) -> bytes:
    """The one way to write a configuration, whatever the order of its keys."""
    return json.dumps(config, sort_keys=True, separators=(",", ":"), ensure_ascii=False).encode()


def key_of(config: Mapping[str, Any]) -> str:
    """SHA-256 of the canonical configuration, hexadecimal; its first 16 digits are the id of the result."""
    return hashlib.sha256(canonical(config)).hexdigest()


class RunFolder:
    """Places in a folder of results."""

    def __init__(self, root: Path) -> None:
        """root: need not exist."""
        self.root = root
        self.run_file = root / RUN
        self.results = root / "results"
        self.scores = root / "scores"
        self.logs = root / "logs"
        self.set_aside = root / "set-aside"

    def dataset(self, which: str) -> Path:
        """which: "training", "reference" or "reference-again"."""
        return self.root / "scenes" / which

    @property
    def references(self) -> tuple[Path, Path]:
        """The datasets of the frames on the paths: rendered once, and once more with other samples."""
        return self.dataset("reference"), self.dataset("reference-again")

    def bakes(self, scene: str) -> Path:
        """Of a scene, shared by all methods; of "rooms" what is trained on rooms."""
        return self.root / "bakes" / scene

    @property
    def panoramas(self) -> Path:
        """Environments that light views to train on, beside those that ship."""
        return self.root / "scenes" / "panoramas"

    def site(self, scene: str) -> Path:
        """Files of a scene that methods may see."""
        return self.root / "scenes" / "sites" / scene

    def result_file(self, id: str) -> Path:
        """Record of a result."""
        return self.results / f"{id}.json"

    def predictions(self, id: str) -> Path:
        """Folder of its frames."""
        return self.results / id

    def partial(self, id: str) -> Path:
        """Folder in which this process gathers its frames until all are there."""
        return self.results / f".{id}.partial-{process_number()}"

    def score_file(self, name: str) -> Path:
        """name: the id of a result, or that of a scene for the reference's own noise."""
        return self.scores / f"{name}.json"

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """Hold the folder for one command alone, made where it does not exist; leftovers of killed ones go.

        Raises FolderError: it cannot be written, holds something else, or is in use.
        """
        made = [folder for folder in (self.root, *self.root.parents) if not folder.exists()]
        try:
            self.root.mkdir(parents=True, exist_ok=True)
            refuse_links(self.root, self._written())
            foreign = [e.name for e in self.root.iterdir() if not e.name.startswith(".")]
            if foreign and not self.run_file.exists():
                raise FolderError(
                    f"{self.root} holds files but no results ({sorted(foreign)[0]} …): choose an empty or a new "
                    "folder with --out"
                )
            lock = lock_folder(self.root)
        except OSError as problem:
            raise FolderError(
                f"{self.root} cannot be written ({problem.strerror}): choose another folder with --out"
            ) from None
        try:
            self.remove_partials()
            yield
        finally:
            self.remove_partials()
            unlock_folder(self.root, lock)
            remove_empty(made)

    def _written(self) -> list[Path]:
        """Every folder that a command writes to or deletes from."""
        folders = [self.results, self.scores, self.logs, self.set_aside]
        for name in ("scenes", "bakes"):
            outer = self.root / name
            inner = outer.iterdir() if gate.real_folder(outer) else ()
            folders += [outer, *(path for path in inner if path.is_symlink())]
        return folders

    def remove_partials(self) -> None:
        """Remove what killed processes left; only for the holder of the lock.

        Nothing goes but what carries a result's or a file's own names, and nothing behind a link.
        """
        remove_tokens(self.root)
        for left in gate.own_leftovers(self.results, rf"\.{ID}\.partial(-[0-9]+)?"):
            remove_frames(left)
        for left in gate.own_leftovers(self.results, ID):  # its frames came, its record did not
            if not os.path.lexists(self.result_file(left.name)):
                remove_frames(left)
        for scene in gate.own_leftovers(self.root / "bakes", r"[^/.][^/]*"):
            remove_abandoned(scene)
        for place in (self.root.resolve(), self.results, self.scores):
            for left in gate.own_leftovers(place, r"\.[^/]+\.json\.partial-[0-9]+"):
                if not gate.real_folder(left):
                    left.unlink(missing_ok=True)

    def write_result(self, record: Mapping[str, Any], partial: Path | None = None) -> None:
        """Write a result, and move its frames to their place where it has some. Raises OSError.

        partial: where they were gathered, by default by this process.
        """
        self.results.mkdir(exist_ok=True)
        partial = self.partial(record["id"]) if partial is None else partial
        if record["status"] == "ok":
            os.replace(partial, self.predictions(record["id"]))
            sync_folder(self.results)
        else:
            remove_frames(partial)
        write_whole(self.result_file(record["id"]), as_json(record))

    def put_aside(self, id: str) -> None:
        """Make way for another try of a failed result; what it said is kept."""
        self.set_aside.mkdir(exist_ok=True)
        number = sum(1 for _ in self.set_aside.glob(f"{id}-*.json"))
        os.replace(self.result_file(id), self.set_aside / f"{id}-{number}.json")

    def ids(self) -> list[str]:
        """Of all results."""
        return sorted(path.stem for path in self.results.glob("*.json") if re.fullmatch(ID, path.stem))

    def read_result(self, id: str) -> dict[str, Any]:
        """Read a result and check that it is whole. Raises ResultsError: damaged, or of another format."""
        path = self.result_file(id)
        remedy = f"remove {path} and {self.predictions(id)}, then run the same command again"
        record = self.read_checked(path, records.Result, remedy)
        if not (record["id"] == id == record["key"][:16] and key_of(record["config"]) == record["key"]):
            raise ResultsError(f"{path} is damaged: it does not say what its name does; {remedy}")
        return record

    def changed_frame(self, record: Mapping[str, Any]) -> str:
        """Say which frame of a whole result is not as it was written; empty where all are."""
        for name, known in record["files"].items():
            try:
                with gate.opened(gate.inside(self.root, f"results/{record['id']}/{name}")) as file:
                    if hashlib.file_digest(file, "sha256").hexdigest() != known["sha256"]:
                        return f"its frame {name} was changed after the run (SHA-256 differs)"
            except gate.GateError as problem:
                return str(problem)
        return ""

    def read_run(self) -> dict[str, Any]:
        """Read `run.json`. Raises ResultsError: no such folder, damaged, or of another format."""
        if not self.run_file.is_file():
            raise ResultsError(
                f"{self.root} holds no results: it has no {RUN}; `gibench bench run` makes them"
            )
        return self.read_checked(
            self.run_file, records.Run, "what it said is lost: run again into a new folder"
        )

    def read_checked(
        self,
        path: Path,
        model: type[BaseModel],
        remedy: str,
        renewed: Callable[[dict[str, Any]], dict[str, Any]] = lambda content: content,
    ) -> dict[str, Any]:
        """Read a JSON file of this folder that must be what `model` says. Raises ResultsError with `remedy`.

        renewed: gives what older versions wrote the form of this one.
        """
        try:
            content = plain(gate.read_inside(self.root, path.relative_to(self.root)))
            _refuse_other_format(path, content)
            return checked(renewed(content), model)
        except gate.GateError as problem:
            raise ResultsError(f"{path} is damaged ({problem}): {remedy}") from None
        except ValueError as problem:
            raise ResultsError(f"{path} is damaged ({problem}): {remedy}") from None

    def write_run(self, run: Mapping[str, Any]) -> None:
        """Write `run.json`. Raises OSError."""
        write_whole(self.run_file, as_json(run))


def remove_frames(folder: Path) -> None:
    """Remove the frames of a result and their folder; anything else in it stays, and so does the folder then."""
    for frame in gate.own_leftovers(folder, r"[0-9]{4,}\.exr"):
        if not gate.real_folder(frame):
            frame.unlink(missing_ok=True)
    with suppress(OSError):
        folder.rmdir()


def _refuse_other_format(path: Path, content: Mapping[str, Any]) -> None:
    if content.get("format") != FORMAT:
        there, version = (shown(str(content.get(key, "unknown")))[1:-1] for key in ("format", "gibench"))
        raise ResultsError(
            f"{path} is of format {there}, this gibench {gibench.__version__} reads format {FORMAT}: read it with the "
            f"gibench that wrote it ({version}), or run again into a new folder"
        )
