"""The fitted lobe, against covariances of Mitsuba's own GGX lobe summed over an image."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.glossy_probe_reprojection.footprint import (
    FIELD,
    Covariance,
    Footprint,
    slanted,
)


def spread(alpha, camera, point, half, cells=801, angle=0.0, least=0.0):
    """Covariance (2, 2) over the image of what GGX sends from a point by a plane to a camera, in tangents.

    camera, point: distances from the plane (m). half: of the image's side. angle: of incidence, the slant along y.
    least: share of the greatest value below which nothing counts; without it, a disk of radius `half` does.
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
    to_lamp = local(lamp)
    value = np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(to_lamp.T.astype(np.float32))))[0]
    weight = (value / to_lamp[:, 2]).reshape(x.shape) * falls
    weight *= (weight >= least * weight.max()) if least else (x**2 + y**2 <= half**2)
    moments = [np.sum(weight * a * b) / weight.sum() for a, b in ((x, x), (x, y), (y, y))]
    return np.array([[moments[0], moments[1]], [moments[1], moments[2]]])


@pytest.mark.parametrize("alpha", [0.05, 0.2, 0.5])
@pytest.mark.parametrize(("camera", "point"), [(1.0, 1.0), (0.3, 4.0), (5.0, 0.5)])
def test_the_table_holds_the_covariance_of_the_lobe(alpha, camera, point):
    share = point / (camera + point)
    found = np.array(Footprint().deviation(mi.Float(alpha), mi.Float(share)))[0]
    direct = spread(alpha, camera, point, FIELD)
    np.testing.assert_allclose(np.sqrt(np.diag(direct)), found, rtol=0.02)
    assert abs(direct[0, 1]) < 1e-3 * direct[0, 0]


def test_only_the_ratio_of_the_distances_counts():
    for scale in (0.01, 100):
        np.testing.assert_allclose(
            spread(0.1, 2 * scale, scale, FIELD, 301), spread(0.1, 2, 1, FIELD, 301), rtol=1e-3, atol=1e-9
        )


@pytest.mark.parametrize("degrees", [30, 60, 75])
def test_slant_narrows_the_lobe_across_and_not_along(degrees):
    """Of the lobe's core, down to a tenth: half vectors turn rays by 2 in the plane of incidence, by 2 cos θ across."""
    angle = np.radians(degrees)
    straight = spread(0.02, 1, 1, 0.2, angle=0.0, least=0.1)
    direct = spread(0.02, 1, 1, 0.2, angle=angle, least=0.1)
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

    def covariance(matrices):
        return Covariance(
            *(mi.Float(matrices[:, i, j].astype(np.float32)) for i, j in ((0, 0), (0, 1), (1, 1)))
        )

    a, b, direction = (covariance(first) - covariance(second)).principal()
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
