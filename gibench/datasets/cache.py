"""Frames of a dataset decoded once, as arrays that are mapped into memory: what trainings read over and over.

DIR/cache/cache.json     which frames, by their hashes, and which channels; written last
DIR/cache/<channel>.npy  (frames, C, H, W) in the order of the table, float16, float32 or uint32

Reading an item copies what is asked for and nothing else: a window of a frame, of the channels that are named. The
arrays give the values of the files bit for bit, with one exception. Of a channel that is float16 in the array (those
that the contract calls "half"), a frame may be float32 in its file, because it is too bright or too dark for float16.
It is divided by the power of two that brings its largest value to between 2^14 and 2^15. Values down to 2^-28 of the
largest are then kept within 2^-11 of themselves, smaller ones within 2^-39 of the largest.
"""

from __future__ import annotations

import hashlib
import math
import os
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from gibench import gate
from gibench.datasets.checked import Checked, Count, Sha256, parsed
from gibench.datasets.errors import DatasetError, FolderError, MakingError
from gibench.datasets.exr import decode
from gibench.datasets.files import as_json, sync_folder, through_no_link, write_whole
from gibench.datasets.folder import CACHE, claimed
from gibench.rendering.channels import CHANNELS

if TYPE_CHECKING:
    import pandas as pd

    from gibench.datasets.loading import Dataset

RECORD = "cache.json"
FORMAT = 1

TYPES: dict[str, np.dtype[Any]] = {
    "half": np.dtype("<f2"),
    "float": np.dtype("<f4"),
    "uint": np.dtype("<u4"),
}
"""Of the arrays, by how the channel contract says that a channel is stored."""

SCALED_TO = 15
"""Values that do not fit float16 are scaled below this power of two."""

Window = Sequence[int]
"""Top, left, height and width of a part of an image, pixels."""


class ChannelRecord(Checked):
    """An array. exponents: of the powers of two that frames were divided by; empty where all are 0."""

    sha256: Sha256
    exponents: list[Annotated[int, Field(ge=-200, le=200)]]


class CacheRecord(Checked):
    """`cache.json`. frames: what `frames_digest` says of the frames."""

    format: int
    frames: Sha256
    count: Count
    size: Annotated[list[int], Field(min_length=2, max_length=2)]
    channels: dict[str, ChannelRecord]


def frames_digest(table: pd.DataFrame) -> str:
    """SHA-256 of names and hashes of the frames of a dataset, in their order."""
    lines = (f"{file} {sha256}\n" for file, sha256 in zip(table["file"], table["sha256"], strict=True))
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def cache_bytes(dataset: Dataset, channels: Iterable[str]) -> int:
    """How much the arrays of some channels take."""
    width, height = dataset.manifest["recipe"]["resolution"]
    pixel = sum(CHANNELS[name].components * TYPES[CHANNELS[name].dtype].itemsize for name in channels)
    return len(dataset) * width * height * pixel


def make_cache(
    root: Path, channels: Iterable[str] = (), on_frame: Callable[[int, int], None] = lambda done, of: None
) -> tuple[str, ...]:
    """Decode channels of all frames of a dataset into its cache; those that are there stay.

    channels: names of the contract, all that the dataset has where none is named. on_frame: told how many frames are
    done, and of how many. Returns the names of the channels that were added. A cache of other frames, as one that was
    made before the dataset grew, is replaced.

    Raises DatasetError for a dataset that is not whole, a channel that it lacks and a frame that is not what was
    written, FolderError where the folder cannot be written or is in use, MakingError where the disk has no room.
    Nothing half-written stays.
    """
    from gibench.datasets.loading import open_dataset

    dataset = open_dataset(root)
    if not dataset.manifest["complete"]:
        raise DatasetError(f"{root} is not complete: to continue it run `{dataset.manifest['command']}`")
    present = dataset.manifest["recipe"]["channels"]
    names = tuple(channels) or tuple(present)
    if missing := [name for name in names if name not in present]:
        raise DatasetError(f"{root} has no channel '{missing[0]}'; it has {', '.join(present)}")
    with claimed(root):
        folder = root / CACHE
        record = _record(root)
        if record is None or record["frames"] != frames_digest(dataset.frames):
            _remove_arrays(folder)
            record = _new_record(dataset)
        left = tuple(name for name in names if name not in record["channels"])
        if not left:
            return ()
        try:
            folder.mkdir(exist_ok=True)
            needed, free = cache_bytes(dataset, left), shutil.disk_usage(folder).free
            if needed > free:
                raise MakingError(
                    f"{folder}: the arrays take {needed / 1e9:.1f} GB, and {free / 1e9:.1f} GB are free: free some "
                    "space, or name fewer channels"
                )
            added = _written(dataset, folder, left, on_frame)
            record["channels"] = {**record["channels"], **added}
            write_whole(folder / RECORD, as_json(record))
        except OSError as problem:
            raise FolderError(f"{problem.filename or folder}: {problem.strerror}") from None
        finally:
            _remove_partials(folder)
    return left


def _new_record(dataset: Dataset) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "frames": frames_digest(dataset.frames),
        "count": len(dataset),
        "size": list(dataset.manifest["recipe"]["resolution"]),
        "channels": {},
    }


def _written(
    dataset: Dataset, folder: Path, names: Sequence[str], on_frame: Callable[[int, int], None]
) -> dict[str, Any]:
    """Write the arrays; returns their entries in the record."""
    width, height = dataset.manifest["recipe"]["resolution"]
    arrays = {name: _Array(folder, name, (len(dataset), height, width)) for name in names}
    try:
        for number, frame in enumerate(dataset):
            content = gate.read_regular(frame.path, limit=2**34)
            if hashlib.sha256(content).hexdigest() != frame.row["sha256"]:
                raise DatasetError(
                    f"{frame.path} is not what was written: `gibench dataset verify` finds all such files"
                )
            for name, values in decode(content, names).items():
                arrays[name].add(values)
            on_frame(number + 1, len(dataset))
        return {name: array.finished() for name, array in arrays.items()}
    finally:
        for array in arrays.values():
            array.close()


class _Array:
    """An array that is written frame by frame, so that a full disk is an error and no crash of who maps it."""

    def __init__(self, folder: Path, name: str, shape: tuple[int, int, int]) -> None:
        """shape: frames, height and width."""
        channel = CHANNELS[name]
        self.dtype = TYPES[channel.dtype]
        self.path = folder / f"{name}.npy"
        self.partial = folder / f".{name}.npy.partial-{os.getpid()}"
        self.shape = (channel.components, *shape[1:])
        self.exponents: list[int] = []
        self.digest = hashlib.sha256()
        self.file: BinaryIO = open(self.partial, "wb", opener=through_no_link)  # noqa: SIM115
        header = {"descr": self.dtype.str, "fortran_order": False, "shape": (shape[0], *self.shape)}
        np.lib.format.write_array_header_1_0(self.file, header)

    def add(self, values: NDArray[Any]) -> None:
        """(H, W, C) of the next frame, as `decode` gives it."""
        exponent = 0
        if self.dtype == TYPES["half"] and values.dtype != np.float16:
            exponent = _exponent(values)
            values = np.ldexp(values, -exponent)
        content = np.ascontiguousarray(np.moveaxis(values, -1, 0), dtype=self.dtype)
        assert content.shape == self.shape
        self.exponents.append(exponent)
        self.digest.update(content.data)
        self.file.write(content.data)

    def finished(self) -> dict[str, Any]:
        """Give the array its name; returns its entry in the record."""
        self.file.flush()
        os.fsync(self.file.fileno())
        self.file.close()
        os.replace(self.partial, self.path)
        sync_folder(self.path.parent)
        return {
            "sha256": self.digest.hexdigest(),
            "exponents": self.exponents if any(self.exponents) else [],
        }

    def close(self) -> None:
        """Also half-written."""
        self.file.close()


def _exponent(values: NDArray[Any]) -> int:
    """Of the power of two to divide by, so that the largest value comes just below 2^SCALED_TO."""
    largest = float(np.abs(values).max(initial=0.0))
    return math.frexp(largest)[1] - SCALED_TO if largest > 0 else 0


class FrameCache:
    """The cache of a dataset, to read from; see `opened_cache`. It may be sent to other processes."""

    def __init__(self, root: Path, record: Mapping[str, Any], files: Iterable[str]) -> None:
        """files: of the frames of the dataset, in the order of its table."""
        self.root = root
        self._record = record
        self._numbers = {file: number for number, file in enumerate(files)}

    @property
    def channels(self) -> frozenset[str]:
        """Names of the channels that are in it."""
        return frozenset(self._record["channels"])

    def __getstate__(self) -> dict[str, Any]:
        """What another process opens the arrays anew from, in place of their content."""
        return {key: value for key, value in self.__dict__.items() if key != "_arrays"}

    @cached_property
    def _arrays(self) -> dict[str, NDArray[Any]]:
        return {}

    def _array(self, name: str) -> NDArray[Any]:
        if name not in self._arrays:
            self._arrays[name] = _mapped(self.root, name, self._record)
        return self._arrays[name]

    def stored(
        self, file: str, channels: Iterable[str], window: Window | None = None
    ) -> dict[str, tuple[NDArray[Any], int]]:
        """Channel → (C, H, W) of a frame, or of a window of it, and the exponent of the power of two that it lacks.

        file: as in the table. What is given is a part of the array itself: copy it. Raises DatasetError for an array
        that is not what the record says.
        """
        number = self._numbers[file]
        found = {}
        for name in channels:
            values = self._array(name)[number]
            if window is not None:
                top, left, height, width = window
                values = values[:, top : top + height, left : left + width]
            exponents = self._record["channels"][name]["exponents"]
            found[name] = values, exponents[number] if exponents else 0
        return found

    def read(
        self, file: str, channels: Iterable[str], window: Window | None = None
    ) -> dict[str, NDArray[Any]]:
        """Channel → (C, H, W) float32, or uint32 for ids, of a frame, or of a window of it; see `stored`."""
        found: dict[str, NDArray[Any]] = {}
        for name, (values, exponent) in self.stored(file, channels, window).items():
            found[name] = values.astype(np.uint32 if values.dtype == TYPES["uint"] else np.float32)
            if exponent:
                np.ldexp(found[name], exponent, out=found[name])
        return found


def opened_cache(dataset: Dataset) -> FrameCache | None:
    """The cache of the frames of a dataset or of some of them; None where there is none, or one of other frames.

    Raises DatasetError for one that is damaged.
    """
    from gibench.datasets.manifest import recipe_of
    from gibench.datasets.table import read_table

    record = _record(dataset.root)
    if record is None:
        return None
    table = dataset.frames
    if len(table) != record["count"]:  # these are some of the frames
        try:
            table = read_table(dataset.root, recipe_of(dataset.manifest))
        except gate.GateError:
            return None
    if record["frames"] != frames_digest(table):
        return None
    return FrameCache(dataset.root, record, map(str, table["file"]))


def _record(root: Path) -> dict[str, Any] | None:
    """The cache of a dataset; None where there is none. Raises DatasetError."""
    name = f"{CACHE}/{RECORD}"
    try:
        record = parsed(gate.read_inside(root, name), CacheRecord)
    except gate.GateError as problem:
        if problem.missing:
            return None
        raise DatasetError(f"{root / name} is not read: {problem}") from None
    except ValueError as problem:
        raise DatasetError(f"{root / name} is damaged ({problem}): remove {root / CACHE}") from None
    unknown = [name for name in record["channels"] if name not in CHANNELS]
    if record["format"] != FORMAT or unknown:
        raise DatasetError(f"{root / name} is of another gibench: remove {root / CACHE}")
    return record


def _mapped(root: Path, name: str, record: Mapping[str, Any]) -> NDArray[Any]:
    """An array of the cache, (frames, C, H, W). Raises DatasetError."""
    place = f"{CACHE}/{name}.npy"
    width, height = record["size"]
    shape = (record["count"], CHANNELS[name].components, height, width)
    try:
        # Pages that somebody writes to are copied; torch warns of arrays that nobody may write to.
        array = np.load(gate.inside(root, place), mmap_mode="c", allow_pickle=False)
        if array.shape != shape or array.dtype != TYPES[CHANNELS[name].dtype]:
            raise ValueError(f"it is {array.dtype} of shape {array.shape}")
    except (gate.GateError, ValueError, OSError) as problem:
        reason = " ".join(str(problem).split())
        raise DatasetError(
            f"{root / place} is not what the cache says ({reason}): remove {root / CACHE}, "
            "`gibench dataset cache` makes it anew"
        ) from None
    return np.asarray(array)


def cache_faults(root: Path, table: pd.DataFrame) -> list[tuple[str, str]]:
    """What is wrong with the cache of a dataset, as (file, what): hashes, sizes, frames that it is not of.

    table: a row a frame, as `manifest.frame_table` makes it.
    """
    place = f"{CACHE}/{RECORD}"
    try:
        record = _record(root)
    except DatasetError as problem:
        return [(place, str(problem))]
    if record is None:
        return []
    if record["frames"] != frames_digest(table):
        return [(place, "it is of other frames: `gibench dataset cache` makes it anew")]
    faults = []
    for name, known in record["channels"].items():
        try:
            array = _mapped(root, name, record)
        except DatasetError as problem:
            faults.append((f"{CACHE}/{name}.npy", str(problem)))
            continue
        digest = hashlib.sha256()
        for frame in array:
            digest.update(np.ascontiguousarray(frame).data)
        if digest.hexdigest() != known["sha256"]:
            faults.append((f"{CACHE}/{name}.npy", "its content is not what was written"))
    return faults


def _remove_arrays(folder: Path) -> None:
    """A cache of other frames goes, its record first."""
    if gate.real_folder(folder):
        (folder / RECORD).unlink(missing_ok=True)
        for name in CHANNELS:
            (folder / f"{name}.npy").unlink(missing_ok=True)


def _remove_partials(folder: Path) -> None:
    for left in gate.own_leftovers(folder, r"\.[a-z0-9_.]+\.partial-[0-9]+"):
        left.unlink(missing_ok=True)
