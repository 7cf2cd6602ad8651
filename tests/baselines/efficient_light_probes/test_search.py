"""The reflection search, against mirror points that are known or found by minimising the length of the path."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
from scipy.optimize import minimize

from gibench.baselines.efficient_light_probes.search import (
    CONFIDENT,
    NONE,
    Reflected,
    Screen,
    blended,
    confidence,
    mirror_point,
    search,
)
from gibench.rendering.camera import PinholeCamera, RayGenerator
from gibench.rendering.replay import camera_arrays
from tests.baselines.probes.test_mappings import columns
from tests.baselines.probes.test_maps import written

SIZE = (64, 48)
ABOVE = PinholeCamera((0.3, -2.0, 2.5), (0.0, 0.2, 0.0), 1.0)
ODD = PinholeCamera(ABOVE.position, ABOVE.target, 0.8, (0.5, 0.0, 1.0), (0.2, -0.1), mirrored=True)


def vectors(kind, values):
    return kind(np.ascontiguousarray(np.asarray(values, dtype=np.float32).T))


def rays(camera, size):
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    ray = RayGenerator(camera, size).rays(mi.Point2f(mi.Float(x.ravel()), mi.Float(y.ravel())))
    return np.array(ray.o).T.astype(np.float64), np.array(ray.d).T.astype(np.float64)


def screen(camera, hit, size=SIZE):
    """What a camera sees of a surface: hit(origins, directions) → positions, normals, materials (0: nothing)."""
    position, normal, material = hit(*rays(camera, size))
    return Screen(
        vectors(mi.Point3f, position),
        vectors(mi.Vector3f, normal),
        mi.UInt32(material.astype(np.uint32)),
        camera_arrays(camera, size),
        *(mi.Int32(side) for side in size),
    )


def floor(origins, directions):
    """The plane z = 0."""
    points = origins - directions * (origins[:, 2:] / directions[:, 2:])
    return points, np.tile([0.0, 0.0, 1.0], (len(points), 1)), np.ones(len(points))


def ball(radius, side):
    """The sphere around the origin, from outside (side 1) or inside (−1), where rays hit it."""

    def hit(origins, directions):
        b = np.sum(origins * directions, axis=1)
        root = b**2 - np.sum(origins**2, axis=1) + radius**2
        there = root > 0
        t = -b - side * np.sqrt(np.maximum(root, 0))
        points = np.where(there[:, None], origins + t[:, None] * directions, 0)
        return points, np.where(there[:, None], side * points / radius, 0), there.astype(float)

    return hit


def reflected(targets, far=False):
    return Reflected(vectors(mi.Point3f, targets), mi.Bool(np.full(len(targets), far)))


def found(surface, probe, targets, steps=20, far=False):
    """Points, confidences and steps of a search from every pixel of a screen, as NumPy."""
    seen = np.array(surface.material) > 0
    point, value, done = search(
        surface,
        vectors(mi.Point3f, [probe]),
        reflected(targets, far),
        surface.position,
        surface.normal,
        surface.material,
        mi.UInt32(steps),
        mi.Bool(seen),
    )
    return columns(point), np.array(value), np.array(done), seen


def mirrored_by(surface, towards):
    """Points (N, 3) that the pixels reflect, `towards` m along the mirror ray of each."""
    origin = np.array(surface.camera["origin"]).ravel()
    points, normals = columns(surface.position).astype(np.float64), columns(surface.normal).astype(np.float64)
    incoming = points - origin
    incoming /= np.linalg.norm(incoming, axis=1, keepdims=True)
    out = incoming - 2 * np.sum(incoming * normals, axis=1, keepdims=True) * normals
    return points + towards * out


@pytest.mark.parametrize("scale", [0.01, 1, 100])
def test_exact_in_one_step_on_a_plane(scale):
    """Mirror z at the floor, connect with the probe: where that meets the floor. Lengths in any unit."""
    camera = PinholeCamera(tuple(scale * c for c in ABOVE.position), (0, 0.2 * scale, 0), ABOVE.fov)
    surface = screen(camera, floor)
    probe = np.array([-0.4, -1.5, 1.2]) * scale
    targets = mirrored_by(surface, 1.5 * scale)
    image = targets * [1, 1, -1]
    expected = probe + (image - probe) * (probe[2] / (probe[2] - image[:, 2]))[:, None]
    x, y, _ = camera.project(expected, SIZE)
    inside = (x > 1) & (x < SIZE[0] - 1) & (y > 1) & (y < SIZE[1] - 1)
    assert inside.mean() > 0.3
    point, value, _, _ = found(surface, probe, targets, steps=1)
    np.testing.assert_allclose(point[inside], expected[inside], atol=2e-4 * scale)
    np.testing.assert_allclose(value[inside], 1, atol=1e-5)
    assert (found(surface, probe, targets)[2][inside] == 1).all()


def test_what_is_infinitely_far_is_mirrored_too():
    surface = screen(ABOVE, floor)
    probe = np.array([-0.2, -1.8, 2.0])
    direction = mirrored_by(surface, 1.0) - columns(surface.position)
    expected = probe + direction * [1, 1, -1] * (probe[2] / direction[:, 2])[:, None]
    x, y, _ = ABOVE.project(expected, SIZE)
    inside = (x > 1) & (x < SIZE[0] - 1) & (y > 1) & (y < SIZE[1] - 1)
    point, value, _, _ = found(surface, probe, direction, steps=1, far=True)
    assert inside.mean() > 0.3
    np.testing.assert_allclose(point[inside], expected[inside], atol=5e-4)
    np.testing.assert_allclose(value[inside], 1, atol=1e-5)


@pytest.mark.parametrize(
    ("side", "radius", "eye", "probe"),
    [(1, 1.0, (0.2, -3.0, 0.5), (-0.7, -2.6, 0.9)), (-1, 4.0, (0.2, 2.0, 0.3), (-0.3, 1.8, 0.5))],
    ids=["outside", "inside"],
)
def test_converges_on_a_sphere(side, radius, eye, probe):
    """Fermat: over the mirror point the way from probe to z is stationary, here the shortest of those near by.

    A search ends where normal and half vector are 2.56° apart (T_max). Towards the mirror point the half vector turns
    against the normal outside the ball, and by less than a half of it inside this one. To that comes a pixel, since
    its normal is that of its centre. Pixels that see the ball from the side, or whose mirror point the camera does, are
    left out: there tangent planes mirror nothing.
    """
    camera = PinholeCamera(eye, (0.1, 5.0 if side < 0 else 1.0, 0.0), 0.7)
    probe = np.array(probe)
    surface = screen(camera, ball(radius, side))
    targets = mirrored_by(surface, 0.8)
    point, value, _, seen = found(surface, probe, targets)
    before = np.array(
        confidence(vectors(mi.Point3f, [probe]), reflected(targets), surface.position, surface.normal)
    )
    assert (value[seen] >= before[seen]).all()

    def on_ball(angles):
        (a, b), (c, d) = np.cos(angles), np.sin(angles)
        return radius * np.array([a * b, c * b, d])

    def facing(at):
        to_eye = np.array(eye) - at
        return side * np.dot(at, to_eye) / radius / np.linalg.norm(to_eye)

    start = columns(surface.position).astype(np.float64)
    compared = 0
    for lane in np.flatnonzero(seen)[:: seen.sum() // 100]:
        target = targets[lane]
        longitude, latitude = np.arctan2(start[lane, 1], start[lane, 0]), np.arcsin(start[lane, 2] / radius)
        way = minimize(
            lambda angles, z=target: (
                np.linalg.norm(on_ball(angles) - probe) + np.linalg.norm(on_ball(angles) - z)
            ),
            [longitude, latitude],
            tol=1e-12,
        )
        at = on_ball(way.x)
        x, y, depth = camera.project(at[None], SIZE)
        inside = 1 < x[0] < SIZE[0] - 1 and 1 < y[0] < SIZE[1] - 1
        if not inside or min(facing(at), facing(start[lane])) < 0.5:
            continue
        pixel = depth[0] / camera.focal_length(SIZE[0])
        assert value[lane] >= CONFIDENT
        assert (
            np.linalg.norm(point[lane] - at)
            < (1 if side > 0 else 2) * radius * np.arccos(CONFIDENT) + 2 * pixel
        )
        compared += 1
    assert compared > 30


def test_points_stay_on_the_screen_and_on_the_material():
    """Two materials side by side, and a probe whose mirror points lie far outside."""

    def halves(origins, directions):
        points, normals, _ = floor(origins, directions)
        return points, normals, np.where(points[:, 0] < 0, 1, 2)

    surface = screen(ABOVE, halves)
    for probe in ([5.0, 3.0, 0.5], [-6.0, -1.0, 4.0], [0.0, 8.0, 1.0]):
        point, value, _, _ = found(surface, probe, mirrored_by(surface, 3.0))
        x, y, depth = ABOVE.project(point.astype(np.float64), SIZE)
        assert (depth > 0).all()
        assert ((x > -0.01) & (x < SIZE[0] + 0.01) & (y > -0.01) & (y < SIZE[1] + 0.01)).all()
        # A point lies where its pixel's centre does, or less than a pixel (6 cm at most here) over the border.
        start = columns(surface.position)
        assert (np.abs(point[:, 0])[np.sign(point[:, 0]) != np.sign(start[:, 0])] < 0.06).all()
        np.testing.assert_array_less(value, 1.0001)


@pytest.mark.parametrize("camera", [ABOVE, ODD], ids=["ordinary", "rolled and off-centre"])
def test_steps_end_at_the_border_of_the_screen(camera):
    """Against the projection of points along the step; those that stay on the screen are not shortened."""
    surface = screen(camera, floor)
    start = columns(surface.position).astype(np.float64)
    move = np.random.default_rng(5).normal(size=start.shape) * [3.0, 3.0, 1.0]
    share = np.array(surface.share_within(surface.position, vectors(mi.Vector3f, move))).astype(np.float64)
    along = np.linspace(0, 1, 2001)
    points = start[:, None] + along[:, None] * move[:, None]
    x, y, depth = camera.project(points.reshape(-1, 3), SIZE)
    inside = (depth > 0) & (x >= 0) & (x <= SIZE[0]) & (y >= 0) & (y <= SIZE[1])
    inside = inside.reshape(points.shape[:2])
    leaves = ~inside.all(axis=1)
    assert leaves.mean() > 0.3
    expected = along[np.argmin(inside, axis=1)]
    np.testing.assert_allclose(share[leaves], expected[leaves], atol=2e-3)
    np.testing.assert_array_equal(share[~leaves], 1)


def test_a_search_that_cannot_go_on_ends_soon():
    """Mirror points far beside the screen: at its border there is nothing left to halve."""
    surface = screen(ABOVE, floor)
    _, value, done, _ = found(surface, [5.0, 3.0, 0.5], mirrored_by(surface, 3.0))
    assert (value < CONFIDENT).mean() > 0.9
    assert done.mean() < 6


def test_a_probe_behind_the_surface_finds_nothing():
    surface = screen(ABOVE, floor)
    point, value, _, _ = found(surface, [0.0, 0.0, -1.0], mirrored_by(surface, 1.0))
    assert (value == NONE).all()
    np.testing.assert_array_equal(point, columns(surface.position))


def test_degenerate_places_stay_finite():
    """A probe on the surface, in the reflected point, at the camera; a reflected point on the surface."""
    surface = screen(ABOVE, floor)
    position = columns(surface.position)
    for probe, targets in (
        (position[100], mirrored_by(surface, 1.0)),
        (np.array(ABOVE.position), mirrored_by(surface, 1e-9)),
        (mirrored_by(surface, 1.0)[100], mirrored_by(surface, 1.0)),
        (np.array(ABOVE.position), mirrored_by(surface, 1e6)),
    ):
        point, value, _, _ = found(surface, probe, targets)
        assert np.isfinite(point).all()
        assert np.isfinite(value).all()


def test_confidence_is_the_cosine_of_half_vector_and_normal():
    rng = np.random.default_rng(3)
    points, targets = rng.normal(size=(2, 200, 3))
    normals = rng.normal(size=(200, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    probe = np.array([0.3, 0.1, 2.0])
    half = sum(v / np.linalg.norm(v, axis=1, keepdims=True) for v in (probe - points, targets - points))
    expected = np.sum(half * normals, axis=1) / np.linalg.norm(half, axis=1)
    front = np.sum((probe - points) * normals, axis=1) > 0
    value = np.array(
        confidence(
            vectors(mi.Point3f, [probe]),
            reflected(targets),
            vectors(mi.Point3f, points),
            vectors(mi.Vector3f, normals),
        )
    )
    np.testing.assert_allclose(value[front], expected[front], atol=1e-5)
    assert (value[~front] == NONE).all()


def test_a_plane_that_is_seen_edge_on_mirrors_nothing():
    _, meets = mirror_point(
        mi.Point3f(0, 0, 0), reflected([[1.0, 0, 0]]), mi.Point3f(0.5, 0, 0), mi.Vector3f(0, 0, 1)
    )
    assert not np.array(meets).any()


RED, GREEN = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])


def floor_probes(folder, positions, colors, hidden=()):
    """Probes over the floor, each of its own color, which reflect a ceiling at z = 3; those `hidden` one at z = 1."""

    def reflected_position(probe, directions):
        x, y, z = positions[probe]
        down = np.minimum(directions[:, 2], -1e-3)
        height = 1.0 if probe in hidden else 3.0
        at = np.array([x, y]) + directions[:, :2] * ((z + height) / -down)[:, None]
        return np.concatenate([at, np.full((len(at), 1), height)], axis=1)

    return written(
        folder,
        positions,
        size=(256, 128),
        radiance=(lambda probe, d: np.tile(colors[probe], (len(d), 1)), np.float16),
        material_id=(lambda probe, d: (d[:, 2] < 0).astype(np.uint16), np.uint16),
        reflected_position=(reflected_position, np.float32),
        reflected_material_id=(lambda probe, d: np.full(len(d), 2), np.uint16),
    )


def blend(probes, surface, number):
    origin = np.array(surface.camera["origin"]).ravel()
    points = columns(surface.position).astype(np.float64)
    out = (points - origin) * [1, 1, -1]
    ceiling = points + out * (3.0 / out[:, 2])[:, None]
    color, _ = blended(
        probes,
        mi.UInt32(np.arange(number)),
        mi.UInt32(number),
        surface,
        reflected(ceiling),
        mi.UInt32(20),
        mi.Float(0.1),
        mi.Bool(np.array(surface.material) > 0),
    )
    return columns(color)


def test_a_probe_at_the_camera_shows_what_it_holds(tmp_path):
    probes = floor_probes(tmp_path, [ABOVE.position], [RED + 0.5 * GREEN])
    np.testing.assert_allclose(
        blend(probes, screen(ABOVE, floor), 1), np.tile(RED + 0.5 * GREEN, (64 * 48, 1)), atol=1e-3
    )


def test_no_ghost_where_the_reflection_is_hidden_from_a_probe(tmp_path):
    """The second probe sees something nearer in its mirror; where the first sees the ceiling, it alone counts."""
    positions = [ABOVE.position, (0.1, -1.7, 2.3)]
    probes = floor_probes(tmp_path, positions, [RED, GREEN], hidden=(1,))
    color = blend(probes, screen(ABOVE, floor), 2)
    np.testing.assert_allclose(color, np.tile(RED, (64 * 48, 1)), atol=1e-6)


def test_equally_good_probes_are_mixed_and_where_none_is_right_the_best_stands_in(tmp_path):
    surface = screen(ABOVE, floor)
    both = blend(floor_probes(tmp_path, [ABOVE.position] * 2, [RED, GREEN]), surface, 2)
    np.testing.assert_allclose(both, np.tile(0.5 * (RED + GREEN), (64 * 48, 1)), atol=1e-3)
    none = blend(floor_probes(tmp_path, [ABOVE.position] * 2, [RED, GREEN], hidden=(0, 1)), surface, 2)
    np.testing.assert_allclose(none, both, atol=1e-3)
