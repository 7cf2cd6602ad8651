"""The blurred mirror image: exact for mirrors, neutral to even light, and never across the edge of a surface."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines import image_space_gathering as isg
from gibench.baselines.image_space_gathering.gathering import WIDEST, gather, lobe_angle
from gibench.baselines.image_space_gathering.pyramid import LEVELS, Layout, MirrorImage, Pyramid
from gibench.baselines.image_space_gathering.reflectance import directional_albedo
from gibench.baselines.stages import Stages
from gibench.rendering.layers import Layers
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.baselines.glossy_rooms import CAMERA, LIGHTMAP, glossy_room, mirror_image, rendered
from tests.baselines.meshes import diffuse, slab
from tests.baselines.sites import site, view
from tests.rendering import scenes

RESOLUTION = (40, 30)


def test_a_mirror_shows_the_lightmap(tmp_path):
    tint = scenes.two_sided(type="conductor", material="none", specular_reflectance=scenes.rgb(0.8))
    scene = glossy_room(tint)
    where = site(scene, tmp_path)
    found = rendered(isg.METHOD, where, RESOLUTION, rays=4)
    np.testing.assert_allclose(
        found.specular, mirror_image(scene, where, RESOLUTION, 2, 0.8), rtol=2e-3, atol=1e-4
    )


def test_nothing_glossy_is_exactly_nothing(tmp_path):
    scene = glossy_room(diffuse(0.5))
    found = rendered(isg.METHOD, site(scene, tmp_path), RESOLUTION)
    assert not found.specular.any()
    truth = render_frame(scene, CAMERA, resolution=RESOLUTION, channels=["color"], spp=256, denoise=True)
    assert found.color.mean() == pytest.approx(truth.arrays["color"].mean(), rel=0.015)


@pytest.mark.parametrize("material", ["coat", "metal", "mirror"])
def test_even_light_keeps_its_energy(tmp_path, material):
    """A glossy plate under an even sky: the gather changes nothing, so the directional albedo is all there is."""
    scene = load_dict(
        {
            "type": "scene",
            "sky": {"type": "constant", "radiance": scenes.rgb(1.0)},
            "floor": slab([-50, -50, -2], [50, 50, -1], scenes.MATERIALS[material]),
        }
    )
    truth = render_frame(scene, CAMERA, resolution=RESOLUTION, channels=["radiance"], spp=256).arrays
    found = rendered(isg.METHOD, site(scene, tmp_path), RESOLUTION).specular
    wanted = truth["direct_specular"] + truth["indirect_specular"]
    np.testing.assert_allclose(found.mean(axis=(0, 1)), wanted.mean(axis=(0, 1)), rtol=0.025)


def test_rougher_floors_blur_more_and_keep_the_light(tmp_path):
    """The reflection of a room: the sum over the floor barely changes while its contrast goes down."""
    contrast, light = [], []
    for alpha in (0.02, 0.1, 0.3):
        metal = scenes.two_sided(type="roughconductor", material="none", alpha=alpha, distribution="ggx")
        found = rendered(isg.METHOD, site(glossy_room(metal), tmp_path, str(alpha)), (64, 48)).specular[
            30:, 20:60, 0
        ]
        contrast.append(found.std() / found.mean())
        light.append(found.mean())
    assert contrast[0] > contrast[1] > contrast[2]
    assert max(light) < 1.35 * min(light)


def test_frames_follow_the_camera_and_the_knobs(tmp_path):
    scene = glossy_room(scenes.MATERIALS["metal"])
    where = site(scene, tmp_path)
    method = isg.METHOD.load()(isg.METHOD.settings(LIGHTMAP))
    method.prepare(where)
    stages = Stages()
    first = method.render(view(CAMERA, resolution=RESOLUTION), stages).specular
    assert list(stages.seconds) == ["g-buffer", "ray casting", "gather"]
    method.adjust(isg.METHOD.settings(LIGHTMAP | {"taps": 8}))
    coarse = method.render(view(CAMERA, resolution=RESOLUTION), Stages()).specular
    method.adjust(isg.METHOD.settings(LIGHTMAP))
    again = method.render(view(CAMERA, resolution=RESOLUTION), Stages()).specular
    np.testing.assert_array_equal(first, again)
    assert 0 < np.abs(first - coarse).mean() < 0.3 * first.mean()


def image_of(radiance, **parts):
    """A MirrorImage of a wall 1 m away, (H, W, 3), whose reflections are infinitely far; parts: (H, W) or (H, W, 3)."""
    height, width = radiance.shape[:2]
    y, x = np.mgrid[:height, :width]
    values = {
        "radiance": radiance,
        "blur": np.ones((height, width)),
        "position": np.stack([x / width, y / width, np.ones_like(x)], axis=-1),
        "normal": np.tile([0.0, 0.0, -1.0], (height, width, 1)),
        "roughness": np.full((height, width), 0.1),
        "coverage": np.ones((height, width)),
    } | parts
    kinds = {"radiance": mi.Color3f, "position": mi.Point3f, "normal": mi.Normal3f}
    arrays = {}
    for name, value in values.items():
        flat = np.asarray(value, dtype=np.float32).reshape(width * height, -1)
        arrays[name] = kinds[name](np.ascontiguousarray(flat.T)) if name in kinds else mi.Float(flat[:, 0])
    return Pyramid(MirrorImage(**arrays), Layout(width, height))


def gathered(pyramid, focal=100.0, taps=64):
    width, height = pyramid.layout.sizes[0]
    scale, distance = (dr.full(mi.Float, value, width * height) for value in (focal, 1.0))
    return np.array(gather(pyramid, scale, distance, mi.UInt32(taps))).T.reshape(height, width, 3)


def test_gather_neither_adds_nor_loses_even_light():
    found = gathered(image_of(np.full((37, 53, 3), 2.5)))
    np.testing.assert_allclose(found, 2.5, rtol=1e-5)


def test_gather_of_a_spot_keeps_its_energy():
    """However few the taps and however small the lamp: each tap reads all of the area that it stands for."""
    radiance = np.zeros((96, 128, 3))
    radiance[48, 64] = 1000.0
    for taps in (16, 64, 256):
        found = gathered(image_of(radiance), focal=60.0, taps=taps)
        assert found.sum() == pytest.approx(radiance.sum(), rel=0.12)
        assert found.max() < 100


def test_gather_spreads_like_the_lobe():
    """Half of a spot's light lands within the angle that half of the lobe lies in."""
    radiance = np.zeros((128, 128, 3))
    radiance[64, 64] = 1.0
    found = gathered(image_of(radiance), focal=60.0, taps=256)[..., 0]
    y, x = np.mgrid[:128, :128]
    within = np.hypot(x - 64, y - 64) < 60.0 * np.tan(2 * np.arctan(0.1))
    assert found[within].sum() / found.sum() == pytest.approx(0.5, abs=0.08)


@pytest.mark.parametrize("guide", ["normal", "position", "roughness", "coverage"])
def test_gather_stops_at_edges(guide):
    """Left half white, right half black, and one guide tells them apart: nothing runs over."""
    radiance = np.zeros((64, 64, 3))
    radiance[:, :32] = 1.0
    y, x = np.mgrid[:64, :64]
    left = x < 32
    parts = {
        "normal": np.where(left[..., None], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]),
        "position": np.stack([x / 64, y / 64, np.where(left, 1.0, 2.0)], axis=-1),
        "roughness": np.where(left, 0.1, 0.4),
        "coverage": left,
    }
    mixed = gathered(image_of(radiance))
    assert mixed[:, 24:32, 0].mean() < 0.8
    found = gathered(image_of(radiance, **{guide: parts[guide]}))
    np.testing.assert_allclose(found[:, :32], 1.0, atol=0.02)
    np.testing.assert_allclose(found[:, 32:], 0.0, atol=0.02)


def test_pyramid_is_a_mean_at_every_level():
    rng = np.random.default_rng(0)
    radiance, coverage = rng.random((45, 70, 3)), (rng.random((45, 70)) < 0.6).astype(float)
    pyramid = image_of(radiance * coverage[..., None], coverage=coverage)
    values = np.array(pyramid.image.radiance).T
    covered = np.array(pyramid.image.coverage)
    start = 0
    for level, (width, height) in enumerate(pyramid.layout.sizes):
        cells = slice(start, start + width * height)
        start += width * height
        total = (values[cells] * covered[cells, None]).sum(axis=0) * 4**level
        np.testing.assert_allclose(total, (radiance * coverage[..., None]).sum(axis=(0, 1)), rtol=1e-4)
    assert start == len(covered)
    assert len(pyramid.layout.sizes) == LEVELS


@pytest.mark.parametrize("alpha", [0.0, 0.05, 0.3])
def test_lobe_angle_is_a_quantile(alpha):
    """Of half vectors drawn from GGX by another formula, a share u turns the mirror direction by less."""
    u = np.array([0.1, 0.5, 0.8])
    found = np.array([lobe_angle(mi.Float(alpha), mi.Float(float(v)))[0] for v in u])
    rng = np.random.default_rng(0)
    # Slopes of GGX are a bivariate t distribution with two degrees of freedom, divided by √2.
    slopes = (
        rng.normal(size=(200_000, 2)) / np.sqrt(rng.chisquare(2, 200_000) / 2)[:, None] * alpha / np.sqrt(2)
    )
    turns = 2 * np.arctan(np.linalg.norm(slopes, axis=1))
    np.testing.assert_allclose(found, np.minimum(np.quantile(turns, u), WIDEST), rtol=0.02, atol=1e-7)


@pytest.mark.parametrize("material", ["coat", "metal", "mirror"])
@pytest.mark.parametrize("cosine", [1.0, 0.5, 0.15])
def test_directional_albedo_against_many_samples(material, cosine):
    bsdf = mi.load_dict(scenes.MATERIALS[material])
    count = 1 << 17
    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.wi = mi.Vector3f(float(np.sqrt(1 - cosine**2)), 0.0, cosine)
    from gibench.rendering import flags
    from gibench.rendering.lobes import lobes_of

    found = np.array(directional_albedo(Layers([bsdf]), si, bsdf, dr.full(mi.Bool, True, count)))[:, 0]
    rng = np.random.default_rng(0)
    u = mi.Point2f(rng.random((2, count), dtype=np.float32))
    _, weight = bsdf.sample(lobes_of(flags.NOT_DIFFUSE), si, mi.Float(rng.random(count, dtype=np.float32)), u)
    np.testing.assert_allclose(found, np.array(weight).mean(axis=1), rtol=0.025)


@pytest.mark.parametrize("cosine", [1.0, 0.5])
@pytest.mark.parametrize(
    ("material", "tolerance"), [("dielectric", 1e-5), ("thindielectric", 0.06), ("roughdielectric", 0.01)]
)
def test_directional_albedo_of_glass(material, tolerance, cosine):
    """What it reflects alone, by Fresnel's equations: .04 of the light; 64 samples of all lobes are a fifth off."""
    rough = {"alpha": 0.05, "distribution": "ggx"} if material == "roughdielectric" else {}
    bsdf = mi.load_dict({"type": material, "int_ior": 1.5, "ext_ior": 1.0, **rough})
    si = dr.zeros(mi.SurfaceInteraction3f, 1)
    si.wi = mi.Vector3f(float(np.sqrt(1 - cosine**2)), 0.0, cosine)
    found = np.array(directional_albedo(Layers([bsdf]), si, bsdf, dr.full(mi.Bool, True, 1)))[0, 0]
    inside = np.sqrt(1 - (1 - cosine**2) / 1.5**2)
    across = (cosine - 1.5 * inside) / (cosine + 1.5 * inside)
    along = (1.5 * cosine - inside) / (1.5 * cosine + inside)
    face = (across**2 + along**2) / 2
    # A pane has two faces, between which light goes to and fro.
    wanted = 2 * face / (1 + face) if material == "thindielectric" else face
    assert found == pytest.approx(wanted, rel=tolerance)


@pytest.mark.parametrize("opacity", [1.0, 0.7, 0.3])
def test_directional_albedo_of_a_mirror_with_holes(opacity):
    mirror = scenes.two_sided(type="conductor", material="none")
    bsdf = mi.load_dict({"type": "mask", "opacity": opacity, "inside": mirror})
    si = dr.zeros(mi.SurfaceInteraction3f, 1)
    si.wi = mi.Vector3f(0.0, 0.0, 1.0)
    found = np.array(directional_albedo(Layers([bsdf]), si, bsdf, dr.full(mi.Bool, True, 1)))[0, 0]
    assert found == pytest.approx(opacity, abs=1 / 64)
