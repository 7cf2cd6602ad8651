"""Cubemaps against solid angles in closed form, and against the directions that their texels look along."""

import numpy as np
import pytest

from gibench.rendering.cubemap import FACES, cube_directions, texel_solid_angles, to_cubemap, to_latlong
from gibench.rendering.latlong import directions, solid_angles


def panorama(height, seed=0):
    return np.random.default_rng(seed).gamma(0.3, size=(height, 2 * height, 3)).astype(np.float32)


def cube_flux(faces):
    return np.einsum("rc,frck->k", texel_solid_angles(faces.shape[1]), faces.astype(np.float64))


def flux(image):
    return solid_angles(len(image)) @ image.sum(axis=1, dtype=np.float64)


@pytest.mark.parametrize("size", [1, 3, 64])
def test_the_texels_cover_the_sphere(size):
    assert 6 * texel_solid_angles(size).sum() == pytest.approx(4 * np.pi, rel=1e-12)
    towards = cube_directions(size)
    np.testing.assert_allclose(np.linalg.norm(towards, axis=-1), 1)
    # In the middle of a face a texel looks along the axis that the face is called by.
    middle = towards.mean(axis=(1, 2))
    for face, name in enumerate(FACES):
        expected = (1 if name[0] == "+" else -1) * np.eye(3)["xyz".index(name[1])]
        np.testing.assert_allclose(middle[face] / np.linalg.norm(middle[face]), expected, atol=1e-9)


@pytest.mark.parametrize(("height", "size"), [(128, 64), (128, 16), (32, 64), (20, 8)])
def test_a_constant_stays_itself_and_no_light_is_lost(height, size):
    constant = to_cubemap(np.full((height, 2 * height, 3), 0.7, np.float32), size)
    np.testing.assert_allclose(constant, np.float32(0.7), rtol=1e-6)
    image = panorama(height)
    np.testing.assert_allclose(cube_flux(to_cubemap(image, size)), flux(image), rtol=1e-4)
    # A sun in one texel, wherever it is: also at the zenith and across an edge of the cube.
    for row, column in [(0, 0), (height // 3, 5), (height // 2, height // 4), (height - 1, 1)]:
        sun = np.zeros((height, 2 * height, 3), np.float32)
        sun[row, column] = 1e5
        np.testing.assert_allclose(cube_flux(to_cubemap(sun, size)), flux(sun), rtol=1e-4)


def test_what_a_texel_holds_is_what_lies_in_its_direction():
    towards = directions(np.arange(512) + 0.5, np.arange(256)[:, None] + 0.5, 256)
    faces = to_cubemap((1 + 0.5 * towards).astype(np.float32), 32)
    # A texel is 3.6° wide at most, over which a direction changes by as much as its mean may differ.
    np.testing.assert_allclose(faces, 1 + 0.5 * cube_directions(32), atol=2e-3)


def test_a_quarter_turn_moves_the_sides_on():
    image = panorama(64)
    # Columns run against the azimuth: this turns the panorama by 90° to the left, as seen from above.
    turned = to_cubemap(np.roll(image, -32, axis=1), 16)
    faces = to_cubemap(image, 16)
    names = {name: faces[k] for k, name in enumerate(FACES)}
    for was, now in [("+x", "+y"), ("+y", "-x"), ("-x", "-y"), ("-y", "+x")]:
        np.testing.assert_allclose(turned[FACES.index(now)], names[was], rtol=1e-4, atol=1e-5)
    caps = {
        name: [np.abs(turned[FACES.index(name)] - np.rot90(names[name], k)).max() for k in (1, -1)]
        for name in ("+z", "-z")
    }
    # Seen from below the top turns the other way round than the bottom, seen from above.
    assert int(np.argmin(caps["+z"])) != int(np.argmin(caps["-z"]))
    assert max(min(c) for c in caps.values()) < 1e-3


def test_no_seam_between_faces():
    """Something smooth is as smooth across the edges of faces as within them."""
    towards = directions(np.arange(512) + 0.5, np.arange(256)[:, None] + 0.5, 256)
    smooth = (2 + towards[..., :1] * towards[..., 1:2] + towards[..., 2:]).astype(np.float32)
    faces = to_cubemap(smooth, 32)[..., 0]
    within = np.abs(np.diff(faces, axis=2)).max()
    for left, right in [("+x", "-y"), ("-y", "-x"), ("-x", "+y"), ("+y", "+x")]:
        across = np.abs(faces[FACES.index(left), :, -1] - faces[FACES.index(right), :, 0]).max()
        assert across <= within
    for cap, row in (("+z", -1), ("-z", 0)):
        joined = faces[FACES.index("+x"), 0 if cap == "+z" else -1]
        assert np.abs(faces[FACES.index(cap), row] - joined).max() <= within


def test_back_to_a_panorama():
    image = panorama(32)
    faces = to_cubemap(image, 64)
    back = to_latlong(faces, 32)
    np.testing.assert_allclose(flux(back), flux(image), rtol=1e-4)
    np.testing.assert_allclose(to_latlong(np.full((6, 8, 8, 3), 0.3, np.float32), 16), 0.3, rtol=1e-4)
