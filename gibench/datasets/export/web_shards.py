"""Tar shards as the library webdataset reads them: `train-000000.tar`, a sample a frame, an array a channel.

A sample has `<channel>.npy` (H, W, C), float16, float32 or uint32 as the dataset stores it, and `json`: its row with
the camera as matrices. Shards hold one split each, so that a loader is given a split by the name of its shards.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import webdataset

from gibench.datasets.export.frames import frame_name, row_of
from gibench.datasets.exr import decode
from gibench.datasets.loading import Dataset

SHARD_BYTES = 512 * 2**20
"""Size after which the next shard begins: large enough for a bucket, small enough to spread over loaders."""


def write(dataset: Dataset, channels: tuple[str, ...], out: Path, tell: Any) -> None:
    """Write the shards of every split."""
    done = 0
    for split in dict.fromkeys(dataset.frames["split"]):
        part = dataset.split(split)
        pattern = str(out / f"{split}-%06d.tar").replace("\\", "/")
        # The same bytes whenever they are written.
        with webdataset.ShardWriter(
            pattern, maxcount=2**31, maxsize=SHARD_BYTES, verbose=0, mtime=0
        ) as shards:
            for frame in part:
                arrays = decode(frame.path, channels or None)
                shards.write(
                    {
                        "__key__": frame_name(frame),
                        **{f"{name}.npy": values for name, values in arrays.items()},
                        "json": json.dumps(row_of(frame)).encode(),
                    }
                )
                done += 1
                tell(done, len(dataset))
