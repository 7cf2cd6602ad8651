import colour
import numpy as np
import pytest
from skimage.color import rgb2xyz

from gibench.generators.materials.color import (
    DARKEST,
    LIGHTEST,
    colorize,
    decode,
    encode,
    fit_range,
    lch,
    luminance_of,
    mean_luminance,
    ramp,
)


def test_lch_agrees_with_colour_science():
    rng = np.random.default_rng(0)
    luminance = rng.uniform(0.15, 0.5, 50)
    hue = rng.uniform(0, 2 * np.pi, 50)
    chroma = np.full(50, 0.03)
    rgb = lch(luminance, chroma, hue)
    assert luminance_of(rgb) == pytest.approx(luminance, rel=1e-9)
    oklab = colour.XYZ_to_Oklab(rgb @ colour.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ.T)
    assert np.arctan2(oklab[:, 2], oklab[:, 1]) % (2 * np.pi) == pytest.approx(hue, abs=0.01)
    # The correction of the luminance scales the colour as a whole, which moves the chroma by a few per cent.
    assert np.hypot(oklab[:, 1], oklab[:, 2]) == pytest.approx(chroma, rel=0.05)


def test_greys_are_grey():
    assert lch([0.1, 0.5, 0.8], 0.0, 1.0) == pytest.approx(
        np.array([[0.1] * 3, [0.5] * 3, [0.8] * 3]), rel=1e-6
    )


def test_fit_range_keeps_luminance_and_hue_direction():
    rng = np.random.default_rng(1)
    rgb = rng.uniform(-0.5, 1.5, (400, 3))
    fitted = fit_range(rgb)
    assert fitted.min() >= DARKEST - 1e-12
    assert fitted.max() <= LIGHTEST + 1e-12
    inside = (luminance_of(rgb) > DARKEST) & (luminance_of(rgb) < LIGHTEST)
    assert luminance_of(fitted[inside]) == pytest.approx(luminance_of(rgb[inside]), abs=1e-12)
    unchanged = rng.uniform(0.1, 0.8, (20, 3))
    assert fit_range(unchanged) == pytest.approx(unchanged)


def test_srgb_bytes():
    every = np.arange(256, dtype=np.uint8)
    limit = encode(LIGHTEST)
    below = every[every <= limit]
    assert (encode(decode(below)) == below).all()
    assert decode(encode(np.array([1.0])))[0] <= LIGHTEST
    grey = np.repeat(every[:, None], 3, 1)[None]
    assert decode(every) == pytest.approx(rgb2xyz(grey)[0, :, 1], abs=2e-6)


def test_colorize_gives_the_mean_that_was_asked_for():
    rng = np.random.default_rng(2)
    index = rng.integers(0, 32, (64, 64))
    palette = ramp([[0.02, 0.01, 0.01], [0.3, 0.2, 0.1], [0.9, 0.9, 0.8]], 32)
    for luminance in (0.05, 0.3, 0.6, 0.8):
        pixels = colorize(index, palette, luminance)
        assert pixels.dtype == np.uint8
        assert mean_luminance(pixels) == pytest.approx(luminance, abs=0.004)
        assert mean_luminance(pixels) == pytest.approx(luminance_of(decode(pixels)).mean(), abs=1e-12)


def test_ramp_runs_through_its_stops():
    stops = np.array([[0.0, 0.1, 0.2], [0.5, 0.5, 0.5], [1.0, 0.0, 0.0]])
    assert ramp(stops, 5)[::2] == pytest.approx(stops)
