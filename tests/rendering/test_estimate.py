"""Samples, passes and the standard error."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.rendering import estimate as module
from gibench.rendering.backend import is_scalar
from gibench.rendering.estimate import EstimateError, estimate_radiance, group_levels
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict, load_scene

from . import scenes


@pytest.fixture(scope="module")
def room():
    return load_dict(scenes.box("coat"))


@pytest.mark.parametrize(
    ("spp", "levels"),
    [(1, 0), (2, 0), (16, 0), (17, 0), (64, 1), (100, 1), (250, 0), (256, 2), (1000, 1), (1024, 3)],
)
def test_groups_divide_the_samples_and_are_enough(spp, levels):
    assert group_levels(spp) == levels
    assert spp % 4**levels == 0
    assert levels == 0 or spp // 4**levels >= module.MINIMUM_GROUPS


@pytest.mark.parametrize("spp", [16, 64])
def test_standard_error_is_the_spread_over_seeds(room, spp):
    """Mean of color_se² against the variance over 64 independent seeds."""
    frames = [
        render_frame(
            room, scenes.CAMERA, resolution=(32, 32), channels=["color", "color_se"], spp=spp, seed=s
        ).arrays
        for s in range(64)
    ]
    spread = np.array([f["color"] for f in frames], dtype=np.float64).var(axis=0, ddof=1)
    claimed = np.square(np.array([f["color_se"] for f in frames], dtype=np.float64)).mean(axis=0)
    # Both are unbiased, pixel by pixel; what 64 seeds leave is noise, largest in the few pixels of large variance.
    share = spread.mean(axis=-1) < np.quantile(spread.mean(axis=-1), 0.98)
    assert claimed[share].sum() / spread[share].sum() == pytest.approx(1, abs=0.05)


def test_same_seed_same_bits_whatever_the_block_of_pixels(room, monkeypatch):
    options = {"resolution": (24, 16), "channels": ["radiance", "surface"], "spp": 64}
    first = render_frame(room, scenes.CAMERA, seed=5, **options).arrays
    again = render_frame(room, scenes.CAMERA, seed=5, **options).arrays
    other = render_frame(room, scenes.CAMERA, seed=6, **options).arrays
    for name, values in first.items():
        np.testing.assert_array_equal(values, again[name])
    assert (first["color"] != other["color"]).any()


def test_mean_and_error_do_not_depend_on_how_samples_are_split(room, monkeypatch):
    """In several launches the numbers come from other random streams, so they agree within their errors."""
    options = {"resolution": (16, 16), "channels": ["color", "color_se"], "spp": 256, "max_depth": 2}
    whole = render_frame(room, scenes.CAMERA, **options).arrays
    monkeypatch.setattr(module, "LANES", 64 * 40)
    split = render_frame(room, scenes.CAMERA, **options).arrays
    error = np.sqrt(np.square(whole["color_se"]) + np.square(split["color_se"])) + 1e-6
    z = (whole["color"] - split["color"]) / error
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.5


def test_error_target_is_met(room):
    loose = render_frame(room, scenes.CAMERA, resolution=(32, 32), channels=["radiance"], error=0.2)
    tight = render_frame(room, scenes.CAMERA, resolution=(32, 32), channels=["radiance"], error=0.05)
    assert loose.median_error < 0.2
    assert tight.median_error < 0.05
    assert tight.spp > loose.spp


def test_error_target_stops_at_the_cap(room):
    frame = render_frame(
        room, scenes.CAMERA, resolution=(16, 16), channels=["color"], error=1e-6, spp_cap=200
    )
    assert frame.spp == 192
    assert frame.median_error > 1e-6


def test_black_scene_has_no_error():
    dark = scenes.box("diffuse")
    del dark["lamp"]
    frame = render_frame(load_dict(dark), scenes.CAMERA, resolution=(8, 8), channels=["radiance"], error=0.1)
    assert frame.median_error == 0
    assert not any(values.any() for values in frame.arrays.values())


@pytest.mark.parametrize("radiance", [1e-44, 3e-41, 1e-38, 1e-30])
def test_light_at_the_end_of_float32_has_a_standard_error_that_is_a_number(radiance):
    """The mean of 16 groups is 0 where no group is, once it is less than the least number that there is."""
    dim = scenes.box("diffuse")
    dim["lamp"]["emitter"] = scenes.area(radiance)
    found = estimate_radiance(load_dict(dim), scenes.CAMERA, (8, 8), spp=16).standard_error
    assert np.isfinite(found).all()
    assert (found <= radiance).all()


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"spp": 4, "error": 0.1},
        {"spp": 0},
        {"spp": -3},
        {"error": 0.0},
        {"error": float("nan")},
        {"error": 0.1, "spp_cap": 8},
        {"spp": 4, "max_depth": -1},
    ],
)
def test_bad_numbers_are_refused(room, options):
    with pytest.raises(EstimateError):
        estimate_radiance(room, scenes.CAMERA, (4, 4), **options)


def test_one_sample_has_no_standard_error(room):
    assert render_frame(room, scenes.CAMERA, resolution=(4, 4), channels=["color"], spp=1).spp == 1
    with pytest.raises(EstimateError, match="color_se"):
        render_frame(room, scenes.CAMERA, resolution=(4, 4), channels=["color_se"], spp=1)


@pytest.fixture
def rooms_on_disk(tmp_path):
    """Two scenes of one lamp each, with different numbers and kinds of shapes and materials."""
    kinds = (
        '<bsdf type="roughplastic"><string name="distribution" value="ggx"/>'
        '<rgb name="diffuse_reflectance" value="0.2 0.3 0.4"/></bsdf>',
        '<bsdf type="diffuse"><rgb name="reflectance" value="0.5 0.6 0.4"/></bsdf>',
    )
    for name, shapes in (("one", 1), ("two", 5)):
        text = "".join(
            f'<shape type="sphere"><point name="center" x="{i}" y="0" z="1"/><float name="radius" value="0.4"/>'
            f'<bsdf type="twosided">{kinds[i % 2]}</bsdf></shape>'
            for i in range(shapes)
        )
        lamp = '<shape type="sphere"><point name="center" x="0" y="0" z="3"/><emitter type="area"/></shape>'
        (tmp_path / f"{name}.xml").write_text(f'<scene version="3.0.0">{text}{lamp}</scene>')
    return tmp_path / "one.xml", tmp_path / "two.xml"


def test_scenes_share_a_compiled_kernel_and_keep_their_pixels(rooms_on_disk):
    if is_scalar():
        pytest.skip("nothing is compiled")
    import drjit as dr

    options = {"resolution": (16, 12), "channels": ["radiance", "surface"], "spp": 4}
    tracers = []
    for path in rooms_on_disk:
        alone = render_frame(load_scene(path), scenes.CAMERA, **options).arrays
        shared = load_scene(path, share_kernels=True)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            frame = render_frame(shared, scenes.CAMERA, **options).arrays
            kernels = [k for k in dr.kernel_history() if "operation_count" in k]
        tracers.append(max(kernels, key=lambda k: k["operation_count"])["hash"])
        for name, values in alone.items():
            np.testing.assert_array_equal(values, frame[name])
        del shared
    assert tracers[0] == tracers[1]
