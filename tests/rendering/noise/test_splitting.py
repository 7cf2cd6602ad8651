"""The variance of a frame, split: the rows are those of the frame, of closed forms, of the light that makes them."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from scipy.ndimage import uniform_filter

from gibench.rendering.estimate import EstimateError
from gibench.rendering.noise.splitting import AROUND, DARK, split_noise
from gibench.rendering.render import render_frame
from gibench.rendering.scene import GUIDED, load_dict
from gibench.stress import views
from tests.rendering import scenes, test_portals

LEARNING = "gibench.rendering.guiding.learning"


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(LEARNING + ".LANES", 1 << 13)
    monkeypatch.setattr(LEARNING + ".LOOKS", 1 << 15)
    monkeypatch.setattr(LEARNING + ".DIRECTIONS_PAY", -1.0)


def frame(scene, camera=scenes.CAMERA, **options):
    return render_frame(scene, camera, channels=["radiance"], **options).arrays


def relative_variance(arrays):
    mean = arrays["color"].astype(float)
    around = uniform_filter(mean, size=(AROUND, AROUND, 1), mode="nearest")
    return (
        np.square(arrays["color_se"].astype(float)) / (np.square(around) + DARK * mean.mean() ** 2)
    ).mean()


def light(split, *names):
    return sum(term.light for term in split.terms if term.name in names)


def test_it_is_the_frame_that_is_split():
    """The same samples: variance and parts equal those of `render_frame`."""
    scene = load_dict(scenes.box("coat"))
    options = {"resolution": (24, 16), "spp": 128, "seed": 5, "max_depth": 4}
    noise, arrays = split_noise(scene, scenes.CAMERA, **options), frame(scene, **options)
    np.testing.assert_allclose(noise.mean, arrays["color"].mean((0, 1), dtype=float), rtol=1e-5)
    np.testing.assert_allclose(noise.variance, relative_variance(arrays), rtol=1e-4)

    def share(*names):
        return sum(arrays[n].mean(dtype=float) for n in names) / arrays["color"].mean(dtype=float)

    depth, lobe = noise.splits["depth"], noise.splits["lobe"]
    np.testing.assert_allclose(light(depth, "0"), share("emission"), rtol=1e-4)
    np.testing.assert_allclose(light(depth, "1"), share("direct_diffuse", "direct_specular"), rtol=1e-4)
    indirect = share("indirect_diffuse", "indirect_specular")
    np.testing.assert_allclose(light(depth, "2", "3", "4"), indirect, rtol=1e-4)
    np.testing.assert_allclose(
        light(lobe, "specular"), share("direct_specular", "indirect_specular"), rtol=1e-4
    )
    for split in noise.splits.values():
        np.testing.assert_allclose(sum(term.light for term in split.terms), 1, rtol=1e-5)
        whole = sum(term.variance for term in split.terms) + split.covariance
        np.testing.assert_allclose(whole, noise.variance, rtol=1e-6)


def test_a_frame_of_many_blocks_is_split_too(monkeypatch):
    """Blocks have seeds of their own, so it is another frame than that of `render_frame`, with its mean and noise."""
    monkeypatch.setattr("gibench.rendering.noise.splitting.LANES", 1 << 12)
    scene = load_dict(scenes.box("coat"))
    options = {"resolution": (24, 16), "spp": 128, "max_depth": 4}
    variances, means = [], []
    for seed in range(6):
        noise = split_noise(scene, scenes.CAMERA, seed=seed, **options)
        for split in noise.splits.values():
            whole = sum(term.variance for term in split.terms) + split.covariance
            np.testing.assert_allclose(whole, noise.variance, rtol=1e-6)
        variances.append(noise.variance)
        means.append(noise.mean)
    frames = [frame(scene, seed=100 + seed, **options) for seed in range(6)]
    theirs = [arrays["color"].mean((0, 1), dtype=float) for arrays in frames]
    error = np.sqrt((np.var(means, axis=0, ddof=1) + np.var(theirs, axis=0, ddof=1)) / 6)
    assert (np.abs(np.mean(means, axis=0) - np.mean(theirs, axis=0)) < 5 * error).all()
    theirs = [relative_variance(arrays) for arrays in frames]
    error = np.sqrt((np.var(variances, ddof=1) + np.var(theirs, ddof=1)) / 6)
    assert abs(np.mean(variances) - np.mean(theirs)) < 5 * error


@pytest.mark.parametrize("name", ["guided", "portals"])
def test_guided_paths_and_portals_are_split_too(name, quick):
    if name == "guided":
        scene, camera = replace(load_dict(scenes.box("metal")), sampling=GUIDED), scenes.CAMERA
    else:
        openings = test_portals.OPENINGS_OF_ROOM
        scene, camera = replace(load_dict(test_portals.room()), openings=openings), test_portals.CAMERA
    options = {"resolution": (16, 16), "spp": 64, "max_depth": 5}
    noise = split_noise(scene, camera, **options)
    np.testing.assert_allclose(noise.variance, relative_variance(frame(scene, camera, **options)), rtol=1e-4)
    technique = noise.splits["technique"]
    assert light(technique, "guide" if name == "guided" else "portals") > 0
    assert light(technique, "portals" if name == "guided" else "guide") == 0


def lambertian_under_sky(albedo):
    """A plane of one colour under a constant sky, direct light: (mean, variances of a light and of a BSDF sample).

    A direction of the sphere has density 1/4π, one of the lobe cos/π; weights by the power heuristic.
    """
    cosine = (np.arange(200_000) + 0.5) / 200_000
    by_light, by_lobe = np.full_like(cosine, 1 / (4 * np.pi)), cosine / np.pi
    reflected = albedo / np.pi * cosine
    weight = by_light**2 / (by_light**2 + by_lobe**2)
    around = 2 * np.pi
    moments = [
        [around * np.mean((reflected * share / density) ** k * density) for k in (1, 2)]
        for share, density in ((weight, by_light), (1 - weight, by_lobe))
    ]
    mean = moments[0][0] + moments[1][0]
    np.testing.assert_allclose(mean, albedo, rtol=1e-4)
    return mean, [second - first**2 for first, second in moments]


def test_one_light_and_a_lambertian_plane_are_the_closed_form():
    scene = load_dict(
        {
            "type": "scene",
            "light": {"type": "constant", "radiance": scenes.rgb(1.0)},
            "floor": scenes.rectangle(
                [0, 0, 0], [0, 0, 1], (50, 50), bsdf={"type": "diffuse", "reflectance": 0.5}
            ),
        }
    )
    spp = 255  # no multiple of 4: independent samples
    noise = split_noise(scene, views.spot(30), resolution=(32, 32), spp=spp, max_depth=1)
    mean, expected = lambertian_under_sky(0.5)
    scale = mean**2 * (1 + DARK) * spp
    found = {term.name: term.variance for term in noise.splits["technique"].terms}
    # 1024 pixels of 254 degrees of freedom.
    np.testing.assert_allclose(found["light sampling"], expected[0] / scale, rtol=0.02)
    np.testing.assert_allclose(found["BSDF sampling"], expected[1] / scale, rtol=0.02)
    np.testing.assert_allclose(noise.variance, sum(expected) / scale, rtol=0.02)
    assert abs(noise.splits["technique"].covariance) < 0.02 * noise.variance
    # A grey light and grey plane: the one lobe, the one depth and the one light hold all of it.
    for axis in ("depth", "lobe", "light"):
        assert max(term.variance for term in noise.splits[axis].terms) == pytest.approx(noise.variance)


def test_the_lamp_that_makes_the_noise_is_blamed():
    """A bright lamp in an opaque shade, of which second bounces alone find any light, beside a dim lamp in the open."""
    wall = {"type": "ref", "id": "wall"}
    description = scenes.box("diffuse")
    description["shade"] = scenes.rectangle([0.5, 0, 1.0], [0, 0, -1], (0.06, 0.06), bsdf=wall)
    description["shaded"] = {
        "type": "sphere",
        "center": [0.5, 0, 1.03],
        "radius": 0.015,
        "bsdf": wall,
        "emitter": scenes.area(300.0),
    }
    scene = load_dict(description)
    noise = split_noise(scene, scenes.CAMERA, resolution=(16, 16), spp=256, max_depth=4)
    terms = {term.name: term for term in noise.splits["light"].terms}
    assert set(terms) == {"lamp", "shaded"}
    assert terms["shaded"].variance > 0.7 * noise.variance
    # Each lamp's light is that of a frame with it alone.
    import mitsuba as mi

    parameters = mi.traverse(scene.mi_scene)
    parameters["shaded.emitter.radiance.value"] = mi.Color3f(0.0)
    parameters.update()
    alone = frame(scene, resolution=(16, 16), spp=1024, max_depth=4)["color"].mean(dtype=float)
    assert terms["lamp"].light * np.mean(noise.mean) == pytest.approx(alone, rel=0.03)


def test_the_worst_paths_lie_where_they_say():
    scene = load_dict(scenes.box("coat"))
    noise = split_noise(scene, scenes.CAMERA, resolution=(24, 16), spp=64, max_depth=5, paths=40)
    assert len(noise.paths) == 40
    assert len({path.pixel for path in noise.paths}) == 40
    planes = {
        "floor": (2, 0),
        "ceiling": (2, 2),
        "back": (1, 1),
        "left": (0, -1),
        "right": (0, 1),
        "lamp": (2, 1.95),
    }
    materials = {"floor": "subject", "ball": "subject", "extra_metal": "extra_metal_material"}
    bounced = [path for path in noise.paths if path.depth > 1]
    assert bounced
    for path in noise.paths:
        assert len(path.vertices) == path.depth
        assert (path.technique == "seen straight") == (path.depth == 0)
        assert path.light == "lamp"
        assert path.contribution > 1
        for vertex in path.vertices:
            if vertex.shape in planes:
                axis, at = planes[vertex.shape]
                assert vertex.position[axis] == pytest.approx(at, abs=1e-4)
            assert vertex.material == materials.get(vertex.shape, vertex.material)
    assert sum(path.pixel_share for path in noise.paths) < 1


def test_black_and_noiseless_scenes_are_zero():
    dark = {name: thing for name, thing in scenes.box("diffuse").items() if name != "lamp"}
    noise = split_noise(load_dict(dark), scenes.CAMERA, resolution=(8, 8), spp=16)
    assert (noise.variance, noise.noisiest, noise.paths, noise.mean) == (0, 0, (), (0, 0, 0))
    json.dumps(asdict(noise), allow_nan=False)
    # A lamp that fills the frame is seen without noise; no path is scattered at all.
    lamp = {
        "type": "scene",
        "lamp": scenes.rectangle([0, 0, 0], [0, 0, 1], (50, 50), emitter=scenes.area(2.0)),
    }
    noise = split_noise(load_dict(lamp), views.spot(20), resolution=(8, 8), spp=16, max_depth=0)
    assert noise.mean == (2, 2, 2)
    assert noise.variance == 0
    json.dumps(asdict(noise), allow_nan=False)


def test_numbers_out_of_range_are_refused():
    scene = load_dict(scenes.furnace({"type": "diffuse"}))
    with pytest.raises(EstimateError, match="at least 2"):
        split_noise(scene, scenes.CAMERA, resolution=(8, 8), spp=1)
    with pytest.raises(EstimateError, match="max_depth"):
        split_noise(scene, scenes.CAMERA, resolution=(8, 8), max_depth=-1)
    with pytest.raises(EstimateError, match="at most"):
        split_noise(scene, scenes.CAMERA, resolution=(8192, 8192))
