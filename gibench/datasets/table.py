"""Reading `frames.parquet` of a dataset from anywhere.

Parquet states in its footer how much comes out of it, and a few hundred bytes may state billions of rows. So the footer
is looked at first: columns, types, encodings, and whether as many frames can be there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gibench import gate
from gibench.datasets.checked import shown
from gibench.datasets.errors import DatasetError
from gibench.datasets.folder import TABLE
from gibench.datasets.manifest import columns_of
from gibench.datasets.recipes import Recipe

if TYPE_CHECKING:
    import pandas as pd

#: Rows up to which a table is believed without looking for the frames: they take a few megabytes.
BELIEVED_ROWS = 100_000

#: Most cameras that a scene brings along.
MOST_CAMERAS = 10_000

#: Most bytes of one text in the table.
LONGEST_TEXT = 1000

#: How columns are written. Others multiply what is stored, such as strings as changes of the one before.
ENCODINGS = {"PLAIN", "PLAIN_DICTIONARY", "RLE", "RLE_DICTIONARY", "BIT_PACKED"}

#: What older tables lack and was a number all the same; everything else is filled with NaN, "" or 0.
FILLED = {"principal_point_x": 0.0, "principal_point_y": 0.0}

#: Columns that every table has.
ALWAYS = (
    *("room", "view", "split", "kind", "file", "sha256", "bytes", "width", "height"),
    *(f"{what}_{axis}" for what in ("camera", "target") for axis in "xyz"),
    *("fov", "path", "step", "exposure", "largest", "spp", "paths", "invalid_paths", "median_error"),
    *("kernel_seconds", "denoise_seconds", "seconds", "seed"),
)

FILE = r"rooms/[0-9]{6,9}/frames/[0-9]{4,6}\.exr"


def read_table(root: Path, recipe: Recipe) -> pd.DataFrame:
    """Read the table of a dataset. Raises `gate.GateError` (`missing` where there is none) and `DatasetError`."""
    path, columns = gate.inside(root, TABLE), columns_of(recipe)
    problem = None
    try:
        problem = next(_footer_problems(root, path, recipe), None)
        frames = None if problem else _read(path, columns)
        problem = problem or next(_problems(frames, columns), None)
    except Exception as failure:  # Arrow raises whatever its C++ side threw
        problem = " ".join(str(failure).split())[:200]
    if problem or frames is None:
        raise DatasetError(
            f"{path} is damaged ({problem}): remove it and run the command of its manifest again"
        )
    return frames


def _read(path: Path, columns: dict[str, str]) -> pd.DataFrame:
    import pandas as pd
    import pyarrow.compute as pc
    import pyarrow.parquet as pq

    there = pq.read_schema(path).names
    texts = [name for name, dtype in columns.items() if dtype == "str" and name in there]
    # As dictionaries, so that a long text that stands in every row is looked at once.
    with pq.ParquetFile(path, read_dictionary=texts) as file:
        for name, column in zip(texts, file.read(columns=texts).columns, strict=True):
            for chunk in column.chunks:
                longest = pc.max(pc.binary_length(chunk.dictionary)).as_py() or 0
                if longest > LONGEST_TEXT:
                    raise ValueError(f"column {name} holds a text of {longest} bytes")
    frames = pd.read_parquet(path)
    for name, dtype in columns.items():
        if name not in there:
            missing = FILLED.get(name, {"str": "", "int64": 0, "float64": math.nan}[dtype])
            frames[name] = pd.Series(missing, frames.index, dtype)
    return frames[[*columns, *(name for name in there if name not in columns)]]


def _footer_problems(root: Path, path: Path, recipe: Recipe) -> Iterator[str]:
    import pyarrow.parquet as pq

    with pq.ParquetFile(path, thrift_string_size_limit=2**24, thrift_container_size_limit=10**6) as file:
        footer, schema = file.metadata, file.schema_arrow
    names, columns = list(schema.names), columns_of(recipe)
    if len(set(names)) < len(names) or len(names) > 1000:
        yield "its columns are not told apart"
    for name in ALWAYS:
        if name not in names:
            yield f"it has no column {name}"
    for name, dtype in columns.items():
        if name not in names:
            continue
        there = str(schema.field(name).type)
        if (
            there.removeprefix("large_")
            not in {"str": "string", "int64": "int64", "float64": "double"}[dtype]
        ):
            yield f"its column {name} holds {shown(there)}"
    rows = footer.num_rows
    views = len(recipe.rendered_views()) + (MOST_CAMERAS if recipe.scenes else 0)
    if not 0 <= rows <= recipe.rooms * views:
        yield f"it states {rows} frames, the recipe has {recipe.rooms} rooms of at most {views}"
    if rows > BELIEVED_ROWS and (there_are := _frame_files(root)) < rows:
        yield f"it states {rows} frames, and {there_are} lie in the folder"
    groups = [footer.row_group(i) for i in range(footer.num_row_groups)]
    if sum(group.num_rows for group in groups) != rows:
        yield "its footer contradicts itself"
    for group in groups:
        for column in (group.column(i) for i in range(group.num_columns)):
            if column.num_values != group.num_rows:
                yield "its footer contradicts itself"
            if not ENCODINGS.issuperset(column.encodings):
                yield f"its column {shown(column.path_in_schema)} is in an encoding that gibench does not write"
            if column.total_uncompressed_size > 2**20 + LONGEST_TEXT * group.num_rows:
                yield f"its column {shown(column.path_in_schema)} states {column.total_uncompressed_size} bytes"


def _frame_files(root: Path) -> int:
    return sum(1 for _ in root.glob("rooms/*/frames/*.exr"))


def _problems(frames: Any, columns: dict[str, str]) -> Iterator[str]:
    for name, dtype in columns.items():
        kinds = {"str": "OUT", "int64": "iu", "float64": "f"}[dtype]
        if frames[name].dtype.kind not in kinds or (dtype != "float64" and frames[name].isna().any()):
            yield f"its column {name} has rows without a value"
    for name in ("room", "view", "step", "bytes"):
        if (frames[name] < 0).any():
            yield f"its column {name} has a number below 0"
    for name in ("width", "height"):
        if not frames[name].between(1, 2**15).all():
            yield f"its column {name} has a number that no image has"
    if not frames["fov"].between(0, math.pi, inclusive="neither").all():
        yield "its column fov has an angle that no camera has"
    for split in frames["split"].unique():
        if not gate.is_name(split):
            yield f"its column split holds {shown(str(split))}, which is no name"
    strange = frames["file"][~frames["file"].str.fullmatch(FILE)]
    if len(strange):
        yield f"its column file leads to {shown(str(strange.iloc[0]))}, which is no frame of a dataset"
