"""Space for area lights in a room: the free space, and whether a rectangle has room there.

What stands in the way is found with rays, which know every kind of shape alike. A box around the rectangle, larger by
the clearance on every side, must be empty: no ray of a grid along any of its three axes may meet anything.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import mitsuba as mi
import numpy as np
import shapely
from numpy.typing import NDArray

from gibench.generators.light_shapes import light_mesh
from gibench.generators.parts import FloatArray, Mesh, Room
from gibench.generators.shapes import merge
from gibench.rendering.backend import BackendError, is_scalar, select_variant
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.free_space import NoFreeSpace, cast, seen_from, surroundings
from gibench.rendering.lighting import AreaLight
from gibench.rendering.scene import Scene, load_dict

if TYPE_CHECKING:
    from gibench.generators.parts import Camera

CLEARANCE = 0.2
"""Least distance of a light to anything, m."""

COARSE, FINE = 0.1, 0.005
"""Distance between the rays that search a box, m: first those that leave few candidates, then those that find the cord
of a lamp."""

PROPOSED = 4096
"""Points of a generated room that are looked at, of which those in its free space are kept."""

LIT_RAYS = 64
LEAST_LIT = 0.5
"""Share of a light's rays that must meet something: one that shines out of a window lights nothing."""

LARGEST_IN_VIEW = 0.15
"""Share of an image that the light itself may cover: one before the lens hides what it lights."""

NEAREST = 0.01
"""Of what a camera sees, m."""


@dataclass(frozen=True, eq=False)
class LightSpace:
    """A scene, and points (N, 3) all over its free space, metres. reach: how far from such a point a light may be, m.

    A light that is no farther from one of the points than the clearance, in a box that is empty, is in free space too.
    """

    scene: Scene
    points: FloatArray

    def __post_init__(self) -> None:
        """Raises BackendError under the variant scalar_rgb, and NoFreeSpace where there is no point."""
        if is_scalar():
            raise BackendError("area lights are placed with many rays, for which scalar_rgb is too slow")
        if not len(self.points):
            raise NoFreeSpace("there is no free space for an area light")

    @cached_property
    def reach(self) -> float:
        """Half of the distance to the next point, about, but no more than the clearance."""
        extent = np.ptp(self.points, axis=0)
        return float(min(CLEARANCE, 0.5 * np.cbrt(max(extent.prod(), 0.0) / len(self.points))))

    def sample_point(self, rng: np.random.Generator) -> FloatArray:
        """(3,) a point of the free space, not only one of those that are known, metres."""
        return np.asarray(self.points[int(rng.integers(len(self.points)))] + in_ball(rng, self.reach))

    def free(self, lights: Sequence[AreaLight]) -> NDArray[np.bool_]:
        """(N,) whether lights keep their distance to everything and shine at something.

        The centre of each is within the clearance of one of the points.
        """
        good = empty(self.scene, lights, COARSE)
        # One by one: the fine grid has 200 000 rays a light.
        good[good] = [
            empty(self.scene, [light], FINE)[0] and self._lights_something(light)
            for light, candidate in zip(lights, good, strict=True)
            if candidate
        ]
        return good

    def first_free(self, lights: Sequence[AreaLight]) -> AreaLight | None:
        """The first light that `free` would let pass, or None."""
        likely = np.flatnonzero(empty(self.scene, lights, COARSE))
        return next((lights[k] for k in likely.tolist() if self.free([lights[k]])[0]), None)

    def _lights_something(self, light: AreaLight) -> bool:
        """Whether enough of its rays meet a front face; they are spread as its light is."""
        count = np.arange(LIT_RAYS) + 0.5
        # A Fibonacci lattice on the disk, lifted to the hemisphere, has the density of the cosine (Malley).
        radius, turn = np.sqrt(count / LIT_RAYS), count * np.pi * (3 - np.sqrt(5))
        local = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - count / LIT_RAYS)])
        origins = np.tile(np.asarray(light.centre), (LIT_RAYS, 1))
        _, front = cast(self.scene, origins, local @ light.axes)
        return bool(front.mean() >= LEAST_LIT)


def in_ball(rng: np.random.Generator, radius: float) -> FloatArray:
    """(3,) a vector anywhere in a ball."""
    towards = rng.normal(size=3)
    return np.asarray(towards / np.linalg.norm(towards) * radius * np.cbrt(rng.random()))


def room_light_space(room: Room, scene: Scene | None = None) -> LightSpace:
    """The light space of a generated room: what its cameras see from where they are.

    scene: the room as it was loaded; without it the meshes are taken as they are, and nothing is written.
    """
    scene = _bare_scene(room) if scene is None else scene
    shell = room.parameters["shell"]
    half = np.array([shell["width"], shell["depth"]]) / 2
    # Fixed: where lights can be is a property of the room, and which of the places are taken is drawn later.
    points = np.random.default_rng(0).uniform((*-half, 0.0), (*half, shell["height"]), (PROPOSED, 3))
    points = points[seen_from(scene, points, np.array([camera.position for camera in room.cameras]))]
    free, _ = surroundings(scene, points)
    return LightSpace(scene, points[free])


def _bare_scene(room: Room) -> Scene:
    """A room without materials and light, from its meshes."""
    select_variant()
    shapes = {
        thing.name.replace(".", "_"): merge([mesh for mesh, _ in thing.shapes]) for thing in room.objects
    }
    shapes |= {f"light_{number}": light_mesh(light) for number, light in enumerate(room.lights)}
    return load_dict({"type": "scene", **{name: _mitsuba_mesh(name, mesh) for name, mesh in shapes.items()}})


def _mitsuba_mesh(name: str, mesh: Mesh) -> Any:
    shape = mi.Mesh(name, len(mesh.vertices), len(mesh.faces))
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
    parameters["faces"] = mesh.faces.astype(np.uint32).ravel()
    parameters.update()
    return shape


def empty(scene: Scene, lights: Sequence[AreaLight], spacing: float) -> NDArray[np.bool_]:
    """(N,) whether nothing that rays at that spacing (m) meet is within the clearance of each light."""
    if not lights:
        return np.zeros(0, dtype=bool)
    origins: list[NDArray[np.float32]] = []
    directions: list[NDArray[np.float32]] = []
    lengths, owners = [], []
    for number, light in enumerate(lights):
        half = np.array([light.width / 2, light.height / 2, 0.0]) + CLEARANCE
        axes, centre = light.axes.astype(np.float32), np.array(light.centre, dtype=np.float32)
        for axis in range(3):
            across = [k for k in range(3) if k != axis]
            steps = [
                np.linspace(-half[k], half[k], int(np.ceil(2 * half[k] / spacing)) + 1, dtype=np.float32)
                for k in across
            ]
            one, other = (axes[k, :, None] * step for k, step in zip(across, steps, strict=True))
            start = centre - np.float32(half[axis]) * axes[axis]
            origins.append((start[:, None, None] + one[:, :, None] + other[:, None, :]).reshape(3, -1))
            count = origins[-1].shape[1]
            directions.append(np.broadcast_to(axes[axis][:, None], (3, count)))
            lengths.append(np.full(count, 2 * half[axis], dtype=np.float32))
            owners.append(np.full(count, number))
    ray = mi.Ray3f(
        mi.Point3f(np.concatenate(origins, axis=1, dtype=np.float32)),
        mi.Vector3f(np.concatenate(directions, axis=1)),
    )
    ray.maxt = mi.Float(np.concatenate(lengths))
    met = np.array(scene.mi_scene.ray_test(ray))
    return np.bincount(np.concatenate(owners)[met], minlength=len(lights)) == 0


def share_of_view(light: AreaLight, camera: PinholeCamera | Camera, aspect: float) -> float:
    """Fraction of a camera's image that a light covers if nothing hides it, in [0, 1]. aspect: width over height."""
    pinhole = camera if isinstance(camera, PinholeCamera) else camera.pinhole
    corners = (light.corners - np.asarray(camera.position)) @ pinhole.frame.T
    visible = _in_front(corners)
    if len(visible) < 3:
        return 0.0
    across, down = pinhole.principal_point
    flat = visible[:, :2] / visible[:, 2:] * pinhole.focal_length(2) + [2 * across, 2 * down / aspect]
    image = shapely.box(-1.0, -1.0 / aspect, 1.0, 1.0 / aspect)
    return float(shapely.MultiPoint(flat).convex_hull.intersection(image).area / image.area)


def _in_front(polygon: FloatArray) -> FloatArray:
    """The part of a convex polygon (N, 3) in camera space that lies before the lens."""
    kept = []
    for one, other in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if one[2] >= NEAREST:
            kept.append(one)
        if (one[2] >= NEAREST) != (other[2] >= NEAREST):
            kept.append(one + (other - one) * (NEAREST - one[2]) / (other[2] - one[2]))
    return np.array(kept).reshape(-1, 3)
