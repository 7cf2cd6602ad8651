"""Frames of `ltc-direct`, against the path tracer's direct light."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gibench.baselines.linearly_transformed_cosines import METHOD
from gibench.baselines.linearly_transformed_cosines.implementation import AnalyticLight, RectangleLight
from gibench.baselines.method import MethodError, View
from gibench.baselines.stages import Stages
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.channels import CUES
from gibench.rendering.light_rig import LightRig
from gibench.rendering.lighting import AreaLight, Lighting, Shot
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.baselines.material_strips import CAMERA, strips_rig
from tests.baselines.sites import site
from tests.rendering import scenes

RESOLUTION = (40, 32)
ABOVE = PinholeCamera((0.0, -2.4, 1.2), (0.0, 0.0, 0.0), np.radians(40.0))


@pytest.fixture(scope="module")
def rig():
    return strips_rig()


@pytest.fixture(scope="module")
def method(rig, tmp_path_factory):
    running = AnalyticLight(METHOD.settings({"rays": 4}))
    running.prepare(site(rig.scene, tmp_path_factory.mktemp("ltc")))
    return running


def frame(rig, method, light, seed=0):
    rig.set(Lighting(area=light))
    return method.render(View(Shot(CAMERA, Lighting(area=light)), None, RESOLUTION, 0, seed), Stages())


def reference(rig, light, spp=256):
    rig.set(Lighting(area=light))
    names = ("emission", "direct_diffuse", "direct_specular")
    found = render_frame(rig.scene, CAMERA, resolution=RESOLUTION, channels=names, spp=spp, max_depth=1)
    return [found.arrays[name] for name in names]


LIGHTS = {
    "above": AreaLight((0.0, 0.0, 1.8), (0, 0.1, -1), 0.6, 0.6, (5, 4, 3)),
    "grazing": AreaLight((1.4, 0.0, 0.5), (-1, 0, -0.2), 0.5, 0.5, (20, 20, 20)),
    "behind the box": AreaLight((0.2, 1.2, 0.5), (0, -1, -0.4), 1.0, 0.4, (5, 5, 5)),
    "a millimetre": AreaLight((0.0, 0.0, 1.8), (0, 0.1, -1), 1e-3, 1e-3, (1e6, 1e6, 1e6)),
    "five metres": AreaLight((0.0, 0.0, 2.0), (0, 0, -1), 5, 5, (1, 1, 1)),
    "at the horizon": AreaLight((0.0, 1.4, 0.3), (0, -1, 0), 1.0, 0.6, (5, 5, 5)),
}


def direct(rig, light, cues=False, grid=3):
    """Means over a frame of what `RectangleLight` finds: diffuse and specular light, and cues."""
    fine = tuple(grid * side for side in RESOLUTION)
    rig.set(Lighting(area=light))
    lit = RectangleLight(rig.scene, cues=cues).lit(
        View(Shot(CAMERA), None, RESOLUTION, 0, 0), light, fine, 4, Stages()
    )
    return [np.array(part).mean() for part in (lit.diffuse, lit.specular, *lit.cues.values())]


@pytest.mark.parametrize("name", LIGHTS)
def test_shadows_and_highlights_are_those_of_the_path_tracer(rig, name):
    light = LIGHTS[name]
    rig.set(Lighting(area=light))
    names = ("direct_diffuse", "direct_specular")
    found = render_frame(rig.scene, CAMERA, resolution=RESOLUTION, channels=names, spp=512, max_depth=1)
    expected = [found.arrays[channel].mean() for channel in names]
    assert min(expected) > 0
    diffuse, specular = direct(rig, light)
    for ours, truth in zip((diffuse, specular), expected, strict=True):
        np.testing.assert_allclose(ours, truth, atol=0.05 * sum(expected), rtol=0)
    np.testing.assert_allclose(diffuse + specular, sum(expected), rtol=0.05)


FLOORS = {
    "diffuse": scenes.two_sided(type="diffuse", reflectance=scenes.rgb(0.5)),
    "dark": scenes.two_sided(type="diffuse", reflectance=scenes.rgb(0.1)),
    "coated": scenes.two_sided(
        type="roughplastic", alpha=0.2, distribution="ggx", diffuse_reflectance=scenes.rgb(0.4, 0.2, 0.1)
    ),
}


def parts_of_floor(material, normal=1, *, sheet=False):
    """A floor whose normal is up or down, under a sheet or not."""
    parts = {"floor": scenes.rectangle([0, 0, 0], [0, 0, normal], (1.5, 1.5), bsdf=FLOORS[material])}
    if sheet:
        parts["sheet"] = scenes.rectangle([0, 0, 0.4], [0, 0, 1], (0.3, 0.3), bsdf=FLOORS["diffuse"])
    return parts


def floor(*given, **named):
    return LightRig(load_dict({"type": "scene", **parts_of_floor(*given, **named)}), panoramas=False)


def shining(lights):
    """Rectangles of a scene that shine as lights do."""
    black = scenes.two_sided(type="diffuse", reflectance=scenes.rgb(0))
    return {
        f"light{number}": {
            **scenes.rectangle(one.centre, one.direction, (one.width / 2, one.height / 2), bsdf=black),
            "emitter": {"type": "area", "radiance": scenes.rgb(*one.radiance)},
        }
        for number, one in enumerate(lights)
    }


def on_floor(rig, light):
    """Images of direct diffuse and specular light, and of the cues."""
    rig.set(Lighting(area=light))
    lit = RectangleLight(rig.scene, cues=True).lit(
        View(Shot(ABOVE), None, RESOLUTION, 0, 0), light, RESOLUTION, 4, Stages()
    )
    return [
        np.array(part).T.reshape(*RESOLUTION[::-1], 3)
        for part in (lit.diffuse, lit.specular, *lit.cues.values())
    ]


@pytest.mark.parametrize("material", FLOORS)
def test_a_floor_whose_normal_is_turned_is_the_same_floor(material):
    light = AreaLight((0.2, 0.1, 1.8), (0, 0.1, -1), 0.6, 0.6, (5, 4, 3))
    up, down = (on_floor(floor(material, normal), light) for normal in (1, -1))
    for one, other in zip(up, down, strict=True):
        np.testing.assert_allclose(other, one, rtol=0.05, atol=0.02 * one.max())
        np.testing.assert_allclose(other.mean(), one.mean(), rtol=0.01)


@pytest.mark.parametrize("material", FLOORS)
@pytest.mark.parametrize("side", [1e-3, 0.01, 0.05])
def test_what_a_small_light_does_not_reach_is_dark(side, material):
    """A thousandth of a light's radiance and less arrives where it is seen whole."""
    rig = floor(material, sheet=True)
    light = AreaLight((0, 0, 2.5), (0, 0, -1), side, side, tuple(c / side**2 for c in (5, 4, 3)))
    found = sum(on_floor(rig, light)[:2])
    names = ("direct_diffuse", "direct_specular")
    truth = render_frame(rig.scene, ABOVE, resolution=RESOLUTION, channels=names, spp=256, max_depth=1).arrays
    truth = sum(truth[name] for name in names)
    np.testing.assert_allclose(found.mean(), truth.mean(), rtol=0.05)
    umbra = (truth < 1e-6 * truth.max()).all(axis=2)
    assert umbra.sum() > 20
    assert found[umbra].mean() < 0.01 * truth.mean()


@pytest.mark.parametrize("material", ["diffuse", "coated"])
def test_light_of_two_lights_is_the_sum_of_both(material):
    lights = [
        AreaLight((-0.7, 0.1, 1.8), (0, 0.1, -1), 0.6, 0.6, (5, 4, 3)),
        AreaLight((0.8, 0.2, 1.2), (-0.5, 0, -1), 0.3, 0.5, (2, 6, 9)),
    ]
    rig = floor(material, sheet=True)
    found = sum(part for light in lights for part in on_floor(rig, light)[:2])
    both = load_dict({"type": "scene", **parts_of_floor(material, sheet=True), **shining(lights)})
    names = ("direct_diffuse", "direct_specular")
    truth = render_frame(both, ABOVE, resolution=RESOLUTION, channels=names, spp=256, max_depth=1).arrays
    truth = sum(truth[name] for name in names)
    np.testing.assert_allclose(found.mean(axis=(0, 1)), truth.mean(axis=(0, 1)), rtol=0.05)
    assert np.abs(found - truth).mean() < 0.1 * truth.mean()


def test_a_frame_is_what_is_emitted_and_direct_light(rig, method):
    light = LIGHTS["grazing"]
    emitted, diffuse, specular = reference(rig, light)
    found = frame(rig, method, light)
    assert not found.extra
    assert not found.indirect.any()
    np.testing.assert_allclose(found.specular.mean(), specular.mean(), rtol=0.1)
    # The light itself is seen, and at its edges a few rays a pixel are what they are.
    np.testing.assert_allclose(found.color.mean(), (emitted + diffuse + specular).mean(), rtol=0.1)


def test_light_that_reaches_nothing(rig, method):
    for light in (
        AreaLight((0.0, 0.0, 1.8), (0, 0, 1), 0.6, 0.6, (5, 4, 3)),  # shines away
        AreaLight((0.0, 0.0, -0.5), (0, 0, 1), 0.6, 0.6, (5, 4, 3)),  # under the floor
        AreaLight((0.0, 0.0, 0.0), (0, 0, -1), 0.6, 0.6, (5, 4, 3)),  # lies in the floor
    ):
        color = frame(rig, method, light).color
        assert np.isfinite(color).all()
        assert color.mean() < 1e-3


def test_a_light_in_a_wall_and_one_of_huge_radiance_stay_finite(rig, method):
    in_wall = AreaLight((0.0, 1.5, 1.0), (0, -1, 0), 0.6, 0.6, (5, 4, 3))
    assert np.isfinite(frame(rig, method, in_wall).color).all()
    one = frame(rig, method, LIGHTS["above"]).color
    for scale in (0, 1e-4, 1e5):
        scaled = dataclasses.replace(LIGHTS["above"], radiance=tuple(scale * c for c in (5, 4, 3)))
        np.testing.assert_allclose(frame(rig, method, scaled).color, scale * one, rtol=1e-4)


def test_frames_repeat_and_other_seeds_have_other_shadows(rig, method):
    light = LIGHTS["behind the box"]
    first, again, other = (frame(rig, method, light, seed).color for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    np.testing.assert_allclose(first.mean(), other.mean(), rtol=0.05)


def test_cues_are_those_of_the_channels(rig):
    light = LIGHTS["above"]
    rig.set(Lighting(area=light))
    expected = render_frame(rig.scene, CAMERA, resolution=RESOLUTION, channels=CUES, spp=256).arrays
    found = direct(rig, light, cues=True)[2:]
    for name, cue in zip(CUES, found, strict=True):
        np.testing.assert_allclose(cue, expected[name].mean(), rtol=0.05)


def test_a_frame_without_an_area_light_is_refused(rig, method):
    rig.set(Lighting())
    with pytest.raises(MethodError, match="own light: run it on the track moving-light"):
        method.render(View(Shot(CAMERA), None, RESOLUTION, 0, 0), Stages())
