"""Daylight through openings: the density is that of the samples, and the image is the same with less noise."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from gibench.rendering.camera import PinholeCamera
from gibench.rendering.render import render_frame
from gibench.rendering.scene import OPENINGS, SceneError, load_dict, load_scene
from tests.rendering.scenes import area, rectangle, rgb, two_sided

# A window of 0.6 m by 0.4 m in the wall at x = 1, and a skylight of 0.5 m by 0.5 m at z = 2.
WINDOW = [[1.0, -0.3, 0.8], [0.0, 0.0, 0.4], [0.0, 0.6, 0.0]]
SKYLIGHT = [[-0.25, -0.25, 2.0], [0.0, 0.5, 0.0], [0.5, 0.0, 0.0]]
OPENINGS_OF_ROOM = np.array([WINDOW, SKYLIGHT])


def room(environment: bool = True) -> dict:
    """A closed room of 2 × 2 × 2 m with the two openings, a lamp, and an uneven sky outside."""
    import mitsuba as mi

    white = two_sided(type="diffuse", reflectance=rgb(0.6))
    sky = np.full((8, 16, 3), 0.5, dtype=np.float32)
    sky[1, 3] = 20.0
    walls = {
        "floor": rectangle([0, 0, 0], [0, 0, 1], (1, 1), bsdf=white),
        "north": rectangle([0, 1, 1], [0, -1, 0], (1, 1), bsdf=white),
        "south": rectangle([0, -1, 1], [0, 1, 0], (1, 1), bsdf=white),
        "west": rectangle([-1, 0, 1], [1, 0, 0], (1, 1), bsdf=white),
        "lamp": rectangle([0, 0.6, 1.9], [0, 0, -1], (0.1, 0.1), bsdf=white, emitter=area(3)),
    }
    # Walls with holes, as frames of four rectangles each; `half` is along (y, z) at x = 1 and (x, y) at z = 2.
    for name, centre, half in (
        ("low", [1, 0, 0.4], (0.4, 1)),
        ("high", [1, 0, 1.6], (0.4, 1)),
        ("left", [1, -0.65, 1], (0.2, 0.35)),
        ("right", [1, 0.65, 1], (0.2, 0.35)),
    ):
        walls[name] = _plate(centre, [-1, 0, 0], [0, half[1], half[0]], white)
    for name, centre, half in (
        ("top_a", [-0.625, 0, 2], (0.375, 1)),
        ("top_b", [0.625, 0, 2], (0.375, 1)),
        ("top_c", [0, -0.625, 2], (0.25, 0.375)),
        ("top_d", [0, 0.625, 2], (0.25, 0.375)),
    ):
        walls[name] = _plate(centre, [0, 0, -1], [half[0], half[1], 0], white)
    scene = {"type": "scene", **walls}
    if environment:
        scene["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(sky)}
    return scene


def _plate(centre, normal, half, bsdf):
    """A thin box, so that no two conventions about a rectangle's axes need agree."""
    import mitsuba as mi

    half = [h if h else 1e-4 for h in half]
    to_world = mi.ScalarTransform4f().translate(centre).scale(half)
    return {"type": "cube", "to_world": to_world, "bsdf": bsdf}


CAMERA = PinholeCamera((-0.9, -0.9, 1.5), (0.4, 0.4, 0.5), np.radians(80))


def solid_angle(point, rectangle_):
    """Of a rectangle from a point in front of it, by Van Oosterom and Strackee's formula for two triangles."""
    corner, u, v = (np.array(x) for x in rectangle_)
    total = 0.0
    for triangle in ((corner, corner + u, corner + u + v), (corner, corner + u + v, corner + v)):
        a, b, c = (p - point for p in triangle)
        la, lb, lc = (np.linalg.norm(p) for p in (a, b, c))
        over = abs(a @ np.cross(b, c))
        under = la * lb * lc + (a @ b) * lc + (a @ c) * lb + (b @ c) * la
        total += 2 * np.arctan2(over, under)
    return total


def portals_at(point, rectangles, lanes=1 << 16):
    import drjit as dr
    import mitsuba as mi

    from gibench.rendering.portals import Portals

    portals = Portals(load_dict(room()).mi_scene, np.array(rectangles))
    rng = np.random.default_rng(0)
    u = mi.Point2f(rng.random((2, lanes), dtype=np.float32))
    where = dr.zeros(mi.Point3f, lanes) + mi.Point3f([float(c) for c in point])
    direction = portals.sample(where, u)
    density = portals.density(where, direction)
    return np.array(direction).T, np.array(density), portals


@pytest.mark.parametrize("rectangles", [[WINDOW], [SKYLIGHT], [WINDOW, SKYLIGHT], [WINDOW] * 3])
def test_inverse_density_averages_to_the_solid_angle(rectangles):
    point = np.array([0.2, -0.1, 0.7])
    direction, density, _ = portals_at(point, rectangles)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, atol=1e-5)
    distinct = {json.dumps(r): r for r in rectangles}.values()
    expected = sum(solid_angle(point, r) for r in distinct)
    inverse = 1 / density
    assert abs(inverse.mean() - expected) < 4 * inverse.std() / np.sqrt(len(inverse)) + 1e-5 * expected


def test_samples_pass_through_an_opening_in_proportion_to_its_area():
    point = np.array([0.0, 0.1, 0.9])
    direction, _, _ = portals_at(point, [WINDOW, SKYLIGHT])
    with np.errstate(divide="ignore"):
        at_window = point + direction * ((1 - point[0]) / direction[:, :1])
        at_skylight = point + direction * ((2 - point[2]) / direction[:, 2:])
    eps = 1e-4
    through_window = (direction[:, 0] > 0) & (abs(at_window[:, 1]) < 0.3 + eps)
    through_window &= abs(at_window[:, 2] - 1) < 0.2 + eps
    through_skylight = (direction[:, 2] > 0) & (abs(at_skylight[:, :2]) < 0.25 + eps).all(axis=1)
    assert (through_window | through_skylight).all()
    share = 0.24 / (0.24 + 0.25)
    assert abs(through_window.mean() - share) < 4 * np.sqrt(share * (1 - share) / len(direction))


def test_behind_or_in_the_plane_of_a_portal_there_is_nothing_to_sample():
    for point in ((1.5, 0.0, 1.0), (1.0, 2.0, 1.0)):
        direction, density, _ = portals_at(point, [WINDOW], lanes=256)
        assert not direction.any()
        assert not density.any()


def test_a_degenerate_portal_is_never_chosen():
    flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]
    point = np.array([0.2, -0.1, 0.7])
    direction, density, _ = portals_at(point, [flat, WINDOW])
    expected, expected_density, _ = portals_at(point, [WINDOW])
    np.testing.assert_allclose(direction, expected, atol=1e-6)
    np.testing.assert_allclose(density, expected_density, rtol=1e-5)


@pytest.mark.parametrize("max_depth", [1, 6])
def test_the_image_is_the_same_with_less_noise(max_depth):
    scene = load_dict(room())
    frames = [
        render_frame(
            s, CAMERA, resolution=(32, 24), spp=1024, seed=seed, max_depth=max_depth, channels=("radiance",)
        )
        for seed, s in enumerate((scene, replace(scene, openings=OPENINGS_OF_ROOM)))
    ]
    plain, portal = (f.arrays for f in frames)
    spread = np.sqrt(plain["color_se"] ** 2 + portal["color_se"] ** 2)
    deviation = (plain["color"] - portal["color"]) / np.maximum(spread, 1e-6)
    # Student's t with the 15 degrees of freedom of the plain image exceeds 5 once in 6000 times; the mean over the
    # frame is the sharper test, which a bias of a thousandth would move.
    assert np.mean(np.abs(deviation) > 5) < 2e-3
    whole = (plain["color"] - portal["color"]).mean() / (np.sqrt((spread**2).sum()) / spread.size)
    assert abs(whole) < 4
    assert frames[1].median_error < 0.8 * frames[0].median_error


def test_an_opening_that_is_not_listed_still_lets_its_light_in():
    scene = load_dict(room())
    both = [
        render_frame(s, CAMERA, resolution=(16, 12), spp=4096, seed=seed, channels=("color", "color_se"))
        for seed, s in enumerate((scene, replace(scene, openings=np.array([WINDOW]))))
    ]
    (a, b), spread = (
        [f.arrays["color"] for f in both],
        np.sqrt(sum(f.arrays["color_se"] ** 2 for f in both)),
    )
    assert abs((a - b).mean()) < 4 * np.sqrt((spread**2).sum()) / spread.size


def test_without_an_environment_portals_change_no_sample():
    scene = load_dict(room(environment=False))
    images = [
        render_frame(s, CAMERA, resolution=(16, 12), spp=16, channels=("color",)).arrays["color"]
        for s in (scene, replace(scene, openings=OPENINGS_OF_ROOM))
    ]
    np.testing.assert_allclose(*images, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("content", ["no json", "[[1, 2]]", "[[[1,2,3],[1,2,3],[1,2,NaN]]]", '{"a": 1}'])
def test_openings_that_are_none_are_refused_by_name(tmp_path, content):
    file = tmp_path / "scene.xml"
    file.write_text('<scene version="3.0.0"><shape type="sphere" id="a"/></scene>')
    assert load_scene(file).openings is None
    (tmp_path / OPENINGS).write_text(content)
    with pytest.raises(SceneError, match=OPENINGS):
        load_scene(file)
