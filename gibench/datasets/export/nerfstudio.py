"""A folder a room with `transforms.json`, as nerfstudio's and Instant-NGP's loaders read it.

Source: docs.nerf.studio, "Data conventions". Pictures are 8-bit sRGB, all of a room under one exposure; depth is along
the optical axis, 16-bit PNG in millimetres, 0 where nothing is hit or beyond 65.5 m. With `position` a point cloud
(`ply_file_path`) comes along, for methods that start from one.
"""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

from gibench.datasets.export.frames import opengl_pose, picture
from gibench.datasets.files import as_json
from gibench.datasets.loading import Dataset, Frame

MILLIMETRES = 1000
POINTS = 100_000
"""At most this many points a room."""


def write(dataset: Dataset, channels: tuple[str, ...], out: Path, tell: Any) -> None:
    """Write `out/room-000017/transforms.json` and its pictures for every room."""
    done = 0
    frames = sorted(dataset, key=lambda frame: (frame.room, frame.view))
    for frame in frames:
        opengl_pose(frame)  # raises before anything is written where there is none
    for room, of_room in groupby(frames, lambda frame: frame.room):
        folder = out / f"room-{room:06d}"
        listed = list(of_room)
        exposure = float(np.median([frame.row["exposure"] for frame in listed]))
        entries, points = [], []
        for frame in listed:
            wanted = channels or tuple(
                name for name in ("color", "depth", "position") if name in frame.channels
            )
            arrays = frame.read(*wanted)
            entries.append(_entry(frame, arrays, exposure, folder))
            if "position" in arrays and "color" in arrays:
                points.append(_points(arrays, exposure, POINTS // len(listed)))
            done += 1
            tell(done, len(frames))
        content: dict[str, Any] = {"camera_model": "OPENCV", "frames": entries}
        if points:
            places, colors = (np.concatenate(parts) for parts in zip(*points, strict=True))
            (folder / "points.ply").write_bytes(trimesh.PointCloud(places, colors).export(file_type="ply"))
            content["ply_file_path"] = "points.ply"
        (folder / "transforms.json").write_bytes(as_json(content))


def _entry(frame: Frame, arrays: dict[str, NDArray[Any]], exposure: float, folder: Path) -> dict[str, Any]:
    k = frame.intrinsics
    entry: dict[str, Any] = {
        "fl_x": k[0, 0],
        "fl_y": k[1, 1],
        "cx": k[0, 2],
        "cy": k[1, 2],
        "w": int(frame.row["width"]),
        "h": int(frame.row["height"]),
        **dict.fromkeys(("k1", "k2", "p1", "p2"), 0.0),
        "transform_matrix": opengl_pose(frame).tolist(),
    }
    if "color" in arrays:
        entry["file_path"] = f"images/{frame.view:04d}.png"
        _save(Image.fromarray(picture(arrays["color"], exposure), "RGB"), folder / entry["file_path"])
    if "depth" in arrays:
        entry["depth_file_path"] = f"depth/{frame.view:04d}.png"
        millimetres = np.rint(arrays["depth"][..., 0].astype(np.float64) * MILLIMETRES)
        stored = np.where(millimetres <= np.iinfo(np.uint16).max, millimetres, 0).astype(np.uint16)
        _save(Image.fromarray(stored), folder / entry["depth_file_path"])
    return entry


def _save(image: Image.Image, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    image.save(path)


def _points(
    arrays: dict[str, NDArray[Any]], exposure: float, most: int
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Positions (N, 3) and colours (N, 3) of an even choice of at most `most` pixels that hit something."""
    positions = arrays["position"].reshape(-1, 3)
    hit = np.flatnonzero(positions.any(axis=1))
    chosen = hit[:: max(1, -(-len(hit) // max(most, 1)))]
    return positions[chosen], picture(arrays["color"], exposure).reshape(-1, 3)[chosen]
