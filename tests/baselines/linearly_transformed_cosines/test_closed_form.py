"""Form factors and fitted lobes, against sums over the light in double precision."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.linearly_transformed_cosines.fitting import fitted, lobes, share_above
from gibench.baselines.linearly_transformed_cosines.polygons import above_horizon, form_factor, outline
from gibench.baselines.linearly_transformed_cosines.rectangle import cosine_density
from gibench.baselines.linearly_transformed_cosines.table import TransformTable, alphas, cosines, table
from gibench.rendering.lighting import AreaLight

POINTS = 160
"""Along each side of a light, of the sums."""


def outlines(corners):
    """Edges of lights (N, 4, 3) seen from the origin."""
    corners = np.asarray(corners)
    sides = np.roll(corners, -1, axis=1) - corners
    return outline(
        *([mi.Vector3f(*part[:, i].T.astype(np.float32)) for i in range(4)] for part in (corners, sides))
    )


def summed(corners, lobe):
    """∫ lobe over the directions to a light (4, 3) that shines one way; lobe has the cosine in it."""
    grid = (np.arange(POINTS) + 0.5) / POINTS
    a, b = (side.ravel()[:, None] for side in np.meshgrid(grid, grid))
    along, up = corners[1] - corners[0], corners[3] - corners[0]
    points = corners[0] + a * along + b * up
    shines = np.cross(along, up)
    squared = (points**2).sum(axis=1)
    directions = points / np.sqrt(squared)[:, None]
    weight = np.maximum(-(directions @ shines), 0) / squared
    return float((lobe(directions) * weight).mean())


def matt(directions):
    return np.maximum(directions[:, 2], 0) / np.pi


def ggx(alpha, cosine):
    """Walter et al. 2007 with separable masking and the reflectance 1, cosine included."""
    view = np.array([np.sqrt(1 - cosine**2), 0, cosine])

    def masking(c):
        return 2 * c / (c + np.sqrt(alpha**2 + (1 - alpha**2) * c**2))

    def lobe(directions):
        half = directions + view
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        normals = alpha**2 / (np.pi * (half[:, 2] ** 2 * (alpha**2 - 1) + 1) ** 2)
        z = np.maximum(directions[:, 2], 1e-12)
        value = normals * masking(cosine) * masking(z) / (4 * cosine)
        return np.where(directions[:, 2] > 0, value, 0)

    return lobe


def light(centre, towards=(0, 0, 0), width=1.0, height=1.0):
    return AreaLight(centre, np.subtract(towards, centre), width, height, (1, 1, 1)).corners


@pytest.mark.parametrize(
    ("width", "height"), [(1e-3, 1e-3), (1e-3, 5.0), (0.01, 0.01), (0.5, 1.0), (5.0, 5.0), (3.0, 0.2)]
)
def test_form_factors_of_all_sizes_and_places(width, height):
    rng = np.random.default_rng(0)
    centres = rng.normal(size=(40, 3))
    centres *= rng.uniform(1, 3, (40, 1)) / np.linalg.norm(centres, axis=1, keepdims=True)
    lights = [light(c, 0.4 * rng.normal(size=3), width, height) for c in centres]
    # Lambert's formula has a sign, so that from behind it is negative or 0.
    found = np.array(form_factor(outlines(lights)))
    expected = np.array([summed(corners, matt) for corners in lights])
    assert (expected > 0).sum() > 5
    assert (expected == 0).any()
    np.testing.assert_allclose(found, expected, rtol=0.01, atol=0.001 * expected.max())


def test_a_light_edge_on_behind_and_at_the_horizon():
    edge_on = light((0, 0, 2), (1, 0, 2))
    behind = light((0, 0, 2), (0, 0, 3))
    below = light((0, 0, -1), (0, 0, 0))
    touching = light((1, 0, 0.5), (0, 0, 0.5))  # its lower side lies in the horizon
    halved = light((1, 0, 0), (0, 0, 0))
    on_it = light((0, 0, 0), (0, 0, 1))  # through the point itself
    found = np.array(form_factor(outlines([edge_on, behind, below, touching, halved, on_it])))
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found[:3], 0, atol=1e-7)
    np.testing.assert_allclose(found[3], summed(touching, matt), rtol=2e-3)
    # What of it is above spans 45° on both sides: the closed form of a rectangle at a right angle at its edge.
    expected = summed(halved, matt)
    np.testing.assert_allclose(found[4], expected, rtol=0.01)
    assert 0 <= found[5] <= 1


def test_a_light_that_fills_the_view():
    np.testing.assert_allclose(
        np.array(form_factor(outlines([light((0, 0, 0.01), width=100, height=100)]))), 1, rtol=1e-3
    )


@pytest.mark.parametrize(
    ("alpha", "degrees", "bound"),
    [
        *[(alpha, degrees, 0.03) for alpha in (0.02, 0.05, 0.1, 0.25) for degrees in (0, 30)],
        *[(alpha, 55, 0.03) for alpha in (0.02, 0.05, 0.1)],
        *[(alpha, 30, 0.04) for alpha in (0.45, 1.0)],
        *[(alpha, 75, 0.18) for alpha in (0.03, 0.1, 0.25, 0.45)],  # where no transformed cosine is as GGX is
    ],
)
def test_lobes_are_as_they_are_integrated(alpha, degrees, bound):
    """Errors are of the lobe's peak: the most that a light of that size gives, wherever it is."""
    theta = np.radians(degrees)
    view = np.array([np.sin(theta), 0, np.cos(theta)])
    angles = np.radians(np.arange(-90, 91, 15))
    mirrored = [(-np.sin(a), 0, np.cos(a)) for a in (*angles, theta)]
    beside = [(-np.sin(a) * np.cos(0.5), np.sin(a) * np.sin(0.5), np.cos(a)) for a in angles]
    for side in (0.4, 3.0):
        lights = [light(2 * np.array(place), width=side, height=side) for place in (*mirrored, *beside)]
        transform = TransformTable().transform(mi.Float(alpha), mi.Float(float(view[2])))
        edges = [edge.mapped(transform.inverse) for edge in above_horizon(outlines(lights))]
        found = np.array(form_factor(edges) * transform.share)
        expected = np.array([summed(corners, ggx(alpha, view[2])) for corners in lights])
        assert np.abs(found - expected).max() <= bound * expected.max()


def test_no_lobe_reflects_more_than_it_is_given():
    values = table().astype(np.float64)
    share, grazing = values[..., 4], values[..., 5]
    assert np.isfinite(values).all()
    for alpha, row in zip(alphas(), values, strict=True):
        above = [share_above(entry[:3] * [alpha, alpha, 1], entry[3]) for entry in row]
        assert (row[:, 4] * above).max() <= 1.006
    assert (grazing >= 0).all()
    assert (grazing <= share).all()


def test_densities_integrate_to_what_is_above():
    rng = np.random.default_rng(1)
    z, turn = rng.uniform(0, 1, 200_000), rng.uniform(0, 2 * np.pi, 200_000)
    level = np.sqrt(1 - z**2)
    directions = mi.Vector3f(
        *(part.astype(np.float32) for part in (level * np.cos(turn), level * np.sin(turn), z))
    )
    for alpha, cosine in ((0.3, 0.9), (0.5, 0.3), (1.0, 0.1)):
        transform = TransformTable().transform(mi.Float(alpha), mi.Float(cosine))
        parameters = np.array([transform.m11[0], transform.m22[0], transform.m13[0]])
        angle = float(np.arctan2(transform.sine[0], transform.cosine[0]))
        mean = 2 * np.pi * np.array(cosine_density(transform, directions)).mean()
        np.testing.assert_allclose(mean, share_above(parameters, angle), rtol=0.03)


def test_the_table_is_what_the_command_fits():
    row, column = 40, 20
    alpha = alphas()[row]
    kept = table()[row, column].astype(np.float64)
    lobe = lobes(alpha, cosines()[column : column + 1])[0]
    again = fitted(lobe, alpha, kept[:4])
    np.testing.assert_allclose(again, kept[:4], rtol=0.02, atol=0.02)
    above = share_above(again[:3] * [alpha, alpha, 1], again[3])
    np.testing.assert_allclose(lobe.mean(1.0) / above, kept[4], rtol=0.01)
