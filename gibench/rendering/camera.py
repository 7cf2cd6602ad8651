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

ALONG = 1e-7
"""Sine of the angle between the view and up below which they count as parallel."""

FARTHEST_CENTRE = 1e5
"""Sizes of the image that the principal point may be away: pixels of its middle are still told apart in float32."""


class CameraError(GibenchError, ValueError):
    """A camera that sees nothing, or a resolution that is none."""


@dataclass(frozen=True)
class PinholeCamera:
    """A pinhole camera, with Z up unless it says otherwise.

    position, target: world space, metres, not equal. fov: horizontal field of view, radians, in (0, π): of an image
    that is centred, so that a shifted centre changes no distance in pixels. up: world space, of any length and not
    along the view; the top of the image is what of it is at right angles to the view. principal_point: where the
    optical axis meets the image, from its middle to the right and down, as shares of its width and height. mirrored:
    whether left and right of the image are exchanged.
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    fov: float
    up: tuple[float, float, float] | None = None
    principal_point: tuple[float, float] = (0.0, 0.0)
    mirrored: bool = False

    def __post_init__(self) -> None:
        """Raises CameraError for a wrong value. Numbers of NumPy become Python's, which alone Mitsuba takes."""
        for name in ("position", "target", "principal_point", *(["up"] if self.up is not None else [])):
            object.__setattr__(self, name, tuple(float(c) for c in getattr(self, name)))
        object.__setattr__(self, "fov", float(self.fov))
        object.__setattr__(self, "mirrored", bool(self.mirrored))
        finite = np.isfinite([*self.position, *self.target, self.fov]).all()
        apart = np.linalg.norm(np.subtract(self.target, self.position)) > NEAREST_TARGET if finite else False
        if not (apart and 0 < self.fov < np.pi):
            raise CameraError(
                f"camera at {self.position} towards {self.target} with a field of view of {self.fov} rad: position "
                "and target must be finite and apart, the field of view between 0 and pi"
            )
        if len(self.principal_point) != 2 or not (np.abs(self.principal_point) <= FARTHEST_CENTRE).all():
            raise CameraError(
                f"camera at {self.position}: its principal point {self.principal_point} must be two numbers up to "
                f"{FARTHEST_CENTRE:g} sizes of the image away"
            )
        if self.up is not None and not self._stands():
            raise CameraError(
                f"camera at {self.position} towards {self.target}: up {self.up} must be finite and not along the view"
            )

    def _stands(self) -> bool:
        """Whether `up` is a direction that is not along the view."""
        up = np.array(self.up)
        if up.shape != (3,) or not np.isfinite(up).all() or not (largest := np.abs(up).max()) > 0:
            return False
        forward = np.subtract(self.target, self.position)
        up = up / largest
        sine = np.linalg.norm(np.cross(forward / np.linalg.norm(forward), up / np.linalg.norm(up)))
        return bool(sine > ALONG)

    @property
    def frame(self) -> NDArray[np.float64]:
        """(3, 3): unit right, down and forward in world space, by row; what pixel x, pixel y and depth grow along.

        Its determinant is 1, and −1 where the camera is mirrored. A camera that looks exactly along Z and has no up of
        its own has no horizon: its right is then world x.
        """
        forward = np.subtract(self.target, self.position).astype(np.float64)
        forward /= np.linalg.norm(forward)
        up = np.array([0.0, 0.0, 1.0] if self.up is None else self.up)
        right = np.cross(forward, up / np.abs(up).max())
        length = np.linalg.norm(right)
        right = right / length if self.up is not None or length > ALONG else np.array([1.0, 0.0, 0.0])
        return np.array([-right if self.mirrored else right, np.cross(forward, right), forward])

    @property
    def look_at_up(self) -> tuple[float, float, float]:
        """The up vector of a look-at transform: Z, or the top of the image where that is not as good as the same.

        A mirror image is not in it.
        """
        x, y, z = -self.frame[1]
        return (0.0, 0.0, 1.0) if self.up is None and z > 1e-3 else (float(x), float(y), float(z))

    def focal_length(self, width: int) -> float:
        """In pixels."""
        return 0.5 * width / float(np.tan(0.5 * self.fov))

    def centre(self, resolution: tuple[int, int]) -> tuple[float, float]:
        """Principal point in an image of (width, height): x and y in pixels from its upper left corner."""
        (width, height), (x, y) = resolution, self.principal_point
        return 0.5 * width + x * width, 0.5 * height + y * height

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
        focal = self.focal_length(resolution[0])
        across, down = self.centre(resolution)
        x, y, depth = np.moveaxis((points - np.array(self.position)) @ self.frame.T, -1, 0)
        return x / depth * focal + across, y / depth * focal + down, depth


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
    depth. centre: mi.Vector2f, where the optical axis meets the film, pixels. size: mi.Vector2f, of the film, pixels.
    """

    def __init__(self, camera: PinholeCamera, resolution: tuple[int, int]) -> None:
        """Under the current variant."""
        import drjit as dr
        import mitsuba as mi

        resolution = check_resolution(resolution)
        focal = camera.focal_length(resolution[0])
        self.origin = mi.Point3f(list(camera.position))
        self.axes = [mi.Vector3f(row.tolist()) for row in camera.frame]
        self.scale = mi.Float(1 / focal)
        self.centre = mi.Vector2f(*camera.centre(resolution))
        self.size = mi.Vector2f(*map(float, resolution))
        if not is_scalar():
            dr.make_opaque(self.arrays)

    @classmethod
    def of(cls, arrays: dict[str, Any]) -> RayGenerator:
        """The generator whose `arrays` these are."""
        generator = object.__new__(cls)
        generator.origin, generator.axes = arrays["origin"], arrays["axes"]
        generator.scale, generator.centre, generator.size = arrays["scale"], arrays["centre"], arrays["size"]
        return generator

    @property
    def arrays(self) -> dict[str, Any]:
        """What `of` makes it from again; see `replay.HoldsArrays`."""
        return {
            "origin": self.origin,
            "axes": self.axes,
            "scale": self.scale,
            "centre": self.centre,
            "size": self.size,
        }

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
