"""Frames with a guide have the mean of frames without, and less noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gibench.rendering.camera import PinholeCamera
from gibench.rendering.guiding.learning import DIRECTIONS_PAY, LOOKS
from gibench.rendering.render import render_frame
from gibench.rendering.scene import GUIDED, load_dict
from tests.rendering import scenes, test_portals

SIDE = 16

INDEPENDENT = 1020
"""Samples a pixel, 255 independent groups of 4."""

LEARNING, SUMS = "gibench.rendering.guiding.learning", "gibench.rendering.guiding.sums"


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """A guide from few paths, which is as unbiased as any, and chooses directions wherever it is."""
    monkeypatch.setattr(LEARNING + ".LANES", 1 << 14)
    monkeypatch.setattr(LEARNING + ".DIRECTIONS_PAY", -1.0)
    monkeypatch.setattr(LEARNING + ".LOOKS", 1 << 16)


def many_lamps():
    """The box with a thousand lamps, most of them behind its back wall."""
    scene = scenes.box("coat")
    rng = np.random.default_rng(0)
    for number in range(1000):
        centre = [*rng.uniform(-0.9, 0.9, 1), *rng.uniform(-0.9, 4, 1), *rng.uniform(1.2, 1.9, 1)]
        scene[f"lamp_{number:04}"] = {
            "type": "sphere",
            "center": centre,
            "radius": 0.01,
            "bsdf": {"type": "ref", "id": "wall"},
            "emitter": scenes.area(2.0 + number % 7, 2, 1),
        }
    return scene


def dark(description):
    """Without its lamp, and with a faint sky."""
    scene = {name: value for name, value in description.items() if name != "lamp"}
    return scene | {"sky": {"type": "constant", "radiance": scenes.rgb(0.1)}}


def near_mirror():
    scene = scenes.box("coat")
    scene["subject"] = {
        **scenes.two_sided(
            type="roughplastic",
            alpha=1e-3,
            distribution="ggx",
            int_ior=1.5,
            diffuse_reflectance=scenes.rgb(0.3),
        ),
        "id": "subject",
    }
    return scene


def point_lamp():
    scene = scenes.box("diffuse")
    scene["spot"] = {"type": "point", "position": [0.3, -0.2, 1.4], "intensity": scenes.rgb(1.0)}
    return scene


def covered(material):
    """The box with a floor and a sphere of a material that Mitsuba has and rooms do not."""
    return {**scenes.box("coat"), "subject": {**COVERINGS[material], "id": "subject"}}


GREY = {"type": "diffuse", "reflectance": scenes.rgb(0.5)}
METAL = {"type": "roughconductor", "alpha": 0.2, "distribution": "ggx"}

COVERINGS = {
    "plastic": scenes.two_sided(type="plastic", diffuse_reflectance=scenes.rgb(0.4)),
    "principled": {"type": "principled", "base_color": scenes.rgb(0.5), "roughness": 0.3, "clearcoat": 0.5},
    "thin": {"type": "principledthin", "base_color": scenes.rgb(0.5), "roughness": 0.3, "diff_trans": 0.6},
    "blend": {"type": "twosided", "of": {"type": "blendbsdf", "weight": 0.4, "grey": GREY, "metal": METAL}},
    "mask": {"type": "mask", "opacity": 0.6, "of": {"type": "twosided", "of": GREY}},
    "normal map": {
        "type": "twosided",
        "of": {
            "type": "normalmap",
            "normalmap": {"type": "rgb", "value": [0.6, 0.45, 0.95]},
            "of": GREY,
        },
    },
}


SCENES = {
    **{name: lambda name=name: load_dict(covered(name)) for name in COVERINGS},
    "coat": lambda: load_dict(scenes.box("coat")),
    "metal": lambda: load_dict(scenes.box("metal")),
    "mirror": lambda: load_dict(scenes.box("mirror")),
    "near-mirror": lambda: load_dict(near_mirror()),
    "point lamp": lambda: load_dict(point_lamp()),
    "sky alone": lambda: load_dict(dark(scenes.box("coat"))),
    "portals": lambda: replace(load_dict(test_portals.room()), openings=test_portals.OPENINGS_OF_ROOM),
}


def frame(scene, camera=scenes.CAMERA, **options):
    given = {
        "resolution": (SIDE, SIDE),
        "channels": ["radiance"],
        "spp": INDEPENDENT,
        "max_depth": 6,
    } | options
    return render_frame(scene, camera, **given).arrays


def z_score_of_means(one, other):
    """The difference of the means of two frames in standard errors.

    The mean of the z-scores of pixels has a bias where samples are skewed: a pixel that misses what is rare is too dark
    and claims too small an error.
    """
    errors = [frame["color_se"][..., 1].astype(float) for frame in (one, other)]
    difference = one["color"][..., 1].astype(float) - other["color"][..., 1]
    return difference.sum() / np.sqrt(np.square(errors).sum())


def z_scores(one, other):
    """Differences of two frames in standard errors, green alone, where either has any."""
    error = np.hypot(one["color_se"][..., 1].astype(float), other["color_se"][..., 1])
    difference = one["color"][..., 1].astype(float) - other["color"][..., 1]
    assert (difference[error == 0] == 0).all()
    return difference[error > 0] / error[error > 0]


@pytest.mark.parametrize(
    ("name", "directions"), [*((name, True) for name in SCENES), ("coat", False), ("portals", False)]
)
def test_same_mean(name, directions, monkeypatch):
    monkeypatch.setattr(LEARNING + ".DIRECTIONS_PAY", -1.0 if directions else 1.0)
    plain = SCENES[name]()
    camera = PinholeCamera((0.0, -0.8, 1.0), (0.3, 1.0, 0.8), 1.2) if name == "portals" else scenes.CAMERA
    guided = replace(plain, sampling=GUIDED)
    assert guided.guide.directions == directions
    # Of the lamp in a mirror a thousand plain paths find so little that their errors say less than there is.
    spp = 64 * INDEPENDENT if name == "mirror" else INDEPENDENT
    one, other = frame(guided, camera, seed=1, spp=spp), frame(plain, camera, seed=2, spp=spp)
    z = z_scores(one, other)
    assert abs(z_score_of_means(one, other)) < 4
    # Also the errors are what they say, on both sides.
    assert abs(z.std() - 1) < 3.4 / np.sqrt(2 * len(z))
    assert np.abs(z).max() < 6


def test_a_thousand_lamps():
    """Few samples find such a lamp, so scores by errors of single frames are skewed: frames tell their own spread."""
    plain = load_dict(many_lamps())
    guided = replace(plain, sampling=GUIDED)
    count, found = 12, []
    for scene, first in ((guided, 0), (plain, 100)):
        frames = [frame(scene, seed=first + s, resolution=(8, 8), spp=252) for s in range(count)]
        color = np.array([one["color"][..., 1] for one in frames], dtype=float)
        claimed = np.mean([np.square(one["color_se"][..., 1].astype(float)) for one in frames])
        assert 0.6 < claimed / color.var(axis=0, ddof=1).mean() < 1.6
        means = color.mean(axis=(1, 2))
        found.append((means.mean(), means.var(ddof=1) / count))
    (one, error), (other, other_error) = found
    assert abs(one - other) < 4.5 * np.sqrt(error + other_error)


@pytest.mark.parametrize("bounced", [1e-6, 1e6, 0.0, "any"])
def test_expectations_change_no_mean(bounced, monkeypatch):
    """Roulette by expectations that are far too low, far too high, none, or wrong in every place by another factor."""

    def reflected(sums):
        if bounced == "any":
            return tuple(10 ** np.random.default_rng(0).uniform(-3, 3, (2, len(sums.sent))))
        return np.ones(len(sums.sent)), np.full(len(sums.sent), bounced)

    monkeypatch.setattr(SUMS + ".Sums._reflected", reflected)
    plain = load_dict(scenes.box("coat"))
    one, other = frame(replace(plain, sampling=GUIDED), seed=1), frame(plain, seed=2)
    assert abs(z_score_of_means(one, other)) < 4
    assert np.abs(z_scores(one, other)).max() < 6


def test_how_likely_a_path_is_followed():
    import drjit as dr
    import mitsuba as mi

    from gibench.rendering.guiding.guide import LEAST, WORTH

    scene = replace(load_dict(scenes.box("diffuse")), sampling=GUIDED)
    guide = scene.guide
    guide._bounced = mi.Float([0, 1, 0.5, 0.25, 1, 1])
    throughput = mi.Float([1, 0.5, 0.5 * WORTH, 1e-9, 1, 1e38])
    # The last is no denormal: a process may flush those to 0, as its libraries have set it.
    reflected = mi.Float([1, 0.5, 0.5, 0.5, 0, 2e-38])
    found = guide.survival(dr.arange(mi.UInt32, 6), throughput, reflected, mi.Bool(True))
    np.testing.assert_allclose(found, [0, 1, 0.5, LEAST, 0, 1], rtol=1e-6)


def test_parts_have_the_same_means():
    plain = load_dict(near_mirror())
    guided = replace(plain, sampling=GUIDED)
    names = ["direct_diffuse", "direct_specular", "indirect_diffuse", "indirect_specular"]

    def means(scene, first):
        frames = [frame(scene, seed=first + s, spp=256, channels=names) for s in range(8)]
        return np.array([[f[n].mean(dtype=float) for n in names] for f in frames])

    one, other = means(guided, 0), means(plain, 100)
    error = np.sqrt((one.var(axis=0, ddof=1) + other.var(axis=0, ddof=1)) / 8)
    assert (np.abs(one.mean(axis=0) - other.mean(axis=0)) < 4.5 * error).all()


def test_closed_furnace():
    """All that shines and reflects alike: every pixel of a converged frame is the closed form."""
    from gibench.stress.scenes import closed_answer, closed_box
    from gibench.stress.views import INSIDE

    scene = replace(load_dict(closed_box(0.6, 1.0)), sampling=GUIDED)
    got = frame(scene, INSIDE, max_depth=4)
    error = got["color_se"].astype(float)
    z = (got["color"] - closed_answer(0.6, 1.0, 4))[error > 0] / error[error > 0]
    assert abs(z.mean()) < 4 / np.sqrt(len(z) / 3)
    np.testing.assert_allclose(got["color"].mean(), closed_answer(0.6, 1.0, 4), rtol=0.01)


def test_a_guide_of_one_path_is_unbiased(monkeypatch):
    monkeypatch.setattr(LEARNING + ".LANES", 1)
    monkeypatch.setattr(LEARNING + ".PASSES", 1)
    monkeypatch.setattr(LEARNING + ".LOOKS", 1)
    monkeypatch.setattr(SUMS + ".FEWEST", 1)
    plain = load_dict(scenes.box("coat"))
    z = z_scores(frame(replace(plain, sampling=GUIDED), seed=1), frame(plain, seed=2))
    assert abs(z.mean()) < 4 / np.sqrt(len(z))
    assert np.abs(z).max() < 6


def test_a_guide_out_of_date_is_unbiased():
    """Learned under one lamp, used when another shines in its place."""
    import mitsuba as mi

    description = scenes.box("coat")
    description["other"] = scenes.rectangle(
        [0.95, 0, 1], [-1, 0, 0], (0.2, 0.2), bsdf={"type": "ref", "id": "wall"}, emitter=scenes.area(0.0)
    )
    plain = load_dict(description)
    guided = replace(plain, sampling=GUIDED)
    assert guided.guide is not None
    parameters = mi.traverse(plain.mi_scene)
    parameters["lamp.emitter.radiance.value"] = mi.Color3f(0.0)
    parameters["other.emitter.radiance.value"] = mi.Color3f(9.0)
    parameters.update()
    z = z_scores(frame(guided, seed=1), frame(plain, seed=2))
    assert abs(z.mean()) < 4 / np.sqrt(len(z))
    assert np.abs(z).max() < 6


def test_a_black_room_teaches_nothing_that_does_harm():
    import mitsuba as mi

    plain = load_dict(scenes.box("coat"))
    parameters = mi.traverse(plain.mi_scene)
    parameters["lamp.emitter.radiance.value"] = mi.Color3f(0.0)
    parameters.update()
    guided = replace(plain, sampling=GUIDED)
    assert not frame(guided, spp=16)["color"].any()
    parameters["lamp.emitter.radiance.value"] = mi.Color3f(8.0, 7.0, 6.0)
    parameters.update()
    z = z_scores(frame(guided, seed=1), frame(plain, seed=2))
    assert abs(z.mean()) < 4 / np.sqrt(len(z))


def test_of_what_nothing_is_known_lights_are_drawn_as_mitsuba_draws_them():
    """By their sampling weights: rooms by day send half of their samples to the sky."""
    scene = scenes.box("coat") | {
        "sky": {"type": "constant", "radiance": scenes.rgb(0.1), "sampling_weight": 3.0}
    }
    guide = replace(load_dict(scene), sampling=GUIDED).guide
    np.testing.assert_allclose(np.array(guide._light_probability)[:2], [0.25, 0.75], atol=1e-4)
    for lamp, sky in ((0.0, 1.0), (1.0, 0.0)):
        scene["lamp"]["emitter"]["sampling_weight"], scene["sky"]["sampling_weight"] = lamp, sky
        plain = load_dict(scene)
        z = z_scores(frame(replace(plain, sampling=GUIDED), seed=1), frame(plain, seed=2))
        assert abs(z.mean()) < 4 / np.sqrt(len(z))
        assert np.abs(z).max() < 6


def test_without_a_light_there_is_no_guide():
    description = {name: value for name, value in scenes.box("coat").items() if name != "lamp"}
    scene = replace(load_dict(description), sampling=GUIDED)
    assert scene.guide is None
    assert not frame(scene, spp=4)["color"].any()


def test_a_lamp_behind_a_baffle_has_less_noise(monkeypatch):
    """Light that only second bounces find is what directions of a guide are for; in a furnace there are none."""
    from gibench.stress.scenes import closed_box

    monkeypatch.setattr(LEARNING + ".LANES", 1 << 17)
    monkeypatch.setattr(LEARNING + ".LOOKS", LOOKS)
    monkeypatch.setattr(LEARNING + ".DIRECTIONS_PAY", DIRECTIONS_PAY)
    assert not replace(load_dict(closed_box(0.6, 1.0)), sampling=GUIDED).guide.directions
    description = scenes.box("diffuse")
    description["baffle"] = scenes.rectangle(
        [0, 0, 1.9], [0, 0, -1], (0.4, 0.4), bsdf={"type": "ref", "id": "wall"}
    )
    plain = load_dict(description)

    def variance(scene):
        # Of several frames and without the worst pixels, in which a few paths decide.
        squares = [np.square(frame(scene, seed=seed)["color_se"].astype(float)) for seed in range(4)]
        ordered = np.sort(np.mean(squares, axis=0), axis=None)
        return ordered[: int(0.97 * len(ordered))].mean()

    guided = replace(plain, sampling=GUIDED)
    assert guided.guide.directions
    assert variance(guided) < 0.45 * variance(plain)


def test_a_mesh_without_normals_does_no_harm(tmp_path):
    """Zero vertex normals give a frame of NaN: paths end there, and nothing of it is learned."""
    (tmp_path / "flat.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\n"
        + "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
        + "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "-0.9 0.9 0.4 0 0 0\n0.9 0.9 0.4 0 0 0\n0 0.8 1.6 0 0 0\n3 0 1 2\n"
    )
    scene = scenes.box("diffuse")
    scene["flat"] = {
        "type": "ply",
        "filename": str(tmp_path / "flat.ply"),
        "bsdf": {"type": "ref", "id": "wall"},
    }
    plain = load_dict(scene)
    guided = replace(plain, sampling=GUIDED)
    assert guided.guide is not None
    one, other = frame(guided, seed=1), frame(plain, seed=2)
    assert np.isfinite(one["color"]).all()
    z = z_scores(one, other)
    assert abs(z.mean()) < 4 / np.sqrt(len(z))


def test_the_guide_leaves_glossy_lobes_alone(monkeypatch):
    """Where the specular lobe alone is asked for, as for glossy probes, frames have its own samples: they are those of
    a guide that chooses no direction."""
    from gibench.rendering.backend import tracing
    from gibench.rendering.integrator import scatter_paths
    from gibench.rendering.sampling import IndependentSampler

    monkeypatch.setattr(SUMS + ".FRACTIONS", (0.4,))
    guided = replace(load_dict(scenes.box("coat")), sampling=GUIDED)

    def densities(lobes):
        import drjit as dr
        import mitsuba as mi

        found = {}

        class Recorder:
            def __getattr__(self, name):
                return lambda *given: None

            def first(self, si, bsdf, scattering, lit, weights, active):
                found["guided"] = scattering.guided & active

        with tracing():
            sampler = IndependentSampler()
            sampler.independent.seed(0, 4096)
            origin = mi.Point3f(0.5, -0.5, 1.5)
            ray = mi.Ray3f(dr.repeat(origin, 4096), mi.Vector3f(0, 0, -1))
            si = guided.mi_scene.ray_intersect(ray)
            scatter_paths(
                guided.mi_scene,
                sampler,
                si,
                si.bsdf(ray),
                mi.Bool(True),
                max_depth=1,
                lobes=lobes,
                guide=guided.guide,
                recorder=Recorder(),
            )
        return np.array(found["guided"]).mean()

    assert densities("specular") == 0
    assert densities("all") > 0.05
    assert densities("diffuse") > 0.05
