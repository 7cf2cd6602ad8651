"""Datasets in the layouts that other tools read. A format is one file here and one line in `FORMATS`."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from pathlib import Path

from gibench.datasets.errors import DatasetError, FolderError, nearest
from gibench.datasets.files import whole_folder
from gibench.datasets.loading import Dataset

Tell = Callable[[int, int], None]
"""Told the number of frames that are done, and of all."""

#: Format → module with `write(dataset, channels, out, tell)`. Imported when it is asked for: each needs a library.
FORMATS = {
    "huggingface": "gibench.datasets.export.huggingface",
    "hypersim-like-hdf5": "gibench.datasets.export.hypersim_hdf5",
    "nerfstudio": "gibench.datasets.export.nerfstudio",
    "webdataset": "gibench.datasets.export.web_shards",
}


def export(
    dataset: Dataset,
    to: str,
    out: str | Path,
    *,
    channels: Sequence[str] = (),
    tell: Tell = lambda done, of: None,
) -> Path:
    """Write a dataset, or the part of one that an index or a split gave, in another layout.

    to: one of `FORMATS`. out: a folder that does not exist yet; it appears when it is whole. channels: those to
    write, all that the frames have where none is named; `nerfstudio` takes `color`, `depth` and `position` of them.
    Returns the folder. Raises `DatasetError` (an unknown format, no frame, a library that is not installed),
    `FolderError` (out exists or cannot be written), `UnknownChannel` or `StorageError`.
    """
    if to not in FORMATS:
        raise DatasetError(f"no format '{to}'; {nearest(to, FORMATS)}")
    if not len(dataset):
        raise DatasetError(f"{dataset.root} has no frame to export")
    try:
        write = importlib.import_module(FORMATS[to]).write
    except ImportError as problem:
        raise DatasetError(f"{to} needs the library {problem.name}: pip install 'gibench[export]'") from None
    out = Path(out)
    if out.exists():
        raise FolderError(f"{out} exists: choose a new folder with --out")
    try:
        with whole_folder(out) as partial:
            write(dataset, tuple(channels), partial, tell)
    except OSError as problem:
        raise FolderError(f"{out} cannot be written: {problem.strerror or problem}") from None
    return out
