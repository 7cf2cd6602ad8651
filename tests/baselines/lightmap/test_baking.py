"""What texels hold, against closed forms and the path tracer."""

import mitsuba as mi
import numpy as np
import pytest
import trimesh

from gibench.baselines.lightmap.bake import bake_atlas
from gibench.baselines.lightmap.lookup import Lightmap
from gibench.rendering.scene import load_dict
from tests.baselines.meshes import diffuse, directions, looked_up, ply, room, slab
from tests.rendering import scenes


def baked(scene, texels=16, spp=64, max_depth=8, denoise=False):
    result = bake_atlas(scene, texels_per_metre=texels, spp=spp, denoise=denoise, max_depth=max_depth)
    return Lightmap(scene, result.atlas, result.unwrapping.corners, result.unwrapping.offsets)


def test_white_furnace():
    """Walls that all emit 1 and reflect half: E = π Σ ρ^k, at every place, edges and corners included."""
    reflectance, emitted, depth = 0.5, 1.0, 4
    scene = load_dict({"type": "scene", **room(diffuse(reflectance), emitter=scenes.area(emitted))})
    lightmap = baked(scene, texels=8, spp=256, max_depth=depth)
    rays = directions(4000)
    points, irradiance, radiance = looked_up(lightmap, scene, 0.05 * rays, rays)
    assert np.abs(points).max() < 1.01
    expected = np.pi * emitted * sum(reflectance**k for k in range(depth))
    # Over seeds the mean spreads by 0.15 %, a texel by 4 %.
    assert irradiance.mean() == pytest.approx(expected, rel=0.006)
    assert np.abs(irradiance / expected - 1).max() < 0.2
    np.testing.assert_allclose(radiance, irradiance * reflectance / np.pi, rtol=1e-5)


def test_coat_in_a_furnace():
    """What a rough plastic reflects diffusely of even light, at any view: its lobe integrated numerically."""
    from gibench.rendering import flags
    from gibench.rendering.lobes import lobes_of

    sky = {"type": "constant", "radiance": scenes.rgb(1.0)}
    scene = load_dict(
        {"type": "scene", "sky": sky, "box": slab([-0.5] * 3, [0.5] * 3, scenes.MATERIALS["coat"])}
    )
    lightmap = baked(scene, texels=16, spp=256, max_depth=1)
    towards = np.array([0.8, 0.0, -0.6])
    places = np.column_stack([np.random.default_rng(0).uniform(-0.4, 0.4, (200, 2)), np.full(200, 0.5)])
    _, _, radiance = looked_up(lightmap, scene, places - towards, np.tile(towards, (200, 1)))
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(-0.8, 0, 0.6)
    lights = directions(200_000, 1)
    lights[:, 2] = np.abs(lights[:, 2])
    bsdf = mi.load_dict(scenes.MATERIALS["coat"])
    lobe = np.array(bsdf.eval(lobes_of(flags.DIFFUSE), si, mi.Vector3f(lights.T.astype(np.float32)))).T
    np.testing.assert_allclose(radiance.mean(axis=0), 2 * np.pi * lobe.mean(axis=0), rtol=0.01)


def rectangle_irradiance(point, normal, corners, radiance):
    """Of a point by a polygon that it sees whole: Lambert's formula, the sum over its edges."""
    towards = corners - point
    towards = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    total = np.zeros(3)
    for a, b in zip(towards, np.roll(towards, -1, axis=0), strict=True):
        axis = np.cross(a, b)
        total += np.arccos(np.clip(a @ b, -1, 1)) * axis / np.linalg.norm(axis)
    return 0.5 * radiance * abs(total @ normal)


def test_rectangle_over_a_floor():
    scene = load_dict(
        {
            "type": "scene",
            "floor": slab([-1, -1, -0.1], [1, 1, 0], diffuse(0.3, 0.6, 0.9)),
            "lamp": scenes.rectangle([0.2, 0, 0.8], [0, 0, -1], (0.3, 0.2), emitter=scenes.area(5)),
        }
    )
    lightmap = baked(scene, spp=256, max_depth=1)
    places = np.random.default_rng(0).uniform(-0.9, 0.9, (300, 2))
    origins = np.column_stack([places, np.full(300, 0.1)])
    points, irradiance, radiance = looked_up(lightmap, scene, origins, np.tile([0.0, 0, -1], (300, 1)))
    corners = np.array([[0.2 + x, y, 0.8] for x, y in ((-0.3, -0.2), (0.3, -0.2), (0.3, 0.2), (-0.3, 0.2))])
    expected = np.array([rectangle_irradiance(p, np.array([0, 0, 1.0]), corners, 5.0) for p in points])
    for component in range(3):
        assert np.abs(irradiance[:, component] / expected - 1).max() < 0.05
        assert irradiance[:, component].mean() == pytest.approx(expected.mean(), rel=0.005)
    np.testing.assert_allclose(radiance / irradiance, np.tile([0.3, 0.6, 0.9], (300, 1)) / np.pi, rtol=1e-5)


@pytest.mark.parametrize("shared_floor", [False, True])
def test_a_thin_wall_lets_nothing_through(shared_floor):
    """A lit room and a dark one, 5 mm apart, on floors of their own, or on one where a texel may lie below the wall."""
    white = diffuse(0.8)
    description = {"type": "scene", **room(white)}
    description["between"] = slab([-0.0025, -1.05, -1.05], [0.0025, 1.05, 1.05], white)
    description["lamp"] = scenes.rectangle([0.5, 0, 0.99], [0, 0, -1], (0.2, 0.2), emitter=scenes.area(50))
    if not shared_floor:
        for name in ("wallz-", "wallz+", "wally-", "wally+"):
            del description[name]
        for side, low, high in (("dark", -1.1, 0.0), ("lit", 0.0, 1.1)):
            for axis in (1, 2):
                for sign in (-1, 1):
                    a, b = [low, -1.1, -1.1], [high, 1.1, 1.1]
                    a[axis], b[axis] = sorted((sign * 1.0, sign * 1.1))
                    description[f"{side}{axis}{sign}"] = slab(a, b, white)
    scene = load_dict(description)
    lightmap = baked(scene, texels=16, spp=16)
    rays = directions(20_000)
    dark, irradiance, _ = looked_up(lightmap, scene, np.tile([-0.5, 0.1, 0.0], (len(rays), 1)), rays)
    lit, bright, _ = looked_up(lightmap, scene, np.tile([0.5, 0.1, 0.0], (len(rays), 1)), rays)
    assert bright[lit[:, 2] < 0.98].min() > 0  # above is the lamp, which has no texels
    on_wall = (np.abs(dark[:, 0] + 0.0025) < 1e-4) & (np.abs(dark[:, 1:]).max(axis=1) < 0.999)
    assert on_wall.sum() > 1000
    np.testing.assert_array_equal(irradiance[on_wall], 0)
    # On a shared floor a texel of 1/16 m may lie on both sides, and a lookup reads its neighbours: two texels.
    far = dark[:, 0] < (-2.5 / 16 if shared_floor else np.inf)
    np.testing.assert_array_equal(irradiance[far], 0)
    # Nor does the dark side darken the lit one.
    close = (lit[:, 2] < -0.99) & (lit[:, 0] > 0.003) & (lit[:, 0] < 0.03)
    further = (lit[:, 2] < -0.99) & (lit[:, 0] > 0.1) & (lit[:, 0] < 0.2)
    assert close.sum() > 20
    if not shared_floor:
        assert bright[close].mean() > 0.75 * bright[further].mean()


def test_contact_with_the_floor():
    """A black box stands on a floor under an even sky: next to its foot half of the sky is left, never less.

    Below the box is darkness, which must not come out from under it.
    """
    description = {
        "type": "scene",
        "sky": {"type": "constant", "radiance": scenes.rgb(1.0)},
        "floor": slab([-1, -1, -0.1], [1, 1, 0], diffuse(0.5)),
        "box": slab([-0.31, -0.31, -0.002], [0.31, 0.31, 0.6], diffuse(0.0)),
    }
    scene = load_dict(description)
    lightmap = baked(scene, texels=16, spp=1024, max_depth=1)
    along = np.linspace(-0.9, 0.9, 181)
    for gap in (0.001, 0.01, 0.03, 0.06, 0.12):
        origins = np.column_stack([np.full(181, 0.31 + gap), along, np.full(181, 0.05)])
        _, irradiance, _ = looked_up(lightmap, scene, origins, np.tile([0.0, 0, -1], (181, 1)))
        assert irradiance.min() > 0.5 * np.pi * 0.93
        assert irradiance.max() < np.pi * 1.05
        # From up close the side is a long wall, and what it leaves of the sky has a closed form.
        middle = np.abs(along) < 0.15
        height = 0.6
        open_share = 0.5 * (1 + gap / np.hypot(gap, height))
        assert irradiance[middle].mean() / np.pi == pytest.approx(open_share, abs=0.06)


def test_no_seams_on_a_sphere(tmp_path):
    """Over an endless black floor a sphere's irradiance is π (1 + cos θ) / 2, across all seams of its charts."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.5)
    ball.apply_translation([0, 0, 1.0])
    scene = load_dict(
        {
            "type": "scene",
            "sky": {"type": "constant", "radiance": scenes.rgb(1.0)},
            "ground": slab(
                [-300, -300, -1], [300, 300, 0], scenes.two_sided(type="conductor", specular_reflectance=0.0)
            ),
            "ball": ply(ball, tmp_path / "ball.ply", diffuse(0.5)),
        }
    )
    lightmap = baked(scene, texels=24, spp=256, max_depth=1)
    rays = directions(20_000)
    points, irradiance, _ = looked_up(lightmap, scene, np.array([0, 0, 1.0]) + 0.7 * rays, -rays)
    expected = np.pi * (1 + (points[:, 2] - 1) / 0.5) / 2
    error = irradiance[:, 0] - expected
    assert np.abs(error.mean()) < 0.005 * np.pi
    assert np.sqrt(np.mean(error**2)) < 0.04 * np.pi
    assert np.abs(error).max() < 0.2 * np.pi


def test_texture_comes_back_where_it_is_seen():
    """What is stored is light, not light times texture: a fine checker keeps its contrast and leaves no print."""
    texture = scenes.checker() | {"to_uv": mi.ScalarTransform4f().scale([40, 40, 1])}
    floor = slab([-1, -1, -0.1], [1, 1, 0], scenes.two_sided(type="diffuse", reflectance=texture))
    sky = {"type": "constant", "radiance": scenes.rgb(1.0)}
    scene = load_dict({"type": "scene", "sky": sky, "floor": floor})
    lightmap = baked(scene, texels=8, spp=256, max_depth=1)
    places = np.random.default_rng(1).uniform(-0.95, 0.95, (3000, 2))
    origins = np.column_stack([places, np.ones(3000)])
    _, irradiance, radiance = looked_up(lightmap, scene, origins, np.tile([0.0, 0, -1], (3000, 1)))
    np.testing.assert_allclose(irradiance, np.pi, rtol=0.05)
    reflectance = radiance / irradiance * np.pi
    dark, bright = np.array([0.1, 0.2, 0.5]), np.array([0.8, 0.6, 0.3])
    is_bright = reflectance[:, 0] > 0.4
    assert 0.4 < is_bright.mean() < 0.6
    np.testing.assert_allclose(reflectance, np.where(is_bright[:, None], bright, dark), rtol=1e-4)


def test_black_in_one_component():
    """Where a material is black in one colour, that colour is filled from where it is not, and its product is 0."""
    scene = load_dict(
        {
            "type": "scene",
            "sky": {"type": "constant", "radiance": scenes.rgb(1.0)},
            "floor": slab([-1, -1, -0.1], [1, 1, 0], diffuse(0.7, 0.0, 0.4)),
        }
    )
    lightmap = baked(scene, texels=4, max_depth=1)
    _, irradiance, radiance = looked_up(lightmap, scene, [[0.1, 0.2, 1.0]], [[0, 0, -1.0]])
    np.testing.assert_allclose(irradiance[0, [0, 2]], np.pi, rtol=0.1)
    assert radiance[0, 1] == 0
    assert np.isfinite(irradiance).all()


@pytest.mark.parametrize("material", ["diffuse", "coat", "textured_coat"])
def test_diffuse_lobes_are_products(material):
    """A lobe's value at any view is that along the normal times a factor that no light direction changes."""
    from gibench.rendering import flags
    from gibench.rendering.lobes import lobes_of

    bsdf = mi.load_dict(scenes.MATERIALS[material])
    si = mi.SurfaceInteraction3f()
    count = 500
    si.uv = mi.Point2f(0.3, 0.7)
    views, lights = directions(count, 3), directions(count, 4)
    views[:, 2], lights[:, 2] = np.abs(views[:, 2]) + 0.02, np.abs(lights[:, 2]) + 0.02
    views /= np.linalg.norm(views, axis=1, keepdims=True)
    lights /= np.linalg.norm(lights, axis=1, keepdims=True)

    def lobe(view, light):
        place = mi.SurfaceInteraction3f(si)
        place.wi = mi.Vector3f(np.ascontiguousarray(view.T.astype(np.float32)))
        light = mi.Vector3f(np.ascontiguousarray(light.T.astype(np.float32)))
        return np.array(bsdf.eval(lobes_of(flags.DIFFUSE), place, light)).T

    up = np.tile([0.0, 0.0, 1.0], (count, 1))
    np.testing.assert_allclose(
        lobe(views, lights) * lobe(up, up), lobe(views, up) * lobe(up, lights), rtol=2e-4
    )


def test_denoising_keeps_the_light():
    """The filter takes noise away and leaves the mean."""
    scene = load_dict(
        {
            "type": "scene",
            **room(diffuse(0.6)),
            "lamp": scenes.rectangle([0.2, 0, 0.98], [0, 0, -1], (0.2, 0.2), emitter=scenes.area(10)),
        }
    )
    rays = directions(4000)
    rough, smooth, fine = (
        looked_up(baked(scene, 8, spp, denoise=denoise), scene, 0.1 * rays, rays)[1]
        for spp, denoise in ((16, False), (16, True), (1024, False))
    )
    assert smooth.mean() == pytest.approx(fine.mean(), rel=0.02)
    assert np.sqrt(np.mean((smooth - fine) ** 2)) < 0.7 * np.sqrt(np.mean((rough - fine) ** 2))
