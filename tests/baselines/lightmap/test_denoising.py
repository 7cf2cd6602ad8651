"""The lightmap's denoiser: charts do not know of each other."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.baselines.lightmap.denoising import denoise_lightmap, shelved

pytest.importorskip("mitsuba_oidn")


def atlas_of(levels, side=24, noise=0.5, seed=1):
    """Square charts in a row, one texel apart, each evenly lit but for noise: atlas, charts."""
    charts = np.full((side + 2, len(levels) * (side + 1) + 1), -1, dtype=np.int32)
    atlas = np.zeros((*charts.shape, 3), dtype=np.float32)
    rng = np.random.default_rng(seed)
    for number, level in enumerate(levels):
        at = (slice(1, side + 1), slice(1 + number * (side + 1), (number + 1) * (side + 1)))
        charts[at] = number
        atlas[at] = level * rng.gamma(1 / noise**2, noise**2, (side, side, 1))
    return atlas, charts


def test_a_bright_chart_does_not_light_the_dark_one_beside_it():
    levels = [1e-3, 10.0, 1e-3, 0.0, 1e4]
    atlas, charts = atlas_of(levels)
    clean = denoise_lightmap(atlas, charts)
    for number, level in enumerate(levels):
        own = charts == number
        assert clean[own].mean() == pytest.approx(atlas[own].mean(), rel=0.05)
        assert clean[own].std() <= 0.2 * atlas[own].std()
        # At its rim as inside, where the neighbour was a texel away.
        assert (clean[own] <= 1.5 * level).all()


def test_what_lies_around_changes_nothing():
    """A chart among others is denoised as it is alone, up to where the filter's tiles fall."""
    atlas, charts = atlas_of([3.0, 0.01, 200.0])
    among = denoise_lightmap(atlas, charts)[charts == 1]
    alone = denoise_lightmap(atlas, np.where(charts == 1, 0, -1).astype(np.int32))[charts == 1]
    np.testing.assert_allclose(among, alone, rtol=0.25)
    assert among.mean() == pytest.approx(alone.mean(), rel=0.02)


def test_off_the_charts_and_in_the_dark_it_is_black():
    atlas, charts = atlas_of([1.0, 0.0])
    clean = denoise_lightmap(atlas, charts)
    assert not clean[charts != 0].any()
    assert not denoise_lightmap(np.zeros_like(atlas), charts).any()
    assert not denoise_lightmap(atlas, np.full_like(charts, -1)).any()


def test_charts_in_one_anothers_boxes_keep_their_texels():
    """An L and the square in its corner."""
    charts = np.zeros((20, 20), dtype=np.int32)
    charts[8:, 8:] = 1
    atlas = np.where(charts[..., None] == 1, 5.0, 0.1).astype(np.float32) * np.ones(3, dtype=np.float32)
    clean = denoise_lightmap(atlas, charts)
    np.testing.assert_allclose(clean[charts == 0], 0.1, rtol=0.05)
    np.testing.assert_allclose(clean[charts == 1], 5.0, rtol=0.05)


def test_boxes_on_shelves_do_not_overlap():
    sides = np.random.default_rng(2).integers(1, 40, (200, 2))
    corners, (height, width) = shelved(sides)
    taken = np.zeros((height, width), dtype=int)
    for (row, column), (high, wide) in zip(corners, sides, strict=True):
        taken[row : row + high, column : column + wide] += 1
    assert taken.max() == 1
    assert taken.sum() == sides.prod(axis=1).sum()
    assert taken.mean() > 0.7


def test_a_single_box():
    corners, size = shelved(np.array([[3, 200]]))
    assert corners.tolist() == [[0, 0]]
    assert size == (3, 200)
