"""Cameras in bad places: close to a wall, on it, inside of something, with a narrow or a wide view, looking along Z."""

from __future__ import annotations

from typing import Any

import numpy as np

from gibench.generators.parts import Camera
from gibench.generators.view_checks import camera_rays, check_views
from gibench.generators.visibility import RayCaster
from gibench.rendering.camera import CameraError, PinholeCamera
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from gibench.stress import meshes
from gibench.stress.answers import mean_check, not_finite
from gibench.stress.geometry import BALANCE, DEPTH, EQUILIBRIUM, in_balance
from gibench.stress.registry import Check, Found, case
from gibench.stress.scenes import closed_answer, closed_box, diffuse, rectangle
from gibench.stress.views import SURFACE_SETS, seen

PLANE = "the plane, in float64; 8 roundings of float32"


def distances_to_plane(camera: PinholeCamera, resolution: tuple[int, int], axis: int, at: float) -> Any:
    """(H, W) distances along the rays through pixel centres to the plane where coordinate `axis` is `at`, metres."""
    width, height = resolution
    centre_x, centre_y = camera.centre(resolution)
    x, y = np.meshgrid(np.arange(width) + 0.5 - centre_x, np.arange(height) + 0.5 - centre_y)
    focal = camera.focal_length(width)
    rays = np.stack([x / focal, y / focal, np.ones_like(x)], axis=-1) @ camera.frame
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    return (at - camera.position[axis]) / rays[..., axis]


def plane_checks(
    camera: PinholeCamera, axis: int, at: float, resolution: tuple[int, int] = (32, 24)
) -> Found:
    """Distance, and the pixel that a hit is seen at, against a plane that fills the view.

    Rounding: of the camera's place against its depth below the plane, and of points of a plane as large as the view.
    """
    answer = distances_to_plane(camera, resolution, axis, at)
    depth, reach = abs(at - camera.position[axis]), 1.5 * float(answer.max())
    centre, normal = np.array(camera.position), np.zeros(3)
    centre[axis], normal[axis] = at, np.sign(camera.position[axis] - at)
    wall = rectangle(centre, normal, (reach, reach), bsdf=diffuse(0.5))
    scene = load_dict({"type": "scene", "wall": wall})
    given: dict[str, Any] = {"resolution": resolution, "channels": SURFACE_SETS, "previous_camera": camera}
    frame = render_frame(scene, camera, **given).arrays
    rounding = 8 * 2.0**-24 * (1 + float(np.abs(camera.position).max()) / depth)
    # A ray that meets the plane at a flat angle magnifies the rounding of its direction.
    error = float((np.abs(frame["distance"][..., 0] / answer - 1) * depth / answer).max())
    yield Check("surface", "distance, over 1 / cos of incidence", error, rounding, PLANE)
    x, y, _ = camera.project(frame["position"].astype(np.float64), resolution)
    columns, rows = np.meshgrid(np.arange(resolution[0]) + 0.5, np.arange(resolution[1]) + 0.5)
    error = float(np.maximum(np.abs(x - columns), np.abs(y - rows)).max())
    bound = rounding * (1 + reach / depth) * (camera.focal_length(resolution[0]) + resolution[0])
    yield Check("surface", "position, projected again (pixels)", error, bound, "rounding, through the camera")
    error = float(np.abs(frame["motion"]).max())
    yield Check(
        "surface", "motion of a camera at rest (pixels)", error, bound, "rounding, through the camera"
    )
    yield Check("surface", "values that are not finite", not_finite(frame), 0, "the contract")


@case("camera 1 cm from a wall", quick=True)
def close_to_a_wall() -> Found:
    """The wall fills the view, and light is that of the room."""
    yield from plane_checks(PinholeCamera((0.99, 0.0, 0.0), (2.0, 0.1, 0.1), np.radians(70)), 0, 1.0)
    scene = in_balance(*meshes.cube())
    camera = PinholeCamera((0.99, 0.0, 0.0), (2.0, 0.1, 0.1), np.radians(70))
    yield mean_check("light", "radiance", seen(scene, camera, max_depth=DEPTH), EQUILIBRIUM, BALANCE)


@case("camera exactly on a wall", quick=True)
def on_a_wall() -> Found:
    """Looking into the room: what it stands on may not be in the way."""
    scene = load_dict(closed_box(0.5, 1.0))
    camera = PinholeCamera((1.0, 0.0, 0.0), (0.0, 0.1, 0.2), 1.2)
    frame = seen(scene, camera, channels=["radiance", "surface"])
    answer = closed_answer(0.5, 1.0, 8)
    yield mean_check("light", "radiance", frame, answer, "sum of the series; noise")
    distance = float(frame.arrays["distance"].min())
    yield Check(
        "surface", "pixels that see the wall itself", float(distance < 1), 0, "the next wall is 1 m away"
    )
    yield Check("surface", "values that are not finite", not_finite(frame.arrays), 0, "the contract")


@case("field of view of {degrees:g}°", degrees=(1, 170, 179), quick=(1, 170))
def field_of_view(degrees: float) -> Found:
    """A plane 2 m ahead, and the light of a closed room."""
    camera = PinholeCamera((0.0, 0.0, 0.0), (2.0, 0.3, 0.1), np.radians(degrees))
    yield from plane_checks(PinholeCamera((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), np.radians(degrees)), 0, 2.0)
    frame = seen(load_dict(closed_box(0.5, 1.0)), camera)
    yield mean_check("light", "radiance", frame, closed_answer(0.5, 1.0, 8), "sum of the series; noise")


@case("looking exactly along {sign}Z", sign=("+", "-"), quick=("-",))
def along_z(sign: str) -> Found:
    """No horizon: the view check, the frame and scene.xml must still agree on one."""
    import mitsuba as mi

    towards = 1.0 if sign == "+" else -1.0
    camera = PinholeCamera((0.0, 0.0, 0.0), (0.0, 0.0, towards), np.radians(60))
    yield from plane_checks(camera, 2, 2 * towards)
    rays = camera_rays([Camera(camera.position, camera.target, camera.fov)], (32, 24))[0].reshape(24, 32, 3)
    answer = distances_to_plane(camera, (32, 24), 2, 2 * towards)
    error = float(np.abs(2 * towards / rays[..., 2] / answer - 1).max())
    yield Check("checks", "rays of the view check", error, 1e-12, "float64")
    place = mi.ScalarTransform4f().look_at(
        origin=list(camera.position), target=list(camera.target), up=list(camera.look_at_up)
    )
    axes = np.array(place.matrix, dtype=np.float64)[:3, :3].T * [
        [-1],
        [-1],
        [1],
    ]  # Mitsuba's x points left, y up
    error = float(np.abs(axes - camera.frame).max())
    yield Check(
        "files", "axes of the sensor in scene.xml (absolute)", error, 2.0**-21, "float32 of unit vectors"
    )


@case("camera inside of something", quick=True)
def inside_of_something() -> Found:
    """The view check refuses it, be the thing small or as large as a wardrobe, open to behind or closed."""
    vertices, faces = meshes.cube(np.linspace(-1, 1, 3))
    room = (vertices * 3.0, faces)
    things = [
        (vertices * 0.2 + offset, faces) for offset in np.random.default_rng(0).uniform(-2.5, 2.5, (40, 3))
    ]
    for half in (0.05, 0.4, 0.9):
        solid = (vertices * half, faces[:, ::-1])
        caster = RayCaster([room, solid, *things], range(42))
        views = check_views(caster, [Camera((0.0, 0.0, 0.0), (1.0, 0.2, 0.1), 1.2)], 1)
        passed = float(views[0].reason == "")
        yield Check(
            "checks", f"views from inside a cube of {200 * half:g} cm let pass", passed, 0, "docs/rooms.md"
        )


@case("what is no camera", quick=True)
def no_camera() -> Found:
    """Refused by a named error."""
    nothing = ((0, 0, 0), (0, 0, 0), 1.0), ((0, 0, 0), (np.nan, 0, 0), 1.0), ((0, 0, 0), (1, 0, 0), np.pi)
    passed = 0
    for position, target, view in nothing:
        try:
            PinholeCamera(position, target, view)
        except CameraError:
            continue
        passed += 1
    yield Check("checks", "cameras that are let pass", passed, 0, "a named error")
    near = PinholeCamera((1e4, 0.0, 0.0), (1e4 + 0.1, 0.0, 0.0), 1.0)
    error = float(np.abs(near.frame[2] - [1, 0, 0]).max())
    yield Check("checks", "direction, 10 km out, to a target 10 cm away", error, 1e-12, "float64")
