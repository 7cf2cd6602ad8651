"""Panoramas are known by their pixels, and what is none is refused."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.rendering.panoramas import Panorama, PanoramaError, digest


def test_a_panorama_is_known_by_its_pixels():
    pixels = np.random.default_rng(1).random((8, 16, 3)).astype(np.float32)
    one, two = Panorama.of("a", pixels), Panorama.of("a", pixels.copy())
    assert one == two
    assert hash(one) == hash(two)
    assert Panorama.of("a", pixels + 1) != one
    assert digest(pixels) != digest(pixels.reshape(16, 8, 3))
    with pytest.raises(ValueError, match="read-only"):
        one.pixels[0, 0, 0] = 1


def test_pixels_are_read_when_they_are_asked_for_and_must_be_those():
    pixels = np.random.default_rng(1).random((8, 16, 3)).astype(np.float32)
    asked = []

    def read():
        asked.append(1)
        return pixels.copy()

    known = Panorama("a", digest(pixels), read)
    assert known == Panorama.of("a", pixels)
    assert not asked
    np.testing.assert_array_equal(known.pixels, pixels)
    np.testing.assert_array_equal(known.pixels, pixels)
    assert len(asked) == 1
    with pytest.raises(PanoramaError, match="not those"):
        _ = Panorama("a", digest(pixels + 1), read).pixels


def test_a_panorama_may_be_black():
    assert not Panorama.of("night", np.zeros((8, 16, 3))).pixels.any()


@pytest.mark.parametrize(
    ("pixels", "why"),
    [
        (np.ones((8, 8, 3)), "twice as wide"),
        (np.ones((8, 16)), "twice as wide"),
        (np.ones((8, 16, 4)), "3 colours"),
        (np.full((8, 16, 3), np.nan), "384 values are negative or not finite"),
        (-np.ones((8, 16, 3)), "negative"),
    ],
)
def test_what_is_no_panorama_is_refused_in_one_line(pixels, why):
    with pytest.raises(PanoramaError, match=why) as caught:
        Panorama.of("a", pixels)
    assert "\n" not in str(caught.value)
