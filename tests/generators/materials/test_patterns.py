"""The geometry under the textures: joints, cells and blocks."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gibench.generators.materials.cells import cells
from gibench.generators.materials.joints import joint_cover
from gibench.generators.materials.parquet import _LAYOUTS


@pytest.mark.parametrize("phase", [0.0, 0.25, 0.5, 0.8])
@pytest.mark.parametrize("width", [0.001, 0.004, 0.013])
def test_joints_cover_their_share_wherever_texels_fall(width, phase):
    length, texel = 0.3, 0.005
    position = (np.arange(60) + phase) * texel / length % 1
    cover = joint_cover(position, length, width, texel)
    assert cover.min() >= 0
    assert cover.max() <= 1
    assert cover.sum() * texel == pytest.approx(width, rel=1e-9)


def test_cells_against_a_search_over_all_points():
    count, shape = 16, (96, 128)
    found = cells(np.random.default_rng(5), shape, count)
    points = np.random.default_rng(5).uniform(0.1, 0.9, (2, count, count)).astype(np.float32)
    rows, columns = np.indices((count, count))
    everywhere = np.stack([points[0] + rows, points[1] + columns], -1).reshape(-1, 2).astype(np.float64)
    v, u = np.indices(shape) + 0.5
    query = np.stack([v * count / shape[0], u * count / shape[1]], -1)
    distance, number = cKDTree(everywhere, boxsize=count).query(query, k=2)
    agree = found.number == number[..., 0]
    assert agree.mean() > 0.999
    assert found.nearest == pytest.approx(distance[..., 0], abs=2e-3)
    assert np.quantile(np.abs(found.second - distance[..., 1]), 0.99) < 1e-3


@pytest.mark.parametrize("ratio", [3, 4, 6])
@pytest.mark.parametrize("pattern", ["herringbone", "basket"])
def test_parquet_blocks_are_whole_rectangles(pattern, ratio):
    period = ratio * (4 if pattern == "basket" else 2)
    fine = 8
    at = (np.arange(period * fine) + 0.5) / fine
    u, v = np.meshgrid(at, at)
    upright, block, along, across = _LAYOUTS[pattern](u, v, ratio)
    assert ((along >= 0) & (along <= ratio) & (across >= 0) & (across <= 1)).all()
    counts = np.bincount(block.ravel())
    assert (counts == ratio * fine * fine).all()  # every block has its whole area in one tile, none is cut
    for number in range(len(counts)):
        mine = block == number
        assert len(np.unique(upright[mine])) == 1
        # Position along the block takes each of its values equally often: no piece is missing or doubled.
        assert (np.unique(np.round(along[mine] * fine - 0.5), return_counts=True)[1] == fine).all()
