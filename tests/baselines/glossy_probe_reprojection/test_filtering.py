"""The four passes, against equation 4 summed over the whole plane."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.glossy_probe_reprojection.filtering import Guides, filtered
from gibench.baselines.glossy_probe_reprojection.footprint import Covariance

SIZE = (72, 56)
X, Y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))


def lanes(kind, image):
    flat = np.asarray(image, dtype=np.uint32 if kind is mi.UInt32 else np.float32)
    flat = flat.reshape(SIZE[1] * SIZE[0], -1).T
    return kind(np.ascontiguousarray(flat[0] if len(flat) == 1 else flat))


def flat_guides():
    return {
        "normal": np.tile([0.0, 0, 1], (*X.shape, 1)),
        "depth": np.ones(X.shape),
        "material": np.ones(X.shape),
    }


def run(color, covariance, guides=None, weight=1.0, taps=64, unit=1.0):
    """The filter of an image (H, W, 3); covariance: (2, 2) of all pixels, or (H, W, 2, 2)."""
    guides = flat_guides() | (guides or {})
    given = Guides(
        lanes(mi.Vector3f, guides["normal"]),
        lanes(mi.Float, guides["depth"]),
        lanes(mi.UInt32, guides["material"]),
        *(mi.Int32(side) for side in SIZE),
        mi.Float(unit),
    )
    matrices = np.broadcast_to(covariance, (*X.shape, 2, 2))
    found = filtered(
        lanes(mi.Color3f, color),
        lanes(mi.Float, np.broadcast_to(weight, X.shape)),
        given,
        Covariance(*(lanes(mi.Float, matrices[..., i, j]) for i, j in ((0, 0), (0, 1), (1, 1)))),
        dr.opaque(mi.UInt32, taps),
        mi.Bool(np.ones(X.size, dtype=bool)),
    )
    return np.array(found).T.reshape(*X.shape, 3)


def whole_plane(color, covariance, allowed=None, weight=1.0):
    """Equation 4. allowed: (pixels, pixels), the range weight."""
    places = np.stack([X, Y], axis=-1).reshape(-1, 2)
    offset = places[None] - places[:, None]
    gauss = np.exp(-0.5 * np.einsum("abi,ij,abj->ab", offset, np.linalg.inv(covariance), offset))
    gauss *= np.broadcast_to(weight, X.shape).ravel()
    gauss *= 1 if allowed is None else allowed
    return (gauss @ color.reshape(-1, 3) / gauss.sum(axis=1, keepdims=True)).reshape(color.shape)


def noise(seed=0):
    return np.random.default_rng(seed).uniform(0, 1, (*X.shape, 3))


def turned(first, second, degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, -s], [s, c]])
    return turn @ np.diag([first, second]) @ turn.T


@pytest.mark.parametrize(
    "covariance",
    [turned(9, 9, 0), turned(25, 4, 0), turned(36, 2, 90), turned(25, 4, 30), turned(16, 3, 135)],
    ids=["round", "wide", "high", "slanted", "diagonal"],
)
def test_four_passes_are_the_filter_over_the_plane(covariance):
    """Of noise, to a tenth of what the filter leaves of it: lines at an angle sample bilinearly, and end at 2.5 σ.

    At the borders too, where both lose what lies beyond, but not along the same lines.
    """
    image = noise()
    expected = whole_plane(image, covariance)
    difference = run(image, covariance) - expected
    inner = difference[12:-12, 12:-12]
    assert np.abs(inner).max() < 0.4 * expected.std()
    assert np.sqrt(np.mean(inner**2)) < 0.1 * expected.std()
    assert np.sqrt(np.mean(difference**2)) < 0.15 * expected.std()


def test_the_covariance_is_that_which_was_asked_for():
    """Of the image of a point."""
    covariance = turned(20, 5, 25)
    point = np.zeros((*X.shape, 3))
    point[28, 36] = 1
    found = run(point, covariance)[..., 0]
    found /= found.sum()
    offset = np.stack([X - 36, Y - 28], axis=-1)
    moments = np.einsum("yx,yxi,yxj->ij", found, offset, offset)
    np.testing.assert_allclose(moments, covariance, rtol=0.1)


def test_nothing_crosses_an_edge_of_normal_depth_or_material():
    left = X < 36
    image = np.where(left[..., None], [1.0, 0, 0], [0, 1.0, 0])
    for guide, values in (
        ("normal", np.where(left[..., None], [0, 0, 1.0], [1.0, 0, 0])),
        ("depth", np.where(left, 1.0, 1.3)),
        ("material", np.where(left, 1, 2)),
    ):
        np.testing.assert_allclose(run(image, turned(30, 10, 40), {guide: values}), image, atol=1e-6)
    np.testing.assert_array_less(
        0.1, run(image, turned(30, 10, 40), {"depth": np.where(left, 1.0, 1.1)})[:, 36, 0]
    )


def test_depths_are_in_units():
    left = X < 36
    image = np.where(left[..., None], [1.0, 0, 0], [0, 1.0, 0])
    deep = {"depth": np.where(left, 100.0, 110.0)}
    np.testing.assert_allclose(run(image, turned(9, 9, 0), deep), image, atol=1e-6)
    np.testing.assert_allclose(
        run(image, turned(9, 9, 0), deep, unit=100.0), run(image, turned(9, 9, 0)), atol=1e-6
    )


def test_an_even_image_stays_as_it_is_whatever_the_footprints():
    rng = np.random.default_rng(2)
    roots = rng.normal(size=(*X.shape, 2, 2)) * rng.uniform(0, 20, (*X.shape, 1, 1))
    even = np.full((*X.shape, 3), 0.7)
    np.testing.assert_allclose(run(even, roots @ roots.swapaxes(-1, -2), taps=8), even, rtol=1e-5)


def test_a_footprint_of_nothing_is_the_identity():
    np.testing.assert_allclose(run(noise(), np.zeros((2, 2))), noise(), rtol=1e-5)


def test_what_is_not_trusted_is_filled_in_from_around():
    """Holes have a weight of 0; where everything is one, it stays."""
    image = np.where((np.hypot(X - 36, Y - 28) < 3)[..., None], 100.0, np.full(3, 0.5))
    weight = np.where(np.hypot(X - 36, Y - 28) < 3, 0.0, 1.0)
    np.testing.assert_allclose(run(image, turned(30, 30, 0), weight=weight), 0.5, rtol=1e-5)
    np.testing.assert_allclose(run(noise(), turned(30, 30, 0), weight=0.0), noise(), rtol=1e-5)


def test_few_taps_leave_no_copies_of_a_small_light():
    """A pixel of light under a footprint that is far wider than the taps reach: it falls off smoothly."""
    point = np.zeros((*X.shape, 3))
    point[28, 36] = 1000
    row = run(point, turned(60, 60, 0), taps=6)[28, 20:52, 0]
    smooth = np.exp(-0.5 * (np.arange(20, 52) - 36) ** 2 / 60)
    smooth *= row.sum() / smooth.sum()
    assert np.abs(row - smooth).max() < 0.5 * smooth.max()


def test_very_bright_light_stays_finite():
    image = noise()
    image[20, 20] = 1e35
    found = run(image, turned(30, 10, 40))
    assert np.isfinite(found).all()
