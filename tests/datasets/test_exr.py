import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gibench.datasets.errors import StorageError, UnknownChannel
from gibench.datasets.exr import (
    dark_radiance,
    decode,
    encode,
    fits_half,
    layer_names,
    present_channels,
    stored_types,
)
from gibench.rendering.channels import CHANNELS, PARTS, resolve
from tests.datasets.fakes import pixels

ALL = tuple(CHANNELS)


def radiance(*values: float) -> dict[str, np.ndarray]:
    """A row of pixels, the value of each in the first part; the other parts are 0."""
    row = np.repeat(np.array(values, np.float32)[None, :, None], 3, axis=-1)
    return {name: row if name == PARTS[0] else np.zeros_like(row) for name in PARTS} | {"color": row}


def test_what_is_written_is_read_back_bit_by_bit(tmp_path):
    arrays = pixels(ALL, (33, 21), seed=1)
    (tmp_path / "frame.exr").write_bytes(encode(arrays))
    stored, read = stored_types(arrays), decode(tmp_path / "frame.exr")
    assert set(read) == set(ALL) == set(present_channels(tmp_path / "frame.exr"))
    for name in ALL:
        assert read[name].dtype == stored[name].dtype
        np.testing.assert_array_equal(read[name], stored[name])


def test_only_what_is_asked_for_comes_and_comes_as_float32_where_widened(tmp_path):
    content = encode(pixels(ALL, (8, 8), seed=2))
    read = decode(content, ["color", "depth", "shape_id"], widen=True)
    assert {name: (values.shape, values.dtype) for name, values in read.items()} == {
        "color": ((8, 8, 3), np.float32),
        "depth": ((8, 8, 1), np.float32),
        "shape_id": ((8, 8, 1), np.uint32),
    }
    np.testing.assert_array_equal(read["color"], decode(content)["color"].astype(np.float32))


def test_layers_are_named_for_viewers(tmp_path):
    (tmp_path / "frame.exr").write_bytes(encode(pixels(ALL, (8, 8), seed=3)))
    with OpenEXR.File(str(tmp_path / "frame.exr"), separate_channels=True) as file:
        names = set(file.channels())
        assert len(file.parts) == 1
        assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION
    assert {"R", "G", "B"} <= names
    assert {
        "direct_diffuse.R",
        "albedo.B",
        "normal.X",
        "position.Z",
        "motion.Y",
        "depth.V",
        "shape_id.V",
    } <= names
    assert not any(name.startswith("color.") for name in names)
    assert len(names) == sum(channel.components for channel in CHANNELS.values())


def test_stored_types_are_those_of_the_contract():
    stored = stored_types(pixels(ALL, (8, 8), seed=4))
    for name in resolve(["surface"]):
        want = {"half": np.float16, "float": np.float32, "uint": np.uint32}[CHANNELS[name].dtype]
        if want != np.float16:
            assert stored[name].dtype == want


@given(st.lists(st.floats(0, 1e6, width=32), min_size=1, max_size=40))
@settings(max_examples=200, deadline=None)
def test_half_is_taken_exactly_where_no_value_loses_more_than_a_thousandth(values):
    array = np.array(values, np.float32)
    with np.errstate(over="ignore"):
        half = array.astype(np.float16).astype(np.float64)
    lossless = all(abs(h - v) <= 1e-3 * v for h, v in zip(half, array.astype(np.float64), strict=True))
    assert fits_half(array) == lossless


@pytest.mark.parametrize(
    ("value", "half"),
    [
        (0.0, True),
        (1.0, True),
        (65504.0, True),
        (65519.0, True),  # rounds down to the largest half
        (65520.0, False),  # rounds to infinity
        (1e6, False),
        (6.1e-5, True),  # about the smallest normal half
        (2.0**-24, True),  # the smallest denormal, exactly
        (1e-6, False),
        (1e-8, False),  # would become 0
    ],
)
def test_edges_of_half(value, half):
    stored = stored_types(radiance(value, 0.0, 0.0))  # the median is 0: the relative error alone counts
    want = np.float16 if half else np.float32
    assert stored[PARTS[0]].dtype == want
    assert stored["color"].dtype == want
    assert stored[PARTS[1]].dtype == np.float16
    np.testing.assert_allclose(stored["color"].astype(np.float64)[0, 0], value, rtol=1e-3)


@given(st.integers(0, 2**32 - 1), st.floats(-18, 0), st.floats(0, 14))
@settings(max_examples=100, deadline=None)
def test_color_is_the_sum_of_the_stored_parts_to_the_last_bit(seed, low, high):
    rng = np.random.default_rng(seed)
    shape = (4, 5, 3)
    arrays = {}
    for name in PARTS:
        values = np.exp(rng.uniform(low, high, shape)).astype(np.float32)
        arrays[name] = np.where(rng.random(shape) < 0.3, np.float32(0), values)
    arrays["color"] = sum(arrays[name] for name in PARTS)
    read = decode(encode(arrays))
    # Added by hand here, left to right, each step rounded to float32.
    total = np.float32(0) + read["emission"].astype(np.float32)
    for name in ("direct_diffuse", "direct_specular", "indirect_diffuse", "indirect_specular"):
        total = (total + read[name].astype(np.float32)).astype(np.float32)
    np.testing.assert_array_equal(read["color"], total.astype(read["color"].dtype))
    # What is stored stays as near to what was rendered as two roundings allow.
    dark = 0.01 * np.median(arrays["color"])
    np.testing.assert_allclose(read["color"].astype(np.float64), arrays["color"], rtol=2e-3, atol=6e-3 * dark)


def test_dust_in_a_lit_frame_does_not_cost_float32_and_a_dark_frame_keeps_its_digits():
    lit = radiance(*[0.1] * 9, 1e-12)
    assert stored_types(lit)["emission"].dtype == np.float16
    dim = radiance(*[1e-6] * 9, 1e-12)
    assert stored_types(dim)["emission"].dtype == np.float32
    assert dark_radiance(lit) == pytest.approx(1e-3)
    half_black = radiance(*[0.0] * 6, *[0.1] * 4, 1e-7)
    assert stored_types(half_black)["emission"].dtype == np.float32


@given(st.integers(0, 2**32 - 1), st.floats(-16, 12))
@settings(max_examples=100, deadline=None)
def test_no_stored_value_is_off_by_more_than_a_thousandth_of_itself_or_of_what_is_dark(seed, level):
    rng = np.random.default_rng(seed)
    arrays = {name: np.exp(rng.normal(level, 4, (6, 5, 3))).astype(np.float32) for name in PARTS}
    stored = stored_types(arrays)
    for name in PARTS:
        error = np.abs(stored[name].astype(np.float64) - arrays[name])
        assert np.all(error <= 1e-3 * np.maximum(arrays[name], dark_radiance(arrays)) * (1 + 1e-6))


def test_color_alone_is_stored_as_it_came():
    color = np.full((2, 2, 3), 0.3, np.float32)
    np.testing.assert_array_equal(stored_types({"color": color})["color"], color.astype(np.float16))


def test_a_lobe_that_does_not_exist_stays_exactly_zero():
    assert not stored_types(radiance(0.3, 1e-9))[PARTS[3]].any()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_refused(bad):
    arrays = pixels(("position",), (8, 6), seed=5)
    arrays["position"][2, 3, 1] = bad
    with pytest.raises(StorageError, match="position is not finite in 1 pixels, first at row 2, column 3"):
        encode(arrays)


def test_negative_radiance_is_refused_and_negative_positions_are_not():
    arrays = radiance(-1e-6)
    with pytest.raises(StorageError, match="emission is negative"):
        encode(arrays)
    encode({"position": np.full((2, 2, 3), -1, np.float32)})


def test_a_channel_that_is_not_there_is_named_with_its_neighbours():
    content = encode(pixels(resolve(["radiance"]), (8, 8), seed=6))
    with pytest.raises(UnknownChannel, match="no channel 'colour'; did you mean 'color'") as caught:
        decode(content, ["colour"])
    assert isinstance(caught.value, KeyError)


def test_broken_files_are_named(tmp_path):
    path = tmp_path / "frame.exr"
    path.write_bytes(encode(pixels(ALL, (16, 16), seed=7))[:-200])
    with pytest.raises(StorageError, match=r"frame\.exr cannot be read as OpenEXR"):
        decode(path)
    path.write_bytes(b"no picture")
    with pytest.raises(StorageError, match=r"frame\.exr cannot be read as OpenEXR"):
        decode(path)
    with pytest.raises(StorageError, match=r"none\.exr cannot be read as OpenEXR"):
        present_channels(tmp_path / "none.exr")


def test_components_of_every_channel_have_names():
    for channel in CHANNELS.values():
        assert len(layer_names(channel)) == channel.components
