"""Maps of probes against closed forms and against the reference renderer."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.probes import baking
from gibench.baselines.probes.baking import MAPS, ProbeSettings
from gibench.baselines.probes.errors import ProbeError
from gibench.baselines.probes.mappings import LatLong, Octahedral
from gibench.baselines.probes.maps import load_probes
from gibench.rendering.camera import PinholeCamera, RayGenerator
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.baselines.probes.test_mappings import columns, vectors
from tests.baselines.sites import emitted, lit_box, site, where_rays_leave
from tests.rendering import scenes

MIRROR = {"type": "conductor", "material": "none", "specular_reflectance": scenes.rgb(0.8)}
OCTAHEDRAL = {"width": 48, "height": 48, "mapping": "octahedral"}
START = 1e-3
"""Mitsuba starts secondary rays a little above the surface: 9e-5 of its largest coordinate."""


def settings(**changed):
    return ProbeSettings(**({"count": 8, "width": 32, "height": 16, "spp": 4} | changed))


def texel_directions(probes, x=0.5, y=0.5):
    """Directions of a place in every texel, by default its centre."""
    row, column = np.indices((probes.mapping.height, probes.mapping.width)).reshape(2, -1)
    return columns(probes.mapping.direction(mi.Point2f(mi.Float(column + x), mi.Float(row + y)))).astype(
        float
    )


def seen_from(point, directions):
    """Where rays from a point in `lit_box` end, on which face, its normal, and the same of their mirror rays."""
    hit, face = where_rays_leave(np.tile(point, (len(directions), 1)), directions)
    normal = np.zeros_like(directions)
    normal[np.arange(len(directions)), face[:, 0]] = -face[:, 1]
    mirror = directions - 2 * np.sum(directions * normal, axis=1, keepdims=True) * normal
    return hit, face, normal, *where_rays_leave(hit - 1e-6 * directions, mirror)


def content(probes, name, probe):
    """A map of one probe, (texels, components)."""
    size = probes.mapping.width * probes.mapping.height
    return np.array(probes.arrays[name]).reshape(probes.count, size, -1)[probe].astype(float)


@pytest.fixture(scope="module")
def mirrored(tmp_path_factory):
    """Probes over a mirror, between walls that emit and reflect nothing."""
    return load_dict(lit_box(MIRROR | {"id": "floor_bsdf"})), tmp_path_factory.mktemp("mirrored")


@pytest.mark.parametrize("mapping", ["lat-long", "octahedral"])
def test_over_a_mirror_everything_is_known(mirrored, mapping):
    scene, folder = mirrored
    shape = {"lat-long": (32, 16), "octahedral": (32, 32)}[mapping]
    probes = load_probes(
        site(scene, folder), settings(width=shape[0], height=shape[1], mapping=mapping), tuple(MAPS)
    )
    d = texel_directions(probes)
    for probe in range(probes.count):
        point = columns(probes.position(mi.UInt32(probe)))[0].astype(float)
        hit, face, normal, behind, _ = seen_from(point, d)
        floor = (face == (2, -1)).all(axis=1)
        found = {name: content(probes, name, probe) for name in MAPS}
        np.testing.assert_allclose(found["distance"][:, 0], np.linalg.norm(hit - point, axis=1), rtol=1e-5)
        np.testing.assert_allclose(found["normal"], normal, atol=1e-3)
        np.testing.assert_allclose(found["roughness"][:, 0], np.where(floor, 0, 1), atol=1e-6)
        ids = found["material_id"][:, 0].astype(int)
        assert {scene.materials[i - 1] for i in ids[floor]} == {"floor_bsdf"}
        assert "floor_bsdf" not in {scene.materials[i - 1] for i in ids[~floor]}
        np.testing.assert_allclose(found["reflected_position"], behind, atol=3 * START)
        assert (found["reflected_material_id"] > 0).all()

        # Radiance is the mean over a texel: known where its corners see one face, and that mirrors one face.
        corners = [seen_from(point, texel_directions(probes, x, y)) for x in (0, 1) for y in (0, 1)]
        faces = np.array([corner[1] for corner in corners])
        mirrored = np.array([corner[4] for corner in corners])
        all_floor = (faces == (2, -1)).all(axis=(0, 2))
        no_floor = (faces != (2, -1)).any(axis=2).all(axis=0)
        assert not found["radiance"][no_floor].any()
        known = all_floor & (mirrored == mirrored[0]).all(axis=(0, 2))
        assert known.sum() > 20
        expected = np.array([emitted(*which) for which in mirrored[0][known]])
        np.testing.assert_allclose(found["radiance"][known], 0.8 * expected, rtol=2e-3)


def test_what_a_camera_at_the_probe_sees(tmp_path):
    """The specular channels of the reference renderer along the same directions, to the noise of both."""
    scene = load_dict(scenes.box("metal"))
    probes = load_probes(site(scene, tmp_path), settings(width=128, height=64, spp=256), ("radiance",))
    place = columns(probes.position(mi.UInt32(0)))[0]
    camera = PinholeCamera(tuple(map(float, place)), (0.0, 0.0, 0.2), np.radians(70.0))
    size = (48, 48)
    frame = render_frame(scene, camera, resolution=size, spp=1024, seed=3, channels=["radiance"]).arrays
    expected = frame["direct_specular"] + frame["indirect_specular"]
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    rays = RayGenerator(camera, size).rays(mi.Point2f(mi.Float(x.ravel()), mi.Float(y.ravel())))
    found = columns(probes.bilinear("radiance", mi.UInt32(0), rays.d)).reshape(*size, 3)
    assert expected.mean() > 0.01

    def blocks(image):
        return np.log1p(image).reshape(6, 8, 6, 8, 3).mean(axis=(1, 3))

    # Texels of the probe are three pixels wide, so blocks of eight see nearly the same.
    np.testing.assert_allclose(blocks(found), blocks(expected), atol=0.1 * blocks(expected).max())
    np.testing.assert_allclose(np.log1p(found).mean(), np.log1p(expected).mean(), rtol=0.03)


def test_without_gloss_there_is_nothing(tmp_path):
    scene = load_dict(scenes.closed_box(0.5, 1.0))
    for denoise in (False, True):
        probes = load_probes(site(scene, tmp_path), settings(denoise=denoise), ("radiance",))
        assert not np.array(probes.arrays["radiance"]).any()


def test_light_is_all_that_is_seen(tmp_path):
    """Walls that emit and reflect nothing, a mirror for a floor, and a sky through the open side."""
    description = lit_box(MIRROR)
    del description["wall0+"]
    description["sky"] = {"type": "constant", "radiance": scenes.rgb(7.0)}
    probes = load_probes(
        site(load_dict(description), tmp_path),
        settings(width=32, height=32, mapping="octahedral"),
        ("light",),
    )
    d = texel_directions(probes)
    for probe in range(probes.count):
        point = columns(probes.position(mi.UInt32(probe)))[0].astype(float)
        corners = [seen_from(point, texel_directions(probes, x, y)) for x in (0, 1) for y in (0, 1)]
        faces = np.array([corner[1] for corner in corners])
        mirrored = np.array([corner[4] for corner in corners])
        floor = (faces == (2, -1)).all(axis=2)
        # What a texel sees: another face by way of the floor.
        seen = np.where(floor[..., None], mirrored, faces)
        known = (seen == seen[0]).all(axis=(0, 2)) & (floor == floor[0]).all(axis=0)
        light = {(0, 1): (7.0, 7.0, 7.0)}
        expected = np.array([light.get(tuple(which), (0, 0, 0)) for which in seen[0]])
        inside = ~(seen[0] == (0, 1)).all(axis=1)
        expected[inside] = [emitted(*which) for which in seen[0][inside]]
        expected *= np.where(floor[0], 0.8, 1)[:, None]
        found = content(probes, "light", probe)
        assert known.sum() > 0.6 * len(d)
        np.testing.assert_allclose(found[known], expected[known], rtol=2e-3, atol=1e-6)


def test_misses_hold_zero(tmp_path):
    """A box that is open to one side."""
    scene = load_dict(scenes.box("coat"))
    probes = load_probes(site(scene, tmp_path), settings(), tuple(MAPS))
    missed = np.array(probes.arrays["material_id"]) == 0
    assert missed.any()
    assert not missed.all()
    for name, (_, size, _) in MAPS.items():
        values = np.array(probes.arrays[name]).reshape(-1, size)
        assert np.isfinite(values).all(), name
        # Light is the mean over a texel, of which the centre alone is known to miss.
        assert name in ("radiance", "light") or not values[missed].any(), name
    alone = np.array(probes.arrays["reflected_material_id"]) == 0
    assert not np.array(probes.arrays["reflected_position"]).reshape(-1, 3)[alone].any()


def test_one_bake_serves_all_that_ask_for_the_same(mirrored, tmp_path):
    scene, _ = mirrored
    first = site(scene, tmp_path)
    load_probes(first, settings(), ("radiance",))
    files = {path: path.read_bytes() for path in tmp_path.rglob("*.npy")}
    second = site(scene, tmp_path)
    load_probes(second, settings(), ("radiance", "distance"))
    assert [bake.folder for bake in first.bakes.used] == [bake.folder for bake in second.bakes.used][:2]
    assert {path: path.read_bytes() for path in files} == files
    assert sum(bake.size for bake in second.bakes.used) > sum(bake.size for bake in first.bakes.used)

    again = site(scene, tmp_path / "again")
    load_probes(again, settings(), ("radiance",))
    for path, content in files.items():
        if path.stem in ("radiance", "positions"):
            (same,) = (tmp_path / "again").rglob(f"{path.parent.name}/{path.name}")
            assert same.read_bytes() == content


def test_other_settings_are_other_bakes(mirrored, tmp_path):
    scene, _ = mirrored
    one = site(scene, tmp_path)
    load_probes(one, settings(), ("radiance", "distance"))
    load_probes(one, settings(spp=1), ("radiance", "distance"))  # the surfaces do not depend on the paths
    kinds = [bake.folder for bake in one.bakes.used]
    assert len(kinds) == 4
    load_probes(one, settings(width=16, height=8), ("distance",))
    assert len(one.bakes.used) == 5
    assert all(bake.kind == "probes" for bake in one.bakes.used)


def test_passes_are_bounded_and_fill_everything(mirrored, tmp_path, monkeypatch):
    """With room for 700 paths, passes end in the middle of rows; what is seen does not depend on it."""
    scene, _ = mirrored
    names = ("radiance", "distance", "reflected_position")
    whole = load_probes(site(scene, tmp_path / "a"), settings(), names)
    passes = []

    class Watched(baking.Replay):
        def __call__(self, first, seed, texels):
            passes.append(texels)
            return super().__call__(first, seed, texels)

    monkeypatch.setattr(baking, "LANES", 700)
    monkeypatch.setattr(baking, "Replay", Watched)
    parts = load_probes(site(scene, tmp_path / "b"), settings(), names)
    texels = whole.count * 32 * 16
    assert sum(passes) == 3 * texels  # radiance, visible, reflected
    assert max(passes) <= 700
    assert sum(count <= 700 // 4 for count in passes) >= texels // (700 // 4)
    for name in ("distance", "reflected_position"):
        np.testing.assert_array_equal(np.array(parts.arrays[name]), np.array(whole.arrays[name]))
    # A mirror between walls of one radiance each has noise only where a texel sees two of them.
    one, other = (np.array(p.arrays["radiance"]).astype(float) for p in (whole, parts))
    assert np.mean(np.abs(one - other) < 1e-2) > 0.9


def test_huge_radiance_is_kept_in_single_precision(tmp_path):
    description = lit_box(MIRROR)
    description["wall2+"]["emitter"] = scenes.area(1e6)
    probes = load_probes(site(load_dict(description), tmp_path), settings(), ("radiance",))
    assert type(probes.arrays["radiance"]) is mi.Float
    assert np.array(probes.arrays["radiance"]).max() == pytest.approx(0.8e6, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "shape"), [("radiance", {"width": 64, "height": 32}), ("light", OCTAHEDRAL)]
)
def test_denoising_keeps_the_mean_and_removes_noise(tmp_path, name, shape):
    scene = load_dict(scenes.box("metal"))
    where = site(scene, tmp_path)
    noisy, clean, truth = (
        load_probes(where, settings(count=2, spp=spp, denoise=denoise, **shape), (name,))
        for spp, denoise in ((4, False), (4, True), (1024, False))
    )
    maps = [np.log1p(np.array(p.arrays[name]).astype(float)) for p in (noisy, clean, truth)]
    errors = [np.mean((found - maps[2]) ** 2) for found in maps[:2]]
    assert errors[1] < 0.7 * errors[0]
    assert maps[1].mean() == pytest.approx(maps[2].mean(), rel=0.1)


@pytest.mark.parametrize("mapping", [LatLong(128, 64), Octahedral(64, 64)])
def test_denoising_keeps_light_that_few_paths_find(mapping):
    """The network alone takes such spots for noise and leaves a seventh of the light out."""
    rng = np.random.default_rng(0)
    shape = (mapping.height, mapping.width, 3)
    found = np.where(rng.random((*shape[:2], 1)) < 0.03, rng.gamma(0.5, 20, (*shape[:2], 1)), 0.05)
    samples = (found * [1, 0.9, 0.8]).astype(np.float32)
    guides = {"albedo": np.full(shape, 0.5, np.float32), "normal": np.zeros(shape, np.float32)}
    clean = baking._denoised(samples, guides, mapping)
    np.testing.assert_allclose(clean.mean(axis=(0, 1)), samples.mean(axis=(0, 1)), rtol=0.05)


def test_texels_of_the_same_direction_agree_between_mappings(mirrored, tmp_path):
    scene, _ = mirrored
    found = []
    d = np.random.default_rng(1).normal(size=(256, 3))
    for mapping, width, height in (("lat-long", 64, 32), ("octahedral", 64, 64)):
        probes = load_probes(
            site(scene, tmp_path), settings(mapping=mapping, width=width, height=height), ("distance",)
        )
        found.append(np.array(probes.bilinear("distance", mi.UInt32(1), vectors(d))))
    np.testing.assert_allclose(*found, rtol=0.05)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"mapping": "cube"}, "no mapping 'cube'"),
        ({"width": 33}, "even"),
        ({"height": 0}, "even"),
        ({"spp": 0}, "at least 1"),
        ({"count": 0}, "at least 1"),
    ],
)
def test_settings_that_cannot_be(changed, words):
    with pytest.raises(ProbeError, match=words):
        settings(**changed)
