"""Where a step looks, and which wavelets it is told of."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from gibench.baselines.neural_free_viewpoint_relighting.draws import NEXT, Disagreement, Draw, spread
from gibench.baselines.relighting.examples import Seen
from gibench.baselines.wavelets.haar import haar
from gibench.baselines.wavelets.selection import largest
from gibench.generators.environments.files import environment_files, read_environment
from gibench.rendering.cubemap import cube_directions, texel_solid_angles, to_cubemap
from tests.baselines.neural_free_viewpoint_relighting.made import Made


def frame(truth, material=None, detail=None, points=None):
    count = len(truth)
    matt = torch.zeros(count, 13)
    matt[:, 6] = 1.0
    return Seen(
        torch.linspace(0.01, 0.99, count)[:, None].expand(-1, 3) if points is None else points,
        matt if material is None else material,
        truth[:, None].expand(-1, 3),
        torch.zeros(count) if detail is None else detail,
    )


def drawn(seen, disagreement, pixels=400):
    """How often each pixel is drawn."""
    draw = Draw(pixels, 8, disagreement)
    return np.bincount(draw._drawn(seen, np.random.default_rng(0)), minlength=len(seen.points))


def test_a_quarter_each_where_views_disagree_where_there_is_detail_and_gloss():
    one, other = torch.full((40,), 0.5), torch.full((40,), 0.5)
    other[7] = 3.0  # seen otherwise from elsewhere
    detail = torch.zeros(40)
    detail[11] = 0.3
    material = frame(one).material.clone()
    material[20, 6], material[20, 10:] = 0.05, 0.9
    seen = frame(one, material, detail)
    counts = drawn(seen, Disagreement([seen, frame(other)]))
    assert counts.sum() == 400
    assert counts[7] > 90  # beside its share of the uniform quarter
    assert counts[11] >= 100
    assert counts[20] >= 100
    others = np.delete(counts, [7, 11, 20])
    assert 50 < others.sum() < 110


def test_without_importance_and_without_anything_important_all_pixels_are_alike():
    seen = frame(torch.full((40,), 0.5))
    for disagreement in (None, Disagreement([seen])):
        counts = drawn(seen, disagreement, 4000)
        assert counts.min() > 60
        assert counts.max() < 150


def test_a_brighter_environment_is_no_disagreement():
    light = torch.linspace(0.1, 0.2, 40)
    found = Disagreement([frame(light), frame(light + 1e-4)]).at(frame(light).points)
    assert found.max() < 1e-6


def test_half_of_the_wavelets_are_the_largest_by_area_and_none_comes_twice():
    seen, coefficients = Made(1)[0]
    example = Draw(16, 40, None)((seen, coefficients), np.random.default_rng(1))
    places = example.inputs[2].numpy()
    assert len(np.unique(places)) == 40
    np.testing.assert_array_equal(places[:20], largest(coefficients, 20, "area"))
    assert example.inputs[3].shape == (40, 3)
    assert example.truth.shape == (16, 3)
    again = Draw(16, 40, None)((seen, coefficients), np.random.default_rng(1))
    assert torch.equal(again.inputs[2], example.inputs[2])
    few = Draw(16, 1000, None)((seen, coefficients), np.random.default_rng(1))  # of 96
    assert len(np.unique(few.inputs[2].numpy())) == 96


@pytest.fixture(scope="module")
def irradiance():
    """Wavelets (6·32², 20) of cosine lobes that face twenty ways."""
    axes = np.random.default_rng(0).normal(size=(20, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    cosines = np.maximum(cube_directions(32) @ axes.T, 0) * texel_solid_angles(32)[..., None]
    return haar(cosines).reshape(-1, 20)


@pytest.mark.parametrize("name", ["workshop", "brown_photostudio_02"])
def test_the_light_of_a_step_is_the_light_of_its_frame(irradiance, name):
    """The irradiance that 20 surfaces get from the wavelets of a step, beside that from the whole of a real map."""
    (file,) = environment_files(name)
    coefficients = haar(to_cubemap(read_environment(file.path), 32).astype(np.float64))
    places = Draw(16, 96, None)._places(coefficients, np.random.default_rng(0))
    light = coefficients.reshape(-1, 3)
    share = (irradiance[places].T @ light[places]) / (irradiance.T @ light)
    assert (
        np.abs(share - 1).mean() < 0.1
    )  # by magnitude alone they hold half of that of the workshop, 3/4 of the other
    assert np.abs(share - 1).max() < 0.2


def test_a_quarter_of_the_wavelets_come_next_and_a_quarter_are_any():
    coefficients = haar(np.random.default_rng(0).gamma(0.5, size=(6, 32, 32, 3)))
    in_order = largest(coefficients, 6 * 32**2, "area")
    rank = np.argsort(in_order)
    places = Draw(16, 96, None)._places(coefficients, np.random.default_rng(0))
    assert len(np.unique(places)) == 96
    assert (np.sort(rank[places[:48]]) == np.arange(48)).all()
    assert (rank[places[48:72]] < 48 + NEXT).all()
    assert (rank[places[72:]] >= 48 + NEXT).any()


def test_a_frame_that_sees_nothing_is_black():
    seen, coefficients = Made(1)[0]
    empty = Seen(*(part[:0] for part in seen))
    example = Draw(16, 8, Disagreement([empty]))((empty, coefficients), np.random.default_rng(0))
    assert not example.truth.any()
    assert not example.inputs[3].any()
    assert spread((empty, coefficients), 10, 8).inputs[0].shape == (0, 3)


@pytest.mark.parametrize(("pixels", "count"), [(10, 10), (10**6, 200)])
def test_held_out_pixels_are_spread_evenly(pixels, count):
    example = spread(Made(1)[0], pixels, 16)
    assert example.inputs[0].shape == (count, 3)
    assert len(torch.unique(example.inputs[0], dim=0)) == count
    assert example.inputs[3].shape == (16, 3)
