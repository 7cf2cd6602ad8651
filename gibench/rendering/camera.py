"""The pinhole camera of a frame, and what it does to points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.errors import GibenchError
from gibench.rendering.backend import is_scalar

NEAREST_TARGET = 1e-9
"""Metres: a target that is no farther away gives no direction."""


class CameraError(GibenchError, ValueError):
    """A camera that sees nothing, or a resolution that is none."""


@dataclass(frozen=True)
class PinholeCamera:
    """A pinhole camera with Z up.

    position, target: world space, metres, not equal. fov: horizontal field of view, radians, in (0, π).
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    fov: float

    def __post_init__(self) -> None:
        """Raises CameraError for what is no camera. Numbers of NumPy become Python's, which alone Mitsuba takes."""
        for name in ("position", "target"):
            object.__setattr__(self, name, tuple(float(c) for c in getattr(self, name)))
        object.__setattr__(self, "fov", float(self.fov))
        finite = np.isfinite([*self.position, *self.target, self.fov]).all()
        apart = np.linalg.norm(np.subtract(self.target, self.position)) > NEAREST_TARGET if finite else False
        if not (apart and 0 < self.fov < np.pi):
            raise CameraError(
                f"camera at {self.position} towards {self.target} with a field of view of {self.fov} rad: position "
                "and target must be finite and apart, the field of view between 0 and pi"
            )

    @property
    def frame(self) -> NDArray[np.float64]:
        """(3, 3): unit right, down and forward in world space, by row; what pixel x, pixel y and depth grow along.

        A camera that looks exactly along Z has no horizon: its right is then world x.
        """
        forward = np.subtract(self.target, self.position).astype(np.float64)
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        length = np.linalg.norm(right)
        right = right / length if length > 1e-7 else np.array([1.0, 0.0, 0.0])
        return np.array([right, np.cross(forward, right), forward])

    @property
    def up(self) -> tuple[float, float, float]:
        """What a look-at transform takes as up: Z, or the top of the image where the view is along Z or next to it."""
        x, y, z = -self.frame[1]
        return (0.0, 0.0, 1.0) if z > 1e-3 else (float(x), float(y), float(z))

    def focal_length(self, width: int) -> float:
        """In pixels."""
        return 0.5 * width / float(np.tan(0.5 * self.fov))

    def project(
        self, points: NDArray[np.floating], resolution: tuple[int, int]
    ) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
        """Pixel coordinates (x, y) and depth of world points (…, 3); inside of kernels: `RayGenerator.project`.

        The centre of the first pixel is (0.5, 0.5). Where the depth is not positive, x and y mean nothing.

        >>> camera = PinholeCamera(position=(0, 0, 1), target=(0, 5, 1), fov=np.pi / 2)
        >>> x, y, depth = camera.project(np.array([[0.0, 2.0, 1.0], [1.0, 2.0, 1.0]]), (64, 48))
        >>> x.tolist(), y.tolist(), depth.tolist()
        ([32.0, 48.0], [24.0, 24.0], [2.0, 2.0])
        """
        width, height = resolution
        focal = self.focal_length(width)
        x, y, depth = np.moveaxis((points - np.array(self.position)) @ self.frame.T, -1, 0)
        return x / depth * focal + 0.5 * width, y / depth * focal + 0.5 * height, depth


def check_resolution(resolution: tuple[int, int]) -> tuple[int, int]:
    """(width, height) as integers in [1, 16384]. Raises CameraError."""
    width, height = resolution
    if not (1 <= int(width) == width <= 16384 and 1 <= int(height) == height <= 16384):
        raise CameraError(
            f"resolution {width}x{height}: width and height must be whole numbers from 1 to 16384"
        )
    return int(width), int(height)


class RayGenerator:
    """Rays of a camera, with its numbers kept out of the compiled kernel, so that one kernel serves all frames.

    origin: mi.Point3f, m. axes: unit mi.Vector3f, as `PinholeCamera.frame`. scale: mi.Float, size of a pixel over its
    depth. centre: mi.Vector2f of the film, pixels.
    """

    def __init__(self, camera: PinholeCamera, resolution: tuple[int, int]) -> None:
        """Under the current variant."""
        import drjit as dr
        import mitsuba as mi

        width, height = check_resolution(resolution)
        focal = camera.focal_length(width)
        self.origin = mi.Point3f(list(camera.position))
        self.axes = [mi.Vector3f(row.tolist()) for row in camera.frame]
        self.scale = mi.Float(1 / focal)
        self.centre = mi.Vector2f(0.5 * width, 0.5 * height)
        if not is_scalar():
            dr.make_opaque(self.origin, self.axes, self.scale, self.centre)

    @property
    def forward(self) -> Any:
        """Unit vector along the optical axis."""
        return self.axes[2]

    def project(self, points: Any) -> tuple[Any, Any]:
        """Film positions (mi.Point2f, as `rays` takes them) and depth (mi.Float, m) of world points (mi.Point3f).

        Where the depth is not positive, the position means nothing.
        """
        import drjit as dr
        import mitsuba as mi

        offset = points - self.origin
        right, down, depth = (dr.dot(axis, offset) for axis in self.axes)
        inverse = dr.rcp(dr.select(depth > 0, depth, 1) * self.scale)
        return mi.Point2f(right, down) * inverse + self.centre, depth

    def rays(self, pixel: Any) -> Any:
        """Rays through film positions `pixel` (mi.Point2f, pixels; (0, 0) is the outer corner of the first pixel)."""
        import drjit as dr
        import mitsuba as mi

        offset = (pixel - self.centre) * self.scale
        right, down, forward = self.axes
        return mi.Ray3f(self.origin, dr.normalize(offset.x * right + offset.y * down + forward))
