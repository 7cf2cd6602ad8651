"""HDF5 files in the places and under the names of the Hypersim dataset, a scene a room.

Source: Roberts et al. 2021, "Hypersim", and the tables of its repository. `ai_000_017` is room 17. Beside Hypersim's
names for what it has too, every other channel stands under its own. Distances are metres, so a unit of a scene is 1 m;
`depth_meters` is the distance along the ray, as there; `diffuse_illumination` × `diffuse_reflectance` + `residual` =
`color`.
"""

from __future__ import annotations

import csv
from itertools import groupby
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from gibench.datasets.errors import DatasetError
from gibench.datasets.export.frames import opengl_pose
from gibench.datasets.exr import decode
from gibench.datasets.loading import Dataset, Frame

GEOMETRY = {
    "distance": "depth_meters",
    "position": "position",
    "normal": "normal_world",
    "geometric_normal": "normal_world_geometric",
    "shape_id": "render_entity_id",
    "material_id": "semantic_material",
}
"""Our channel → its name in the folder `…_geometry_hdf5`. Hypersim's id of a miss is −1."""

LIGHT = {"color": "color", "albedo": "diffuse_reflectance"}
"""Our channel → its name in the folder `…_final_hdf5`; what is in neither table goes there under its own name."""


def write(dataset: Dataset, channels: tuple[str, ...], out: Path, tell: Any) -> None:
    """Write a folder a room."""
    done = 0
    frames = sorted(dataset, key=lambda frame: (frame.room, frame.view))
    for frame in frames:
        if any(frame.camera.principal_point):
            raise DatasetError(
                f"room {frame.room}, view {frame.view} has an off-centre camera, which Hypersim's tables have no "
                "column for: leave the frame out, or choose another format"
            )
        opengl_pose(frame)  # raises before anything is written where there is none
    for room, of_room in groupby(frames, lambda frame: frame.room):
        folder = out / f"ai_{room // 1000:03d}_{room % 1000:03d}"
        listed = list(of_room)
        for frame in listed:
            _write_frame(frame, channels, folder / "images")
            done += 1
            tell(done, len(frames))
        _write_cameras(listed, folder / "_detail")


def _write_frame(frame: Frame, channels: tuple[str, ...], images: Path) -> None:
    arrays = decode(frame.path, channels or None)
    names: dict[str, NDArray[Any]] = {}
    for channel, values in arrays.items():
        group = "geometry" if channel in GEOMETRY else "final"
        name = {**GEOMETRY, **LIGHT}.get(channel, channel)
        if channel.endswith("_id"):
            values = np.where(values > 0, values.astype(np.int64), -1).astype(np.int32)
        names[f"scene_cam_00_{group}_hdf5/frame.{frame.view:04d}.{name}.hdf5"] = values
    if {"color", "albedo", "direct_diffuse", "indirect_diffuse"} <= arrays.keys():
        color, albedo, *diffuse = (
            arrays[name].astype(np.float32)
            for name in ("color", "albedo", "direct_diffuse", "indirect_diffuse")
        )
        light = np.divide(sum(diffuse), albedo, out=np.zeros_like(albedo), where=albedo > 0)
        place = f"scene_cam_00_final_hdf5/frame.{frame.view:04d}"
        names[f"{place}.diffuse_illumination.hdf5"] = light
        names[f"{place}.residual.hdf5"] = color - light * albedo
    for name, values in names.items():
        path = images / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with h5py.File(path, "w") as file:
            # Hypersim's files hold one array of this name; single values a pixel have no third axis there.
            single = values.shape[-1] == 1
            file.create_dataset("dataset", data=values[..., 0] if single else values, compression="gzip")


def _write_cameras(frames: list[Frame], detail: Path) -> None:
    folder = detail / "cam_00"
    folder.mkdir(parents=True)
    poses = np.array([opengl_pose(frame) for frame in frames])
    for name, values in (
        ("camera_keyframe_positions", poses[:, :3, 3]),
        ("camera_keyframe_orientations", poses[:, :3, :3]),
        ("camera_keyframe_frame_indices", np.array([frame.view for frame in frames])),
    ):
        with h5py.File(folder / f"{name}.hdf5", "w") as file:
            file.create_dataset("dataset", data=values)
    _write_csv(detail / "metadata_cameras.csv", [["camera_name"], ["cam_00"]])
    _write_csv(
        detail / "metadata_scene.csv",
        [["parameter_name", "parameter_value"], ["meters_per_asset_unit", 1.0]],
    )
    # Hypersim's own cameras have one field of view; here each frame has its own.
    _write_csv(
        detail / "metadata_camera_parameters.csv",
        [
            ["camera_name", "frame_id", "settings_output_img_width", "settings_output_img_height", "fov_x"],
            *(
                ["cam_00", frame.view, int(frame.row["width"]), int(frame.row["height"]), frame.camera.fov]
                for frame in frames
            ),
        ],
    )


def _write_csv(path: Path, rows: list[list[Any]]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(rows)
