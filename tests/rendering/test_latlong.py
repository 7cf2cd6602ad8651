"""Lat-long panoramas against the sphere's closed forms, and against how Mitsuba reads them."""

import numpy as np
import pytest

from gibench.rendering.latlong import (
    coordinates,
    directions,
    for_envmap,
    mean_luminance,
    resampled,
    solid_angles,
)


def cell_centres(height):
    return np.arange(2 * height) + 0.5, np.arange(height)[:, None] + 0.5


def flux(image):
    """(C,) integral of a panorama over the sphere."""
    return solid_angles(len(image)) @ image.sum(axis=1, dtype=np.float64)


def test_the_texels_cover_the_sphere():
    for height in (1, 2, 37, 4096):
        assert 2 * height * solid_angles(height).sum() == pytest.approx(4 * np.pi, rel=1e-12)


def test_directions_and_places_are_inverse():
    x, y = cell_centres(64)
    towards = directions(x, y, 64)
    back_x, back_y = coordinates(3.7 * towards, 64)
    np.testing.assert_allclose(back_x, np.broadcast_to(x, back_x.shape), atol=1e-9)
    np.testing.assert_allclose(back_y, np.broadcast_to(y, back_y.shape), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(towards, axis=-1), 1)


def test_the_zenith_and_what_is_next_to_it_keep_their_digits():
    _, y = coordinates(np.array([[0, 0, 1.0], [1e-9, 0, 1.0], [0, 0, -2.0]]), 128)
    np.testing.assert_allclose(y, [0, 128 * 1e-9 / np.pi, 128], rtol=1e-9)


def test_mitsuba_reads_a_panorama_along_the_same_directions():
    from gibench.rendering.backend import select_variant

    select_variant()
    import drjit as dr
    import mitsuba as mi

    height = 16
    image = np.random.default_rng(0).random((height, 2 * height, 3)).astype(np.float32)
    turned = mi.ScalarTransform4f().rotate([1, 0, 0], 90)
    emitter = mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(for_envmap(image)), "to_world": turned})
    si = dr.zeros(mi.SurfaceInteraction3f, image.shape[0] * image.shape[1])
    si.wi = mi.Vector3f(-directions(*cell_centres(height), height).reshape(-1, 3).T.astype(np.float32))
    np.testing.assert_allclose(np.array(emitter.eval(si)).T.reshape(image.shape), image, atol=1e-4)


@pytest.mark.parametrize(("old", "new"), [(64, 16), (64, 24), (16, 64), (7, 50), (128, 128)])
def test_all_the_light_is_kept_and_a_constant_stays_itself(old, new):
    image = np.random.default_rng(old).gamma(0.3, size=(old, 2 * old, 3)).astype(np.float32)
    image[old // 3, old // 2] = 1e5  # a sun
    again = resampled(image, new)
    assert again.shape == (new, 2 * new, 3)
    assert again.dtype == np.float32
    np.testing.assert_allclose(flux(again), flux(image), rtol=1e-6)
    np.testing.assert_allclose(resampled(np.full_like(image, 0.7), new), np.float32(0.7), rtol=1e-6)


def test_a_texel_in_four_is_the_mean_of_those_that_it_replaces():
    image = np.random.default_rng(1).random((32, 64, 3))
    weights = solid_angles(32)[:, None, None]
    blocks = (image * weights).reshape(16, 2, 32, 2, 3).sum(axis=(1, 3))
    areas = np.broadcast_to(weights, image.shape).reshape(16, 2, 32, 2, 3).sum(axis=(1, 3))
    np.testing.assert_allclose(resampled(image, 16), blocks / areas, rtol=1e-6)


def test_a_dipole_has_no_mean_and_an_overcast_sky_half_of_its_zenith():
    z = directions(*cell_centres(256), 256)[..., 2]
    assert mean_luminance(np.repeat(1 + z[..., None], 3, axis=2)) == pytest.approx(1, rel=1e-9)
    # ∫ max(z, 0) over the sphere is π, a quarter of it.
    assert mean_luminance(np.repeat(np.maximum(z, 0)[..., None], 3, axis=2)) == pytest.approx(0.25, rel=1e-4)
