"""Surface-like channels against geometry worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.rendering.camera import PinholeCamera
from gibench.rendering.channels import CHANNELS
from gibench.rendering.estimate import estimate_radiance
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict

from . import scenes

AIR = 1.000277
"""Index of refraction of air, outside every coat (CRC Handbook)."""

EVERYTHING = ("surface", "reflection", "curvature", "motion")


def gbuffer(description, camera, resolution=(33, 33), channels=EVERYTHING, **options):
    return render_frame(
        load_dict(description), camera, resolution=resolution, channels=channels, **options
    ).arrays


def plane(bsdf, **more):
    return scenes.rectangle([0, 0, 0], [0, 0, 1], (20, 20), bsdf=bsdf, **more)


def test_depth_is_along_the_axis_and_distance_along_the_ray():
    """A wall across the axis has one depth; distance grows with the angle."""
    wall = scenes.rectangle([0, 3, 0], [0, -1, 0], (20, 20))
    camera = PinholeCamera((0, 0, 0), (0, 1, 0), np.radians(90.0))
    frame = gbuffer({"type": "scene", "wall": wall}, camera, (64, 48), ["surface"])
    np.testing.assert_allclose(frame["depth"], 3.0, rtol=1e-5)
    x, y = np.meshgrid((np.arange(64) + 0.5) / 32 - 1, (np.arange(48) + 0.5) / 32 - 0.75)
    expected = 3 * np.sqrt(1 + x**2 + y**2)
    np.testing.assert_allclose(frame["distance"][..., 0], expected, rtol=1e-5)
    # World x grows to the right of the picture, world z to its top.
    np.testing.assert_allclose(frame["position"][..., 0], 3 * x, atol=2e-5)
    np.testing.assert_allclose(frame["position"][..., 2], -3 * y, atol=2e-5)
    np.testing.assert_allclose(frame["normal"], np.broadcast_to([0, -1, 0], (48, 64, 3)), atol=1e-6)


def test_normals_face_the_viewer_from_inside_too():
    ball = {"type": "sphere", "radius": 2.0}
    inside = gbuffer({"type": "scene", "b": ball}, PinholeCamera((0.3, 0, 0), (1, 0.4, 0.2), 1.0))
    towards = np.array([0.3, 0, 0]) - inside["position"]
    assert (np.sum(inside["normal"] * towards, axis=-1) > 0).all()
    np.testing.assert_allclose(inside["normal"], -inside["position"] / 2, atol=1e-5)


@pytest.mark.parametrize(
    ("name", "albedo", "specular", "roughness"),
    [
        ("diffuse", (0.6, 0.5, 0.3), (0, 0, 0), 1.0),
        ("coat", (0.5, 0.2, 0.1), [(1.5 - AIR) ** 2 / (1.5 + AIR) ** 2] * 3, 0.1),
        ("metal", (0, 0, 0), None, 0.2),
        ("mirror", (0, 0, 0), None, 0.0),
    ],
)
def test_albedo_specular_albedo_and_roughness(name, albedo, specular, roughness):
    camera = PinholeCamera((0, -1, 2), (0, 0, 0), 0.5)
    frame = gbuffer({"type": "scene", "p": plane(scenes.MATERIALS[name])}, camera)
    np.testing.assert_allclose(frame["albedo"], np.broadcast_to(albedo, (33, 33, 3)), atol=1e-6)
    if specular is not None:
        np.testing.assert_allclose(
            frame["specular_albedo"], np.broadcast_to(specular, (33, 33, 3)), atol=1e-6
        )
    np.testing.assert_allclose(frame["roughness"], roughness, atol=1e-6)


@pytest.mark.parametrize("name", ["metal", "mirror"])
def test_specular_albedo_is_what_a_mirror_of_that_metal_reflects(name):
    """Seen head-on, a smooth conductor under uniform light of 1 shows its reflectance at normal incidence."""
    smooth = {
        "metal": {"material": "Cu"},
        "mirror": {"material": "Al", "specular_reflectance": scenes.rgb(0.9)},
    }[name]
    camera = PinholeCamera((0, -1e-4, 4), (0, 0, 0), 1e-3)
    light = {"type": "constant", "radiance": scenes.rgb(1.0)}
    mirror = plane(scenes.two_sided(type="conductor", **smooth))
    seen = gbuffer({"type": "scene", "p": mirror, "light": light}, camera, channels=["radiance"], spp=4)
    told = gbuffer({"type": "scene", "p": plane(scenes.MATERIALS[name]), "light": light}, camera)
    np.testing.assert_allclose(told["specular_albedo"], seen["direct_specular"], rtol=1e-4)


@pytest.mark.parametrize("name", ["textured", "textured_coat"])
def test_textured_albedo_follows_the_texture(name):
    floor = scenes.rectangle([0, 0, 0], [0, 0, 1], (1, 1), bsdf=scenes.MATERIALS[name])
    camera = PinholeCamera((0, -1e-4, 2), (0, 0, 0), np.radians(50.0))
    frame = gbuffer({"type": "scene", "floor": floor}, camera, (40, 40))
    corner = np.sign(frame["position"][..., 0]) == np.sign(frame["position"][..., 1])
    hit = frame["material_id"][..., 0] > 0
    expected = np.where(corner[..., None], [0.1, 0.2, 0.5], [0.8, 0.6, 0.3])
    np.testing.assert_allclose(frame["albedo"][hit], expected[hit], atol=1e-5)


def test_mirror_ray_of_a_plane():
    """A point that a floor mirrors lies where the floor's mirror image of the camera sees it."""
    floor, wall = plane(scenes.MATERIALS["coat"]), scenes.rectangle([0, 3, 0], [0, -1, 0], (20, 20))
    camera = PinholeCamera((0, 0, 1), (0, 2, 0), np.radians(10.0))
    frame = gbuffer({"type": "scene", "floor": floor, "wall": wall}, camera, (16, 16))
    origin = np.array([0, 0, -1.0])
    towards = (frame["position"] - origin).astype(float)
    expected = origin + towards * ((3 - origin[1]) / towards[..., 1:2])
    # Mitsuba starts secondary rays a little above the surface: 9e-5 of its largest coordinate.
    np.testing.assert_allclose(frame["reflected_position"], expected, atol=1e-3)
    np.testing.assert_allclose(
        frame["reflected_distance"][..., 0], np.linalg.norm(expected - frame["position"], axis=-1), atol=1e-3
    )
    np.testing.assert_allclose(frame["reflected_normal"], np.broadcast_to([0, -1, 0], (16, 16, 3)), atol=1e-6)
    assert set(np.unique(frame["reflected_shape_id"])) == {2}
    np.testing.assert_allclose(frame["reflected_albedo"], 0.5, atol=1e-6)


def test_misses_hold_zero():
    ball = {"type": "sphere", "radius": 0.5, "bsdf": scenes.MATERIALS["metal"]}
    frame = gbuffer({"type": "scene", "b": ball}, PinholeCamera((0, -3, 0), (0, 0, 0), 1.0))
    miss = frame["shape_id"][..., 0] == 0
    assert miss.any()
    assert not miss.all()
    for name, values in frame.items():
        assert np.isfinite(values).all(), name
        assert not values[miss].any(), name
    alone = frame["reflected_shape_id"][..., 0] == 0
    assert alone.all()
    assert not any(frame[name].any() for name in frame if name.startswith("reflected"))


def test_ids_name_materials_and_shapes():
    scene = load_dict(scenes.box("coat"))
    frame = render_frame(scene, scenes.CAMERA, resolution=(64, 64), channels=["surface"]).arrays
    middle = frame["shape_id"][40:, 20:44, 0]
    assert scene.shapes[int(np.bincount(middle[middle > 0]).argmax()) - 1] in ("floor", "ball", "extra_coat")
    back = frame["position"][..., 1] > 0.999
    assert {scene.shapes[i - 1] for i in np.unique(frame["shape_id"][back])} == {"back"}
    assert {scene.materials[i - 1] for i in np.unique(frame["material_id"][back])} == {"wall"}


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ({"type": "sphere", "radius": 0.5}, (-2.0, -2.0)),
        ({"type": "cylinder", "p0": [0, 0, -1], "p1": [0, 0, 1], "radius": 0.4}, (-2.5, 0.0)),
        ({"type": "rectangle"}, (0.0, 0.0)),
    ],
    ids=["sphere", "cylinder", "plane"],
)
def test_curvature_of_simple_shapes(shape, expected):
    """Seen from outside a convex surface bends away from its normal: negative."""
    camera = PinholeCamera((0, -3, 0.4), (0, 0, 0.02), np.radians(14.0))
    frame = gbuffer({"type": "scene", "s": shape}, camera)
    hit = frame["shape_id"][..., 0] > 0
    assert hit.mean() > 0.3
    np.testing.assert_allclose(frame["curvature"][hit], np.broadcast_to(expected, (hit.sum(), 2)), atol=2e-3)
    if shape["type"] == "cylinder":
        along = np.abs(frame["curvature_direction"][hit] @ [0, 0, 1.0])
        assert along.max() < 1e-3


def test_curvature_changes_sign_inside():
    camera = PinholeCamera((0, 0, 0), (0, 1, 0.1), 1.0)
    frame = gbuffer({"type": "scene", "s": {"type": "sphere", "radius": 0.5}}, camera)
    np.testing.assert_allclose(frame["curvature"], 2.0, atol=1e-3)


def test_motion_of_a_hand_computed_pixel():
    """The camera stepped 0.1 m to the right; a wall at 2 m moved f · 0.1/2 pixels to the left."""
    wall = scenes.rectangle([0, 2, 0], [0, -1, 0], (20, 20))
    now = PinholeCamera((0.1, 0, 0), (0.1, 1, 0), np.radians(90.0))
    before = PinholeCamera((0.0, 0, 0), (0.0, 1, 0), np.radians(90.0))
    frame = gbuffer({"type": "scene", "wall": wall}, now, (40, 20), ["motion"], previous_camera=before)
    focal = 20 / np.tan(np.radians(45.0))
    np.testing.assert_allclose(frame["motion"][..., 0], focal * 0.1 / 2, atol=2e-4)
    np.testing.assert_allclose(frame["motion"][..., 1], 0, atol=1e-4)
    # The last pixel column was outside the picture before.
    np.testing.assert_array_equal(frame["motion_valid"][:, :-1, 0], 1)
    np.testing.assert_array_equal(frame["motion_valid"][:, -1, 0], 0)


@pytest.mark.parametrize("mirrored", [False, True])
def test_positions_and_motion_of_a_rolled_off_centre_camera_are_those_of_its_projection(mirrored):
    wall = scenes.rectangle([0, 3, 0], [0, -1, 0], (40, 40))
    odd = {"up": (0.4, 0.1, 1), "principal_point": (0.2, -0.3), "mirrored": mirrored}
    now = PinholeCamera((0.1, 0, 0), (0.3, 1, 0.1), 1.1, **odd)
    before = PinholeCamera((0, 0.1, 0.05), (0.25, 1, 0.1), 1.0, **odd | {"up": (0.3, 0, 1)})
    size = (40, 30)
    channels = ["surface", "motion"]
    frame = gbuffer({"type": "scene", "wall": wall}, now, size, channels, previous_camera=before)
    centres = np.stack(np.meshgrid(np.arange(40) + 0.5, np.arange(30) + 0.5), axis=-1)
    position = frame["position"].astype(np.float64)
    x, y, depth = now.project(position, size)
    np.testing.assert_allclose(np.stack([x, y], -1), centres, atol=1e-3)
    np.testing.assert_allclose(frame["depth"][..., 0], depth, rtol=1e-5)
    x, y, _ = before.project(position, size)
    np.testing.assert_allclose(frame["motion"], np.stack([x, y], -1) - centres, atol=2e-3)
    inside = (x >= 0) & (x < 40) & (y >= 0) & (y < 30)
    assert inside.any()
    assert not inside.all()
    np.testing.assert_array_equal(frame["motion_valid"][..., 0], inside)


@pytest.mark.parametrize("principal_point", [(0.25, 0.0), (-0.6, 0.0), (0.1, -2.0)])
def test_all_that_an_off_centre_camera_sees_is_valid_where_nothing_moves(principal_point):
    wall = scenes.rectangle([0, 3, 0], [0, -1, 0], (40, 40))
    camera = PinholeCamera((0, 0, 0), (0, 1, 0), 1.0, principal_point=principal_point)
    frame = gbuffer({"type": "scene", "wall": wall}, camera, (16, 8), ["motion"], previous_camera=camera)
    np.testing.assert_allclose(frame["motion"], 0, atol=1e-4)
    np.testing.assert_array_equal(frame["motion_valid"], 1)


def test_motion_is_not_valid_where_the_point_was_hidden():
    wall = scenes.rectangle([0, 4, 0], [0, -1, 0], (20, 20))
    screen = scenes.rectangle([0, 1, 0], [0, -1, 0], (0.3, 0.3), bsdf=scenes.two_sided(type="diffuse"))
    now = PinholeCamera((0.5, 0, 0), (0.5, 1, 0), np.radians(60.0))
    before = PinholeCamera((0.0, 0, 0), (0.0, 1, 0), np.radians(60.0))
    frame = gbuffer(
        {"type": "scene", "a": screen, "b": wall}, now, (64, 64), EVERYTHING, previous_camera=before
    )
    p = frame["position"].astype(float)
    on_wall = p[..., 1] > 3.9
    # From the earlier camera at the origin the screen at y = 1 hides |x|, |z| < 0.3 · 4 of the wall.
    shadow = on_wall & (np.abs(p[..., 0]) < 1.19) & (np.abs(p[..., 2]) < 1.19)
    clear = on_wall & (np.abs(p[..., 0]) > 1.21) & (np.abs(p[..., 0]) < 2.2) & (np.abs(p[..., 2]) < 2.2)
    assert shadow.any()
    assert clear.any()
    assert not frame["motion_valid"][shadow].any()
    assert frame["motion_valid"][clear].all()


def test_without_an_earlier_frame_no_motion_is_valid():
    frame = gbuffer(scenes.box("coat"), scenes.CAMERA, channels=["motion"])
    assert not frame["motion"].any()
    assert not frame["motion_valid"].any()


def test_only_what_is_asked_for_comes_back():
    frame = gbuffer(scenes.box("coat"), scenes.CAMERA, channels=["depth", "reflected_albedo"])
    assert list(frame) == ["depth", "reflected_albedo"]
    for name, values in frame.items():
        assert values.shape == (33, 33, CHANNELS[name].components)


def test_normals_that_contradict_the_winding_face_the_viewer():
    import mitsuba as mi

    shape = mi.Mesh("floor", 4, 2, has_vertex_normals=True)
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = [-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0]
    parameters["faces"] = [0, 1, 2, 0, 2, 3]
    tilted = np.array([0.1, 0, -1]) / np.linalg.norm([0.1, 0, -1])
    parameters["vertex_normals"] = np.tile(tilted, 4).astype(np.float32)
    parameters.update()
    scene = load_dict({"type": "scene", "floor": shape, "light": {"type": "constant"}})
    for height in (1, -1):
        camera = PinholeCamera((0, -1, height), (0, 0, 0), 0.1)
        frame = render_frame(scene, camera, resolution=(4, 4), channels=["surface", "reflection"]).arrays
        # The same line as the mesh gives, on the viewer's side.
        np.testing.assert_allclose(frame["normal"], np.broadcast_to(-height * tilted, (4, 4, 3)), atol=1e-6)
        np.testing.assert_allclose(frame["geometric_normal"][0, 0], [0, 0, height], atol=1e-6)
        assert not frame["reflected_distance"].any()
        estimate = estimate_radiance(scene, camera, (4, 4), spp=4, guides=True)
        np.testing.assert_allclose(estimate.part("normal"), frame["normal"].reshape(-1, 3), atol=1e-5)
