"""How much light leaves a lamp, and where, against paths in its shade."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.generators.furniture.lamp_light import (
    POLISHED,
    REFLECTED,
    THROUGH,
    out_of_bowl,
    out_of_shade,
    turned_area,
)
from gibench.generators.furniture.lamps import SHADES
from gibench.generators.light import emitting_area
from gibench.generators.light_shapes import light_mesh
from gibench.generators.parts import Light


def cosines_around(rng, normals):
    """Unit vectors (N, 3), by the cosine around normals (N, 3)."""
    towards = rng.normal(size=normals.shape)
    towards = normals + towards / np.linalg.norm(towards, axis=1, keepdims=True)
    return towards / np.linalg.norm(towards, axis=1, keepdims=True)


def paths_in_a_shade(lower, upper, tall, z, count=200_000):
    """Shares through the wall, out above and out below, of photons that are traced one by one."""
    rng = np.random.default_rng(0)
    at = np.tile([0.0, 0.0, z], (count, 1))
    way = rng.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    weight, lean = np.ones(count), (upper - lower) / tall
    found = np.zeros(3)
    for _ in range(60):
        # Where the cone r = lower + lean · z is left: a quadratic, whose first root ahead is the one.
        radius = lower + lean * at[:, 2]
        a = way[:, 0] ** 2 + way[:, 1] ** 2 - (lean * way[:, 2]) ** 2
        b = at[:, 0] * way[:, 0] + at[:, 1] * way[:, 1] - lean * radius * way[:, 2]
        c = at[:, 0] ** 2 + at[:, 1] ** 2 - radius**2
        root = np.sqrt(np.maximum(b**2 - a * c, 0))
        with np.errstate(divide="ignore", invalid="ignore"):
            both = np.stack([(-b - root) / a, (-b + root) / a])
        both = np.where(both > 1e-9, both, np.inf)
        beyond = at[None, :, 2] + np.minimum(both, 1e9) * way[None, :, 2]
        both = np.where(lower + lean * beyond > 0, both, np.inf)  # not on the other half of the cone
        far = both.min(axis=0)
        height = at[:, 2] + np.where(np.isfinite(far), far, 1e9) * way[:, 2]
        found[1] += weight[height > tall].sum()
        found[2] += weight[height < 0].sum()
        wall = (height >= 0) & (height <= tall)
        at, way, weight, far = at[wall], way[wall], weight[wall], far[wall]
        at = at + far[:, None] * way
        found[0] += THROUGH * weight.sum()
        weight = weight * REFLECTED
        outward = np.column_stack(
            [at[:, :2] / np.linalg.norm(at[:, :2], axis=1, keepdims=True), np.full(len(at), -lean)]
        )
        normal = -outward / np.linalg.norm(outward, axis=1, keepdims=True)
        at = at + 1e-7 * normal
        way = cosines_around(rng, normal)
    return found / count


@pytest.mark.parametrize("style", SHADES)
@pytest.mark.parametrize("place", [0.42, 0.52])
def test_light_of_a_shade_is_that_of_paths(style, place):
    share, tallness = SHADES[style]
    lower, upper, tall = 0.2, 0.2 * share, 0.4 * tallness
    leaving = out_of_shade(lower, upper, tall, place * tall)
    found = paths_in_a_shade(lower, upper, tall, place * tall)
    np.testing.assert_allclose([leaving.wall, leaving.above, leaving.below], found, atol=0.025)
    assert sum(found) < 1


def test_a_shade_that_is_hardly_there_keeps_no_light():
    flat = out_of_shade(0.2, 0.2, 1e-4, 5e-5)
    assert flat.above == pytest.approx(0.5, abs=1e-3)
    assert flat.below == pytest.approx(0.5, abs=1e-3)
    assert flat.wall < 1e-3


def test_of_half_a_sphere_as_much_leaves_as_in_closed_form():
    """Its wall sends half of what it reflects out; from the middle of its opening, so does the bulb."""
    half = np.linspace(0, np.pi / 2, 400)
    area = turned_area(np.column_stack([np.cos(half), np.sin(half)]))
    assert area == pytest.approx(2 * np.pi, rel=1e-5)
    assert out_of_bowl(1.0, area, 0.0) == pytest.approx(
        0.5 + 0.5 * POLISHED * 0.5 / (1 - 0.5 * POLISHED), rel=1e-4
    )


@pytest.mark.parametrize("size", [(0.2, 0.1, 0.25), (0.15, 0.15, 0.2), (0.1, 0.2, 0.3)])
def test_a_shade_glows_outwards_over_the_area_that_its_radiance_counts_on(size):
    light = Light("a", "shade", size, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1000.0, 3000.0)
    mesh = light_mesh(light)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a) / 2
    assert np.linalg.norm(cross, axis=1).sum() == pytest.approx(emitting_area(light), rel=0.002)
    middle = (a + b + c) / 3
    assert (np.einsum("ij,ij->i", cross[:, :2], middle[:, :2]) > 0).all()
    along = np.einsum(
        "ij,ij->i", mesh.normals[mesh.faces[:, 0]], cross / np.linalg.norm(cross, axis=1)[:, None]
    )
    assert (along > 0.99).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1)
    np.testing.assert_allclose(mesh.vertices[:, 2].max(), size[2] / 2)
