"""The real-time path tracer against the reference renderer and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.baselines.path_traced import METHOD, tracer
from gibench.baselines.stages import Stages
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.render import MAX_DEPTH, render_frame
from gibench.rendering.scene import load_dict
from tests.baselines.sites import RESOLUTION, site, view
from tests.rendering import scenes


@pytest.fixture(scope="module")
def box():
    return load_dict(scenes.box("coat"))


@pytest.fixture(scope="module")
def reference(box):
    return render_frame(
        box, scenes.CAMERA, resolution=RESOLUTION, spp=2048, seed=7, channels=["radiance"]
    ).arrays


def method(scene, folder, **knobs):
    implementation = METHOD.load()(METHOD.settings(knobs))
    implementation.prepare(site(scene, folder))
    return implementation


def specular_of(reference):
    return reference["direct_specular"] + reference["indirect_specular"]


def frames(implementation, count, **knobs):
    implementation.adjust(METHOD.settings(knobs))
    return [implementation.render(view(scenes.CAMERA, seed), Stages()) for seed in range(count)]


def test_the_mean_over_seeds_is_the_reference(box, reference, tmp_path):
    """Means over the picture, whose spread over the seeds says how close they must be."""
    found = frames(method(box, tmp_path), 64, spp=4, denoise=False)
    for name, expected in (("color", reference["color"]), ("specular", specular_of(reference))):
        means = np.array([getattr(frame, name).mean(axis=(0, 1)) for frame in found])
        error = means.std(axis=0, ddof=1) / np.sqrt(len(means))
        assert (np.abs(means.mean(axis=0) - expected.mean(axis=(0, 1))) < 4 * error).all(), name


def test_every_pixel_gets_its_own_samples(box, reference, tmp_path):
    """The mean picture is the reference's picture, not only its mean."""
    found = np.mean(
        [frame.color for frame in frames(method(box, tmp_path), 64, spp=8, denoise=False)], axis=0
    )
    dark = np.log1p(found) - np.log1p(reference["color"])
    assert np.sqrt(np.mean(dark**2)) < 0.1 * np.log1p(reference["color"]).std()


def test_error_falls_with_samples(box, reference, tmp_path):
    implementation = method(box, tmp_path)
    for denoise in (False, True):
        errors = [
            np.mean(
                [
                    np.mean((np.log1p(frame.color) - np.log1p(reference["color"])) ** 2)
                    for frame in frames(implementation, 4, spp=spp, denoise=denoise)
                ]
            )
            for spp in (1, 4, 16)
        ]
        assert errors[0] > errors[1] > errors[2], denoise


def test_denoising_pays(box, tmp_path):
    """At a size at which there is a neighbourhood to learn from."""
    size = (160, 120)
    truth = render_frame(box, scenes.CAMERA, resolution=size, spp=256, seed=7, channels=["radiance"]).arrays
    implementation = method(box, tmp_path)
    for name, expected in (("color", truth["color"]), ("specular", specular_of(truth))):
        errors = []
        for denoise in (False, True):
            implementation.adjust(METHOD.settings({"spp": 8, "denoise": denoise}))
            frame = implementation.render(view(scenes.CAMERA, 0, size), Stages())
            errors.append(np.mean((np.log1p(getattr(frame, name)) - np.log1p(expected)) ** 2))
        assert errors[1] < 0.5 * errors[0], (name, errors)


def test_light_between_emitting_walls_is_a_geometric_series(tmp_path):
    """In a closed box of reflectance ρ whose walls emit 1, a path of at most n events brings Σ ρᵏ up to k = n."""
    scene = load_dict(scenes.closed_box(0.5, 1.0))
    implementation = method(scene, tmp_path, spp=32, denoise=False)
    camera = PinholeCamera((0.1, 0.2, -0.1), (1.0, 0.3, 0.2), 1.0)
    found = implementation.render(view(camera), Stages())
    expected = sum(0.5**k for k in range(MAX_DEPTH + 1))
    np.testing.assert_allclose(found.color.mean(), expected, rtol=0.02)
    assert not found.specular.any()


def test_noise_follows_the_seed_of_the_view_alone(box, tmp_path):
    implementation = method(box, tmp_path, spp=2, denoise=False)
    first, again, other = (implementation.render(view(scenes.CAMERA, seed), Stages()) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.color, again.color)
    assert not np.array_equal(first.color, other.color)


def test_a_frame_in_several_passes_is_whole(box, reference, tmp_path, monkeypatch):
    """With 5 rows a pass, the last pass has fewer."""
    monkeypatch.setattr(tracer, "LANES", 5 * RESOLUTION[0] * 32)
    (frame,) = frames(method(box, tmp_path), 1, spp=32, denoise=False)
    assert frame.color.shape == reference["color"].shape
    rows = np.log1p(frame.color).mean(axis=(1, 2)), np.log1p(reference["color"]).mean(axis=(1, 2))
    np.testing.assert_allclose(*rows, rtol=0.25)


def test_stages(box, tmp_path):
    implementation = method(box, tmp_path)
    for denoise, names in ((True, {"ray casting", "denoising"}), (False, {"ray casting"})):
        implementation.adjust(METHOD.settings({"denoise": denoise}))
        stages = Stages()
        implementation.render(view(scenes.CAMERA), stages)
        assert set(stages.seconds) == names


def test_only_what_a_renderer_shows_is_denoised_inside_of_the_clock(box, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(tracer, "denoise", lambda image, **guides: asked.append(image) or image)
    (frame,) = frames(method(box, tmp_path), 1, spp=1, denoise=True)
    frame.finish()
    assert len(asked) == 1
    np.testing.assert_array_equal(frame.color, asked[0])
    np.testing.assert_array_equal(frame.specular, asked[1])
    assert len(asked) == 2
