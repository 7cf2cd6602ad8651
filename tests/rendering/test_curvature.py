"""Curvature of meshes against closed forms, and of meshes that have none."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
import trimesh

from gibench.rendering.camera import PinholeCamera
from gibench.rendering.mesh_curvature import COMPONENTS, corner_tensors
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.rendering import scenes


def grid(function, u, v, wrap=(False, False)):
    """Vertices, normals and triangles of a parametric surface; function: u, v → points, normals."""
    a, b = np.meshgrid(u, v, indexing="ij")
    points, normals = function(a.ravel(), b.ravel())
    index = np.arange(a.size).reshape(a.shape)
    if wrap[0]:
        index = np.concatenate([index, index[:1]])
    if wrap[1]:
        index = np.concatenate([index, index[:, :1]], axis=1)
    p, q, r, s = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((p, q, r), (p, r, s))])
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True), faces


def sphere(radius=0.5, fine=3):
    mesh = trimesh.creation.icosphere(subdivisions=fine, radius=radius)
    return np.array(mesh.vertices), np.array(mesh.vertices) / radius, np.array(mesh.faces)


def cylinder(radius=0.4, around=48):
    def surface(u, v):
        out = np.stack([np.cos(u), np.sin(u), 0 * u], axis=-1)
        return radius * out + v[:, None] * [0, 0, 1], out

    return grid(
        surface,
        np.linspace(0, 2 * np.pi, around, endpoint=False),
        np.linspace(-1, 1, 9),
        (True, False),
    )


BIG, SMALL = 1.0, 0.3


def torus(around=96, across=48):
    def surface(u, v):
        ring = np.stack([np.cos(u), np.sin(u), 0 * u], axis=-1)
        out = np.cos(v)[:, None] * ring + np.sin(v)[:, None] * [0, 0, 1]
        return BIG * ring + SMALL * out, out

    u, v = (np.linspace(0, 2 * np.pi, n, endpoint=False) for n in (around, across))
    return grid(surface, u, v, (True, True))


def saddle(steps=33):
    def surface(u, v):
        return np.stack([u, v, 0.5 * (2 * u**2 - v**2)], axis=-1), np.stack([-2 * u, v, 1 + 0 * u], axis=-1)

    return grid(surface, *[np.linspace(-0.3, 0.3, steps)] * 2)


def eigen(mesh):
    """Principal curvatures and directions at corners, (F, 3, 2) larger size first, and (F, 3, 3) of the first."""
    _, normals, faces = mesh
    packed = corner_tensors(*mesh)
    tensor = np.zeros((*packed.shape[:2], 3, 3))
    for k, (i, j) in enumerate(COMPONENTS):
        tensor[..., i, j] = tensor[..., j, i] = packed[..., k]
    n = normals[faces]
    tangent = np.eye(3) - n[..., :, None] * n[..., None, :]
    values, vectors = np.linalg.eigh(tangent @ tensor @ tangent + 1e6 * n[..., :, None] * n[..., None, :])
    values, vectors = values[..., :2], vectors[..., :2]  # the last is the normal
    order = np.argsort(-np.abs(values), axis=-1)
    first = np.take_along_axis(vectors, order[..., None, :1], axis=-1)[..., 0]
    return np.take_along_axis(values, order, axis=-1), first


@pytest.mark.parametrize("scale", [1e-2, 1.0, 1e2])
def test_sphere(scale):
    values, _ = eigen(sphere(0.5 * scale))
    np.testing.assert_allclose(values * scale, -2, rtol=5e-3)


def test_inside_of_a_sphere():
    vertices, normals, faces = sphere()
    values, _ = eigen((vertices, -normals, faces[:, ::-1]))
    np.testing.assert_allclose(values, 2, rtol=5e-3)
    # The winding does not matter, only the side that is shaded.
    values, _ = eigen((vertices, -normals, faces))
    np.testing.assert_allclose(values, 2, rtol=5e-3)


def test_cylinder():
    values, first = eigen(cylinder())
    np.testing.assert_allclose(values, np.broadcast_to([-2.5, 0], values.shape), atol=0.02)
    assert np.abs(first[..., 2]).max() < 1e-6


def test_torus():
    mesh = torus()
    points, normals, faces = mesh
    values, first = eigen(mesh)
    at, n = points[faces], normals[faces]
    ring = at * [1, 1, 0]
    ring /= np.linalg.norm(ring, axis=-1, keepdims=True)
    cosine = np.sum(n * ring, axis=-1)
    around = -cosine / (BIG + SMALL * cosine)
    np.testing.assert_allclose(values[..., 0], -1 / SMALL, rtol=0.01)
    np.testing.assert_allclose(values[..., 1], around, atol=0.01 / SMALL)
    along = np.cross([0, 0, 1.0], ring)
    assert np.abs(np.sum(first * along, axis=-1)).max() < 0.02


def test_saddle_converges():
    """z = x² − y²/2: at its middle 2 and −1 along the axes; elsewhere from its two fundamental forms."""
    errors = []
    for steps in (17, 33, 65):
        mesh = saddle(steps)
        values, _ = eigen(mesh)
        x, y = mesh[0][mesh[2]][..., :2].transpose(2, 0, 1)
        length = np.sqrt(1 + 4 * x**2 + y**2)
        first = np.stack([1 + 4 * x**2, -2 * x * y, -2 * x * y, 1 + y**2], axis=-1).reshape(*x.shape, 2, 2)
        second = np.zeros_like(first)
        second[..., 0, 0], second[..., 1, 1] = 2 / length, -1 / length
        expected = np.linalg.eigvals(np.linalg.solve(first, second)).real
        expected = np.take_along_axis(expected, np.argsort(-np.abs(expected), axis=-1), axis=-1)
        errors.append(np.abs(values - expected).mean())
    assert errors[0] < 0.05
    assert errors[2] < 0.3 * errors[0]  # a quarter of the step


def test_noise_is_averaged_out():
    """Normals that are off by a degree, on a sphere."""
    vertices, normals, faces = sphere(fine=4)
    rough = normals + np.random.default_rng(0).normal(scale=0.01, size=normals.shape)
    rough /= np.linalg.norm(rough, axis=1, keepdims=True)
    values, _ = eigen((vertices, rough, faces))
    alone = np.concatenate([eigen((vertices[f], rough[f], np.array([[0, 1, 2]])))[0] for f in faces[:200]])
    assert np.std(values) < 0.6 * np.std(alone)


def test_a_rounded_edge_keeps_its_curvature_and_planes_stay_flat():
    """A strip of large planes joined by a quarter of a cylinder, whose vertices they share."""
    angle = np.linspace(0, np.pi / 2, 5)
    radius = 0.02
    profile = np.concatenate(
        [
            [[-1, radius]],
            np.stack([radius * np.sin(angle), radius * np.cos(angle)], axis=-1),
            [[radius, -1]],
        ]
    )
    tilt = np.concatenate([[0], angle, [np.pi / 2]])

    def surface(u, v):
        k = np.round(u).astype(int)
        points = np.stack([profile[k, 0], v, profile[k, 1]], axis=-1)
        return points, np.stack([np.sin(tilt[k]), 0 * v, np.cos(tilt[k])], axis=-1)

    mesh = grid(surface, np.arange(len(profile)), np.array([0.0, 1.0]))
    values, _ = eigen(mesh)
    part = mesh[2].min(axis=1) // 2  # of the profile
    planes = (part == 0) | (part == len(profile) - 2)
    np.testing.assert_allclose(values[planes], 0, atol=1e-9)
    np.testing.assert_allclose(
        values[~planes], np.broadcast_to([-1 / radius, 0], values[~planes].shape), rtol=0.03, atol=1e-6
    )


def test_texture_seams_do_not_matter():
    """Every triangle with vertices of its own."""
    vertices, normals, faces = torus(24, 12)
    apart = np.arange(faces.size).reshape(-1, 3)
    np.testing.assert_allclose(
        corner_tensors(vertices[faces].reshape(-1, 3), normals[faces].reshape(-1, 3), apart),
        corner_tensors(vertices, normals, faces),
        atol=1e-6,
    )


def flat():
    points = np.random.default_rng(0).uniform(-1, 1, (30, 3)) * [1, 1, 0]
    return points, np.tile([0.0, 0.0, 1.0], (30, 1)), np.random.default_rng(1).integers(0, 30, (50, 3))


def degenerate():
    """A point, a line, a needle, and vertices without normals, beside a sphere."""
    vertices, normals, faces = sphere(fine=1)
    odd = np.array([[0, 0, 0], [0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1e-30, 0], [0.5, 0.5, 0]])
    vertices = np.concatenate([vertices, odd])
    normals = np.concatenate([normals, np.zeros((3, 3)), np.full((1, 3), np.nan), np.zeros((2, 3))])
    n = len(vertices) - 6
    more = [[n, n, n], [n, n + 1, n + 2], [n, n + 2, n + 3], [n, n + 2, n + 4], [n, n + 2, n + 5]]
    return vertices, normals, np.concatenate([faces, more])


def non_manifold():
    """Three sheets at one edge, and a face twice, once turned round."""
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]], dtype=float)
    normals = np.array([[0, 1, 0], [0, 1, 0], [0, 1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return vertices, normals, np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4], [0, 1, 2], [2, 1, 0]])


def fan(triangles=2000):
    """A disc around one vertex, which many triangles share."""
    angle = np.linspace(0, 2 * np.pi, triangles, endpoint=False)
    vertices = np.concatenate([[[0, 0, 0]], np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)])
    rim = 1 + np.arange(triangles)
    faces = np.stack([0 * rim, rim, np.roll(rim, -1)], axis=-1)
    return vertices, np.tile([0.0, 0.0, 1.0], (triangles + 1, 1)), faces


@pytest.mark.parametrize("mesh", [flat, degenerate, non_manifold, fan])
def test_hard_meshes(mesh):
    vertices, normals, faces = mesh()
    found = corner_tensors(vertices, normals, faces)
    assert found.shape == (len(faces), 3, 6)
    assert np.isfinite(found).all()
    if mesh in (flat, fan):
        assert not found.any()
    if mesh is degenerate:
        assert not found[-5:].any()
        np.testing.assert_allclose(found[:-5], corner_tensors(*sphere(fine=1)), atol=1e-12)


def test_no_triangles():
    assert corner_tensors(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3), dtype=int)).shape == (0, 3, 6)


def shape(mesh, with_normals=True, **properties):
    """A Mitsuba mesh."""
    import mitsuba as mi

    vertices, normals, faces = mesh
    made = mi.Mesh(
        "mesh", len(vertices), len(faces), has_vertex_normals=with_normals, props=properties_of(properties)
    )
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = vertices.astype(np.float32).ravel()
    parameters["faces"] = faces.astype(np.uint32).ravel()
    if with_normals:
        parameters["vertex_normals"] = normals.astype(np.float32).ravel()
    parameters.update()
    return made


def properties_of(values):
    import mitsuba as mi

    properties = mi.Properties()
    for name, value in values.items():
        properties[name] = value
    return properties


CAMERA = PinholeCamera((0, -3, 0.4), (0, 0, 0.02), np.radians(14.0))


def seen(
    made, camera=CAMERA, size=(48, 48), channels=("curvature", "curvature_direction", "shape_id", "normal")
):
    scene = load_dict({"type": "scene", "s": made})
    frame = render_frame(scene, camera, resolution=size, channels=channels).arrays
    return frame, frame["shape_id"][..., 0] > 0


@pytest.mark.parametrize("flip", [False, True])
def test_a_mesh_is_seen_as_the_shape_that_it_approximates(flip):
    """Whichever way its normals point."""
    for mesh, analytic in (
        (sphere(0.5, 4), {"type": "sphere", "radius": 0.5}),
        (cylinder(0.4, 96), {"type": "cylinder", "p0": [0, 0, -1], "p1": [0, 0, 1], "radius": 0.4}),
    ):
        frame, hit = seen(shape(mesh, flip_normals=flip))
        exact, also = seen(analytic)
        both = hit & also
        assert both.mean() > 0.3
        np.testing.assert_allclose(frame["curvature"][both], exact["curvature"][both], atol=0.02)
        if analytic["type"] == "cylinder":
            along = np.sum(frame["curvature_direction"] * exact["curvature_direction"], axis=-1)[both]
            assert np.abs(along).min() > 0.999
        across = np.sum(frame["curvature_direction"] * frame["normal"], axis=-1)[both]
        assert np.abs(across).max() < 1e-3
        np.testing.assert_allclose(np.linalg.norm(frame["curvature_direction"][both], axis=-1), 1, atol=1e-4)


def test_a_mesh_changes_sign_inside():
    frame, hit = seen(shape(sphere(0.5, 3)), PinholeCamera((0, 0, 0), (0, 1, 0.1), 1.0))
    assert hit.all()
    np.testing.assert_allclose(frame["curvature"], 2.0, rtol=0.01)


def test_flat_shading_is_flat():
    frame, hit = seen(shape(sphere(0.5, 2), with_normals=False, face_normals=True))
    assert hit.any()
    assert not frame["curvature"].any()


def test_meshes_beside_other_shapes():
    """Each keeps its own curvature; what is missed has none."""
    scene = load_dict(
        {
            "type": "scene",
            "left": shape(tuple(a + b for a, b in zip(sphere(0.5, 3), ([-0.7, 0, 0], 0, 0), strict=True))),
            "right": {"type": "sphere", "radius": 0.25, "center": [0.7, 0, 0]},
            "wall": scenes.rectangle([0, 2, 0], [0, -1, 0], (2, 0.3)),
        }
    )
    camera = PinholeCamera((0, -3, 0), (0, 0, 0), np.radians(60.0))
    frame = render_frame(scene, camera, resolution=(64, 64), channels=["curvature", "shape_id"]).arrays
    for name, expected in (("left", -2), ("right", -4), ("wall", 0)):
        on = frame["shape_id"][..., 0] == scene.shapes.index(name) + 1
        assert on.sum() > 20
        np.testing.assert_allclose(frame["curvature"][on], expected, rtol=0.02, atol=1e-6)
    missed = frame["shape_id"][..., 0] == 0
    assert missed.any()
    assert not frame["curvature"][missed].any()


def test_scalar_variant_sees_the_same():
    code = """
from gibench.rendering.backend import select_variant
select_variant({variant!r})
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.rendering.test_curvature import cylinder, shape
scene = load_dict({{
    "type": "scene",
    "mesh": shape(cylinder(0.4, 24)),
    "ball": {{"type": "sphere", "radius": 0.2, "center": [0.7, 0, 0]}},
}})
camera = PinholeCamera((0, -3, 0), (0, 0, 0), 0.8)
frame = render_frame(scene, camera, resolution=(12, 8), channels=["curvature", "curvature_direction"]).arrays
print(frame["curvature"].ravel().tolist() + abs(frame["curvature_direction"]).ravel().tolist())
"""
    found = []
    for variant in ("scalar_rgb", "auto"):
        command = [sys.executable, "-c", code.format(variant=variant)]
        result = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
        assert not result.returncode, result.stderr
        found.append(json.loads(result.stdout.splitlines()[-1]))
    assert np.any(found[0])
    np.testing.assert_allclose(*found, atol=1e-3)


def test_tables_of_a_scene_do_not_hold_it():
    import gc
    import weakref

    scene = load_dict({"type": "scene", "s": shape(sphere(0.5, 1))})
    assert scene.curvature is scene.curvature
    gone = weakref.ref(scene)
    gc.disable()
    try:
        del scene
        assert gone() is None
    finally:
        gc.enable()
