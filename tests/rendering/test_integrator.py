"""The factorized integrator against Mitsuba's `path`, closed forms and its own invariants."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.rendering.camera import PinholeCamera
from gibench.rendering.channels import PARTS
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from gibench.stress.answers import parallel_rectangle

from . import scenes


def render(description, camera=scenes.CAMERA, side=48, **options):
    options = {"channels": ["radiance"], "spp": 256, "max_depth": 6} | options
    return render_frame(load_dict(description), camera, resolution=(side, side), **options).arrays


def blocks(image, count):
    """Means over count × count blocks."""
    height, width, channels = image.shape
    return image.reshape(count, height // count, count, width // count, channels).mean(axis=(1, 3))


def z_scores(image, error, replicates, count):
    """Differences of block means in standard errors; `replicates` are independent renders of the other side."""
    other = np.array([blocks(r, count) for r in replicates])
    pixels = (image.shape[0] // count) ** 2
    ours = blocks(np.square(error), count) / pixels
    spread = other.var(axis=0, ddof=1) / len(other)
    return (blocks(image, count) - other.mean(axis=0)) / np.sqrt(ours + spread)


@pytest.mark.parametrize("material", scenes.MATERIALS)
def test_color_agrees_with_path(material):
    scene = load_dict(scenes.box(material))
    frame = render_frame(
        scene, scenes.CAMERA, resolution=(48, 48), channels=["radiance"], spp=256, max_depth=6
    ).arrays
    path = [scenes.render_path(scene.mi_scene, scenes.CAMERA, 48, 8, 100 + i, 6) for i in range(24)]
    for count in (1, 4):
        z = z_scores(frame["color"].astype(float), frame["color_se"].astype(float), path, count)
        assert np.abs(z).max() < 4, (
            f"{count} x {count} blocks differ by {np.abs(z).max():.1f} standard errors"
        )


@pytest.mark.parametrize("material", scenes.MATERIALS)
def test_direct_agrees_with_one_bounce(material):
    scene = load_dict(scenes.box(material))
    options = {"resolution": (48, 48), "channels": ["radiance"], "spp": 256}
    whole = render_frame(scene, scenes.CAMERA, max_depth=6, seed=1, **options).arrays
    direct = sum(whole[name] for name in ("emission", "direct_diffuse", "direct_specular")).astype(float)
    path = [scenes.render_path(scene.mi_scene, scenes.CAMERA, 48, 8, 200 + i, 1) for i in range(24)]
    # The error of color bounds that of its direct part from above, which would hide a bias: measure it instead.
    once = render_frame(scene, scenes.CAMERA, max_depth=1, seed=2, **options).arrays
    for count in (1, 4):
        assert np.abs(z_scores(direct, once["color_se"].astype(float), path, count)).max() < 4


@pytest.mark.parametrize("material", scenes.MATERIALS)
def test_parts_are_not_negative_and_sum_to_color(material):
    frame = render(scenes.box(material), spp=16)
    for name in PARTS:
        assert frame[name].min() >= 0
    np.testing.assert_array_equal(sum((frame[n] for n in PARTS[1:]), frame[PARTS[0]]), frame["color"])


def test_missing_lobes_are_exactly_zero():
    camera = PinholeCamera((0, -3, 0), (0, 0, 0), np.radians(50.0))
    diffuse = render(scenes.furnace(scenes.MATERIALS["diffuse"]), camera, spp=16)
    assert not diffuse["direct_specular"].any()
    assert not diffuse["indirect_specular"].any()
    for material in ("metal", "mirror"):
        specular = render(scenes.furnace(scenes.MATERIALS[material]), camera, spp=16)
        assert not specular["direct_diffuse"].any()
        assert not specular["indirect_diffuse"].any()
        assert specular["direct_specular"].any()


def test_depth_zero_is_emission_alone():
    frame = render(scenes.box("coat"), spp=4, max_depth=0)
    np.testing.assert_array_equal(frame["color"], frame["emission"])
    assert frame["emission"].any()


@pytest.mark.parametrize(
    "bsdf",
    [
        scenes.two_sided(type="diffuse", reflectance=scenes.rgb(1.0)),
        scenes.two_sided(type="conductor", material="none"),
        scenes.two_sided(type="roughconductor", material="none", alpha=0.005, distribution="ggx"),
    ],
    ids=["diffuse", "mirror", "near-mirror"],
)
def test_white_furnace(bsdf):
    """A surface that absorbs nothing, under uniform light, cannot be told from the light.

    Seen from the middle of the sphere outward, so that grazing angles, where one scattering by rough facets
    loses energy, are left out.
    """
    frame = render(scenes.furnace(bsdf, 2.0), PinholeCamera((0, -4, 0), (0, 0, 0), np.radians(10.0)), side=16)
    error = np.maximum(frame["color_se"], 1e-4)
    assert np.abs((frame["color"] - 2.0) / error).mean() < 1.5
    np.testing.assert_allclose(frame["color"].mean(), 2.0, rtol=2e-3)


@pytest.mark.parametrize("reflectance", [0.0, 0.3, 0.8])
def test_closed_box(reflectance):
    """Radiance in a uniform closed box: bounce k brings E·ρᵏ (geometric series)."""
    emitted, depth = 0.5, 24
    frame = render(
        scenes.closed_box(reflectance, emitted),
        PinholeCamera((0, 0, 0), (1, 0.2, 0.1), np.radians(70.0)),
        side=24,
        max_depth=depth,
        spp=256,
    )
    bounces = emitted * reflectance ** np.arange(depth + 1)
    np.testing.assert_allclose(frame["emission"], emitted, rtol=1e-6)
    pixels = frame["color"].size // 3
    error = max(float(np.sqrt(np.square(frame["color_se"]).sum(axis=(0, 1)).max())) / pixels, 1e-7)
    assert abs(frame["direct_diffuse"].mean() - bounces[1]) < 4 * error
    assert abs(frame["indirect_diffuse"].mean() - bounces[2:].sum()) < 4 * error
    assert not frame["direct_specular"].any()
    if reflectance:
        ratio = frame["indirect_diffuse"].mean() / frame["direct_diffuse"].mean()
        truncated = (reflectance - reflectance**depth) / (1 - reflectance)
        assert ratio == pytest.approx(truncated, rel=0.01)


@pytest.mark.parametrize("shape", ["rectangle", "sphere"])
def test_irradiance_under_a_light(shape):
    """A diffuse floor under one light reflects ρ/π of the analytic irradiance."""
    reflectance, radiance = 0.5, 3.0
    if shape == "rectangle":
        light = scenes.rectangle([0, 0, 1.5], [0, 0, -1], (0.4, 0.7), emitter=scenes.area(radiance))
        irradiance = np.pi * radiance * parallel_rectangle(0.4, 0.7, 1.5)
    else:
        light = {"type": "sphere", "center": [0, 0, 1.5], "radius": 0.3, "emitter": scenes.area(radiance)}
        irradiance = np.pi * radiance * (0.3 / 1.5) ** 2
    floor = scenes.rectangle(
        [0, 0, 0], [0, 0, 1], (2, 2), bsdf={"type": "diffuse", "reflectance": scenes.rgb(0.5)}
    )
    # A field of view so narrow that the irradiance is constant over it.
    camera = PinholeCamera((0, -2, 0.8), (0, 0, 0), 1e-3)
    frame = render({"type": "scene", "light": light, "floor": floor}, camera, side=16, max_depth=1, spp=1024)
    expected = reflectance / np.pi * irradiance
    error = float(np.sqrt(np.square(frame["color_se"]).sum(axis=(0, 1)).max())) / 256
    assert abs(frame["direct_diffuse"].mean() - expected) < max(4 * error, 1e-6)
    assert error < 0.005 * expected


def test_invalid_samples_are_counted_and_never_stored():
    description = scenes.box("diffuse")
    description["lamp"]["emitter"] = scenes.area(3e38)
    frame = render_frame(
        load_dict(description), scenes.CAMERA, resolution=(16, 16), channels=["radiance"], spp=16
    )
    assert frame.invalid_paths > 0
    for name, values in frame.arrays.items():
        assert np.isfinite(values).all(), name
