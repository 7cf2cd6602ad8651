"""The parts of a room: meshes, materials, lights, cameras and the room that holds them.

Plain data with no randomness and no renderer in it. Generators build these values, `scene_files` writes them.
World frame: right-handed, metres, Z up, floor at z = 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.rendering.camera import PinholeCamera
from gibench.rendering.lighting import Lighting

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh whose vertices are split where the shading normal or the texture seam jumps.

    vertices: (V, 3) float64, metres. faces: (F, 3) int32, counter-clockwise seen from outside.
    normals: (V, 3) float64, unit, outward. uvs: (V, 2) float64, in metres along the surface (metric UVs: one
    unit of u or v covers one metre), so that a texture of known size has the same grain on everything.
    normals and uvs are empty where a mesh has none, which those of generators never are.
    Merging vertices of equal position gives a closed surface, except where a generator says otherwise.
    """

    vertices: FloatArray
    faces: IntArray
    normals: FloatArray
    uvs: FloatArray


@dataclass(frozen=True, eq=False)
class Part:
    """A mesh with the role that its material plays.

    slot: a name from `gibench.generators.materials.SLOTS` ("wood", "fabric", "chrome" …).
    variant: parts of one object with the same slot and variant get the same material, others may differ
    (the spines of the books on a shelf, say).
    """

    mesh: Mesh
    slot: str
    variant: str = ""


@dataclass(frozen=True)
class Support:
    """A horizontal rectangle of an object on which small things may stand, in the object's own frame (m).

    clearance: free height above it. The rectangle spans [x0, x1] × [y0, y1] at height z.
    """

    x0: float
    x1: float
    y0: float
    y1: float
    z: float
    clearance: float = 1.0


@dataclass(frozen=True)
class Light:
    """An emitter with a simple shape, specified as people buy it.

    shape: "rectangle" (size = (width, height)), "disk" (size = (radius,)), "sphere" (size = (radius,)) or "shade" (size
    = (radius below, radius above, height)), metres. A rectangle or disk emits from its front side only, towards
    `direction` (unit); a sphere emits outward and ignores it, and so does a shade, the wall of an upright frustum that
    is open below and above. centre: (3,) m. lumens: luminous flux of the whole emitter. kelvin: correlated colour
    temperature. share: of a bulb's flux that this emitter gives off. slot: the material that glows, in a room its name;
    empty for glass.
    """

    name: str
    shape: str
    size: tuple[float, ...]
    centre: tuple[float, float, float]
    direction: tuple[float, float, float]
    lumens: float
    kelvin: float
    share: float = 1.0
    slot: str = ""


@dataclass(frozen=True, eq=False)
class Furniture:
    """One piece of furniture in its own frame: origin on the floor at the centre of its bounding box, Z up,
    the front towards +y, the back at −y, its length along x.

    family: the registry name ("chair"). parameters: what it was built from, JSON-able. lights: emitters that
    belong to it, in its frame, all fed by one bulb. hung: it is fixed to a wall (back plane at y = −depth/2, z = 0 at
    its lowest point) or, for `mount="ceiling"`, its highest point touches z = 0 and it extends below.
    mount: "floor", "wall", "ceiling" or "surface" (small things that stand on a Support).
    """

    family: str
    parameters: Mapping[str, Any]
    parts: tuple[Part, ...]
    supports: tuple[Support, ...] = ()
    lights: tuple[Light, ...] = ()
    mount: str = "floor"

    def bounds(self) -> FloatArray:
        """(2, 3) smallest and largest corner over all parts, metres."""
        corners = [(p.mesh.vertices.min(0), p.mesh.vertices.max(0)) for p in self.parts]
        return np.array([np.min([c[0] for c in corners], 0), np.max([c[1] for c in corners], 0)])


@dataclass(frozen=True, eq=False)
class Texture:
    """One tile of a repeating image. pixels: (H, W, 3) uint8, sRGB-encoded. size: metres that one tile covers."""

    pixels: NDArray[np.uint8]
    size: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Material:
    """A stock Mitsuba BSDF (always wrapped in `twosided`), described by the few numbers that it needs.

    bsdf: "diffuse", "roughplastic", "roughconductor" or "conductor" (smooth; mirrors).
    reflectance: the diffuse reflectance (for conductors: the specular reflectance), linear Rec. 709 RGB in
    [0, 1], or a Texture of it. alpha: GGX roughness, 0 for diffuse and smooth conductor. ior: interior index
    of refraction of roughplastic. conductor: Mitsuba's `material` name for conductors ("Al", "Cu", "none" …).
    family: "wood", "tile" … ; parameters: what it was sampled as, JSON-able.
    """

    name: str
    family: str
    bsdf: str
    reflectance: tuple[float, float, float] | Texture
    alpha: float = 0.0
    ior: float = 1.5
    conductor: str = "none"
    parameters: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class RoomObject:
    """A thing in its place. shapes: (mesh in world space, material name) pairs; name is unique in the room."""

    name: str
    family: str
    parameters: Mapping[str, Any]
    position: tuple[float, float, float]
    yaw: float
    shapes: tuple[tuple[Mesh, str], ...]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera. position and target in metres, horizontal field of view in radians.

    up, principal_point, mirrored: as those of a `PinholeCamera`; a room that is generated has none.
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    fov: float
    path: str = ""  # the name of the walk that it belongs to, empty for a still
    step: int = 0  # its place on that walk
    up: tuple[float, float, float] | None = None
    principal_point: tuple[float, float] = (0.0, 0.0)
    mirrored: bool = False

    @property
    def pinhole(self) -> PinholeCamera:
        """The camera as the renderer takes it."""
        return PinholeCamera(
            self.position, self.target, self.fov, self.up, self.principal_point, self.mirrored
        )

    @property
    def peculiarities(self) -> dict[str, Any]:
        """`up`, `principal_point` and `mirrored`, each only where it is not that of an ordinary camera; JSON-able."""
        found: dict[str, Any] = {}
        if self.up is not None:
            found["up"] = list(self.up)
        if any(self.principal_point):
            found["principal_point"] = list(self.principal_point)
        if self.mirrored:
            found["mirrored"] = True
        return found


@dataclass(frozen=True)
class Environment:
    """The world outside the windows: kind "none", "sunsky" or "hdr".

    sunsky: sun_direction (3,) towards the sun, turbidity, albedo and `scale`, which turns Mitsuba's values into
    W·m⁻²·sr⁻¹. hdr: path of an equirectangular file, rotation about Z (radians), scale.
    """

    kind: str = "none"
    parameters: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Room:
    """A furnished, lit room with its cameras; see `rooms.sample_room`.

    kind: "living", "bedroom", "dining-kitchen", "office" or "bathroom". parameters: the shell's and whatever
    else reproduces it. openings: (N, 3, 3) windows, each as corner and two edges whose cross product points inside,
    metres. rejections: reason → count, for tries of the room and of its views. lightings: one a camera, or none where
    all frames have the room's own light.
    """

    seed: int
    index: int
    kind: str
    parameters: Mapping[str, Any]
    objects: tuple[RoomObject, ...]
    lights: tuple[Light, ...]
    environment: Environment
    materials: Mapping[str, Material]
    cameras: tuple[Camera, ...]
    openings: FloatArray = field(default_factory=lambda: np.zeros((0, 3, 3)))
    rejections: Mapping[str, int] = field(default_factory=dict)
    lightings: tuple[Lighting, ...] = ()

    @property
    def given_cameras(self) -> int:
        """How many of the cameras it came with: none, since all are drawn."""
        return 0
