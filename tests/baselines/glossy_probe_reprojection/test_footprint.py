"""The fitted lobe, against Mitsuba's own GGX lobe over an image."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy import ndimage, optimize

from gibench.baselines.glossy_probe_reprojection.footprint import (
    FIELD,
    REDUCED,
    Covariance,
    Footprint,
    slanted,
)


def seen(alpha, camera, point, half, cells=801, angle=0.0):
    """What a small lamp sends by a GGX plane to a camera: places of the image x, y (tangents) and radiance there.

    camera, point: distances from the plane (m). half: of the image's side. angle: of incidence, the slant along y.
    """
    axis = (np.arange(cells) + 0.5) / cells * 2 * half - half
    x, y = np.meshgrid(axis, axis)
    # The plane z = 0, seen along (0, sin, −cos) from `camera` away: its mirror direction goes on to the point.
    eye = camera * np.array([0, -np.sin(angle), np.cos(angle)])
    lamp = point * np.array([0, np.sin(angle), np.cos(angle)])
    ahead, up = -eye / camera, np.array([0, np.cos(angle), np.sin(angle)])
    ray = ahead + x[..., None] * np.array([1.0, 0, 0]) + y[..., None] * up
    falls = ray[..., 2] < -1e-3
    hit = eye - ray * (eye[2] / np.where(falls, ray[..., 2], -1))[..., None]

    def local(target):
        towards = (target - hit).reshape(-1, 3)
        return towards / np.linalg.norm(towards, axis=1, keepdims=True)

    metal = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": alpha}
    bsdf = mi.load_dict(metal)
    si = dr.zeros(mi.SurfaceInteraction3f, x.size)
    si.wi = mi.Vector3f(local(eye).T.astype(np.float32))
    to_lamp = mi.Vector3f(local(lamp).T.astype(np.float32))
    value = np.array(bsdf.eval(mi.BSDFContext(), si, to_lamp), dtype=np.float64)[0].reshape(x.shape)
    return x, y, falls * value / np.sum((lamp - hit) ** 2, axis=-1)


def covariance(x, y, weight):
    """(2, 2)."""
    moments = [np.sum(weight * a * b) / weight.sum() for a, b in ((x, x), (x, y), (y, y))]
    return np.array([[moments[0], moments[1]], [moments[1], moments[2]]])


def tabled(alpha, share):
    return np.array(Footprint().deviation(mi.Float(alpha), mi.Float(share)))[0]


DISTANCES = pytest.mark.parametrize(("camera", "point"), [(1.0, 1.0), (0.3, 4.0), (5.0, 0.5)])


@pytest.mark.parametrize("alpha", [0.005, 0.05, 0.2, 0.5])
@DISTANCES
def test_the_table_holds_the_covariance_of_the_lobe_that_the_gaussian_weights(alpha, camera, point):
    """A Gaussian, weighted with itself, has half of its variance."""
    found = tabled(alpha, point / (camera + point))
    x, y, value = seen(alpha, camera, point, min(FIELD, 6 * found))
    window = np.exp(-0.5 * (x**2 + y**2) / found**2) * (x**2 + y**2 < FIELD**2)
    direct = covariance(x, y, value * window)
    np.testing.assert_allclose(np.sqrt(2 * np.diag(direct)), found, rtol=0.01)
    assert abs(direct[0, 1]) < 1e-3 * direct[0, 0]


@pytest.mark.parametrize("alpha", [0.005, 0.05, 0.2])
@DISTANCES
def test_no_other_gaussian_is_closer_to_the_lobe(alpha, camera, point):
    found = tabled(alpha, point / (camera + point))
    x, y, value = seen(alpha, camera, point, 5 * found, 401)
    squared, value = (x**2 + y**2) / found**2, value / value.max()

    def off(height, width):
        return (height * np.exp(-0.5 * squared / width**2) - value).ravel()

    best = optimize.least_squares(lambda p: off(*p), (1.0, 0.7)).x
    assert best[1] == pytest.approx(1, abs=0.015)


@pytest.mark.parametrize("alpha", [0.05, 0.2])
def test_two_steps_of_convolution_give_the_whole_lobe(alpha):
    """Half of the roughness, then the Gaussian of equation 3, against the lobe itself; and no wider or narrower one."""
    whole, half = tabled(alpha, 0.5), tabled(REDUCED * alpha, 0.5)
    side = 12 * whole
    _, _, wanted = seen(alpha, 1, 1, side, 1201)
    _, _, sharp = seen(REDUCED * alpha, 1, 1, side, 1201)
    pixel = 2 * side / 1201

    def missing(factor):
        blurred = ndimage.gaussian_filter(sharp, factor * np.sqrt(whole**2 - half**2) / pixel)
        return np.sqrt(np.sum((blurred - wanted) ** 2) / np.sum(wanted**2))

    assert missing(1) < 0.2
    assert missing(0) > 1
    assert missing(1) < min(missing(0.8), missing(1.25))


def test_only_the_ratio_of_the_distances_counts():
    x, y, value = seen(0.1, 2, 1, 0.2, 301)
    for scale in (0.01, 100):
        _, _, other = seen(0.1, 2 * scale, scale, 0.2, 301)
        np.testing.assert_allclose(covariance(x, y, other), covariance(x, y, value), rtol=1e-3, atol=1e-9)


@pytest.mark.parametrize("degrees", [30, 60, 75])
def test_slant_narrows_the_lobe_across_and_not_along(degrees):
    """Of the lobe's core, down to a tenth: half vectors turn rays by 2 in the plane of incidence, by 2 cos θ across."""
    angle = np.radians(degrees)

    def core(*image):
        return covariance(*image[:2], image[2] * (image[2] >= 0.1 * image[2].max()))

    straight, direct = core(*seen(0.02, 1, 1, 0.2)), core(*seen(0.02, 1, 1, 0.2, angle=angle))
    cosine = np.cos(angle)
    expected = slanted(mi.Float(straight[0, 0]), mi.Vector2f(0, 1), mi.Float(1), mi.Float(cosine**2))
    np.testing.assert_allclose(direct[0, 0], float(expected.xx[0]), rtol=0.05)
    np.testing.assert_allclose(direct[1, 1], float(expected.yy[0]), rtol=0.05)


def test_hard_ends_of_the_table():
    """Mirrors, roughness beyond the table, what touches the surface and what is infinitely far."""
    roughness, share = (a.ravel() for a in np.meshgrid([0, 1e-4, 0.005, 0.5, 1.0], [0, 1e-6, 0.5, 1.0]))
    found = np.array(
        Footprint().deviation(mi.Float(roughness.astype(np.float32)), mi.Float(share.astype(np.float32)))
    )
    assert np.isfinite(found).all()
    assert (found >= 0).all()
    assert (found[(roughness == 0) | (share == 0)] == 0).all()
    assert (found[(roughness > 0) & (share == 1)] > 0).all()


def test_principal_directions_are_those_of_numpy_and_never_negative():
    """Equation 3 of any two covariances, one after the other to be positive semi-definite."""
    rng = np.random.default_rng(4)
    roots = rng.normal(size=(2, 200, 2, 2))
    first, second = roots @ roots.swapaxes(-1, -2)
    first[:3], second[:3] = (np.diag([2.0, 2.0]), np.zeros((2, 2)), np.diag([0, 3.0])), 0

    def of(matrices):
        return Covariance(
            *(mi.Float(matrices[:, i, j].astype(np.float32)) for i, j in ((0, 0), (0, 1), (1, 1)))
        )

    a, b, direction = (of(first) - of(second)).principal()
    values = np.maximum(np.linalg.eigvalsh(first - second)[:, ::-1], 0)
    np.testing.assert_allclose(np.stack([a, b], axis=1), values, atol=1e-5)
    e = np.array(direction).T
    turned = np.stack([-e[:, 1], e[:, 0]], axis=1)
    kept = (
        np.array(a)[:, None, None] * e[:, :, None] * e[:, None]
        + np.array(b)[:, None, None] * turned[:, :, None] * turned[:, None]
    )
    positive = np.linalg.eigvalsh(first - second).min(axis=1) > 0
    np.testing.assert_allclose(kept[positive], (first - second)[positive], atol=1e-4)
