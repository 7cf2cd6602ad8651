"""Shared by the formats: names of frames, pictures for screens, rows as JSON, cameras in OpenGL's convention."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.datasets.errors import DatasetError
from gibench.datasets.loading import Frame
from gibench.metrics import tone_map


def frame_name(frame: Frame) -> str:
    """Name of a frame that is unique in its dataset and sorts by room and view: "000017_0003"."""
    return f"{frame.room:06d}_{frame.view:04d}"


def picture(color: NDArray[Any], exposure: float) -> NDArray[np.uint8]:
    """Radiance as people see it: (H, W, 3) uint8, sRGB-encoded, after the display's tone mapping of `tone_map`."""
    return np.rint(255 * np.clip(tone_map(color, exposure), 0, 1)).astype(np.uint8)


def row_of(frame: Frame) -> dict[str, Any]:
    """The frame's row of the table without its place on this disk, and its camera: all that JSON can hold.

    camera_to_world: 4 × 4, OpenCV's convention, metres; intrinsics: 3 × 3, pixels (`Frame.camera_to_world`,
    `Frame.intrinsics`). Numbers that are not finite become None.
    """
    row = {name: plain(value) for name, value in frame.row.items() if name not in ("file", "bytes", "sha256")}
    return {
        **row,
        "camera_to_world": frame.camera_to_world.tolist(),
        "intrinsics": frame.intrinsics.tolist(),
    }


def plain(value: Any) -> Any:
    """A number of NumPy as one of Python; None for what JSON has no number for."""
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value


def opengl_pose(frame: Frame) -> NDArray[np.float64]:
    """(4, 4) camera to world with x to the right, y up and the view along −z, metres, world Z up.

    Raises `DatasetError` where the camera is mirrored, for which tools of this convention have no pose.
    """
    if frame.camera.mirrored:
        raise DatasetError(
            f"room {frame.room}, view {frame.view} has a mirrored camera, which this format has no pose for: leave the "
            "frame out, or export to webdataset or huggingface"
        )
    return frame.camera_to_world @ np.diag([1.0, -1.0, -1.0, 1.0])
