"""Moved mirror points, against those that Fermat's principle gives on the very surface in double precision."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.optimize import root

from gibench.baselines.glossy_probe_reprojection.perturbation import Mirror, displacement
from tests.baselines.probes.test_mappings import columns

CASES = 16
"""Paths on each surface."""


def vectors(kind, values):
    return kind(np.ascontiguousarray(np.atleast_2d(np.asarray(values, dtype=np.float32)).T))


def plane(at):
    return np.array([at[0], at[1], 0.0]), np.array([[1.0, 0, 0], [0, 1.0, 0]])


def sphere(radius):
    """Around (0, 0, −radius), so that it touches the plane at the origin; a negative radius bends upwards."""

    def surface(at):
        a, b = at / radius
        point = radius * np.array([np.sin(a) * np.cos(b), np.sin(b), np.cos(a) * np.cos(b) - 1])
        along = np.array([np.cos(a) * np.cos(b), 0, -np.sin(a) * np.cos(b)])
        across = np.array([-np.sin(a) * np.sin(b), np.cos(b), -np.cos(a) * np.sin(b)])
        return point, np.array([along, across])

    return surface


def cylinder(radius):
    """Around the line along y through (0, 0, −radius)."""

    def surface(at):
        a = at[0] / radius
        point = np.array([radius * np.sin(a), at[1], radius * (np.cos(a) - 1)])
        return point, np.array([[np.cos(a), 0, -np.sin(a)], [0, 1.0, 0]])

    return surface


SURFACES = {
    "plane": (plane, (0, 0)),
    "convex sphere": (sphere(1.5), (-1 / 1.5, -1 / 1.5)),
    "concave sphere": (sphere(-12.0), (1 / 12, 1 / 12)),
    "convex cylinder": (cylinder(0.8), (-1 / 0.8, 0)),
    "concave cylinder": (cylinder(-10.0), (1 / 10, 0)),
}


def mirror_point(surface, eye, target, far=False):
    """Where the path over the surface is stationary, the point next to the origin: (3,)."""

    def slope(at):
        point, tangents = surface(at)
        u = (point - eye) / np.linalg.norm(point - eye)
        v = -target if far else (point - target) / np.linalg.norm(point - target)
        return tangents @ (u + v)

    found = root(slope, [0.0, 0.0], tol=1e-13)
    assert found.success or np.abs(slope(found.x)).max() < 1e-10
    return surface(found.x)[0]


def paths(seed):
    """Eyes, what they see mirrored in the origin, and unit directions that they move in: (CASES, 3) each."""
    rng = np.random.default_rng(seed)
    angle, around = rng.uniform(0.2, 1.0, CASES), rng.uniform(0, 2 * np.pi, CASES)
    towards = np.stack(
        [np.sin(angle) * np.cos(around), np.sin(angle) * np.sin(around), np.cos(angle)], axis=1
    )
    move = rng.normal(size=(CASES, 3))
    eyes = rng.uniform(1, 2, (CASES, 1)) * towards
    targets = rng.uniform(0.5, 1.5, (CASES, 1)) * towards * [-1, -1, 1]
    return eyes, targets, move / np.linalg.norm(move, axis=1, keepdims=True)


def moved(curvature, eyes, targets, moves, order, far=False, direction=(1.0, 0, 0)):
    """Displacements (N, 3) at the origin. curvature: (2,) or (N, 2); all else (N, 3) or (3,)."""
    count = len(np.atleast_2d(eyes))

    def lanes(kind, values):
        values = np.asarray(values, dtype=np.float32)
        return vectors(kind, np.broadcast_to(values, (count, values.shape[-1])))

    mirror = Mirror(
        lanes(mi.Point3f, (0, 0, 0)),
        lanes(mi.Vector3f, (0, 0, 1)),
        lanes(mi.Vector2f, curvature),
        lanes(mi.Vector3f, direction),
    )
    number = mi.UInt32(order)
    dr.make_opaque(number)
    found = displacement(
        mirror,
        lanes(mi.Point3f, eyes),
        lanes(mi.Point3f, targets),
        mi.Bool(np.full(count, far)),
        lanes(mi.Vector3f, moves),
        number,
    )
    return columns(found).astype(np.float64)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize(
    ("name", "far"),
    [(name, far) for name in SURFACES for far in (False, True) if (name, far) != ("plane", True)],
)
def test_the_first_order_errs_as_the_square_and_the_second_as_the_cube(name, far):
    """Half the move, a quarter and an eighth of the error, in the mean over many paths."""
    surface, curvature = SURFACES[name]
    eyes, targets, directions = paths(7)
    if far:
        targets = unit(targets)
    errors = []
    for h in (0.16, 0.08, 0.04):
        truth = np.array(
            [
                mirror_point(surface, eye, target, far)
                for eye, target in zip(eyes + h * directions, targets, strict=True)
            ]
        )
        steps = [moved(curvature, eyes, targets, h * directions, order, far) for order in (1, 2)]
        errors.append([np.linalg.norm(step - truth, axis=1).mean() for step in steps])
    first, second = np.array(errors).T
    np.testing.assert_allclose(np.log2(first[:-1] / first[1:]), 2, atol=0.25)
    np.testing.assert_allclose(np.log2(second[:-1] / second[1:]), 3, atol=0.4)
    assert (second < 0.5 * first).all()


def test_what_is_infinitely_far_slides_over_a_plane_as_the_eye_does():
    """The ray keeps its direction, so the first order is exact, however far the eye goes."""
    eyes, targets, directions = paths(2)
    rays = unit(targets) * [1, 1, -1]
    ends = eyes + 0.5 * directions
    truth = ends - rays * (ends[:, 2:] / rays[:, 2:])
    for order in (1, 2):
        np.testing.assert_allclose(
            moved((0, 0), eyes, unit(targets), 0.5 * directions, order, True), truth, atol=1e-6
        )


def test_order_0_stays():
    assert not moved((0, 0), *paths(1), 0).any()


def test_directions_of_curvature_turn_with_the_surface():
    """A cylinder along x is one along y whose first direction is y."""
    swap = [1, 0, 2]
    eyes, targets, moves = paths(3)
    along_y = moved((-0.8, 0), eyes, targets, 0.1 * moves, 2)
    along_x = moved(
        (-0.8, 0), eyes[:, swap], targets[:, swap], 0.1 * moves[:, swap], 2, direction=(0, 1.0, 0)
    )
    np.testing.assert_allclose(along_x[:, swap], along_y, atol=1e-5)


@pytest.mark.parametrize("scale", [0.01, 100])
def test_lengths_scale_with_the_scene(scale):
    eyes, targets, moves = paths(5)
    once = moved((0.3, -0.4), eyes, targets, 0.3 * moves, 2)
    scaled = moved((0.3 / scale, -0.4 / scale), eyes * scale, targets * scale, 0.3 * moves * scale, 2)
    np.testing.assert_allclose(scaled, scale * once, rtol=1e-4, atol=1e-5 * scale)


def test_a_focus_does_not_blow_up():
    """Eye and target in conjugate points of a concave mirror, and all around: steps are no longer than the paths."""
    eye, target, move = np.array([0.3, 0, 2.0]), np.array([-0.15, 0, 1.0]), np.array([0.2, 0.1, -0.1])
    reach = np.linalg.norm(eye) + np.linalg.norm(target) + np.linalg.norm(move)
    curvature = np.repeat(np.linspace(0.5, 1.0, 101)[:, None], 2, axis=1)
    for order in (1, 2):
        steps = moved(curvature, np.tile(eye, (101, 1)), target, move, order)
        assert np.isfinite(steps).all()
        assert (np.linalg.norm(steps, axis=1) <= order * reach + 1e-4).all()


@pytest.mark.parametrize(
    ("eye", "target"),
    [((0, 0, 0), (0, 0, 1)), ((0, 0, 1), (0, 0, 0)), ((1, 0, 0), (-1, 0, 0)), ((0, 0, 1e-12), (0, 0, 1e12))],
    ids=["eye on the surface", "target on the surface", "edge on", "extremes"],
)
def test_degenerate_paths_stay_finite(eye, target):
    curvature = [(0, 0), (1, 1), (1e6, -1e6)]
    steps = moved(curvature, np.tile(np.array(eye, dtype=float), (3, 1)), target, (0.1, 0.2, 0.3), 2)
    assert np.isfinite(steps).all()
