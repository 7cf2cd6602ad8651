"""Where a step looks, and which wavelets it is told of."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from gibench.baselines.neural_free_viewpoint_relighting import draws
from gibench.baselines.neural_free_viewpoint_relighting.draws import (
    NEXT,
    Disagreement,
    Draw,
    Important,
    spread,
    sums_of,
)
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


class Frames(Made):
    """Some frames, under noise."""

    def __init__(self, *frames):
        super().__init__(1)
        ((_, light),) = self.frames
        self.frames = [(seen, light) for seen in frames]


def drawn(examples, pixels=400):
    """How often each pixel of the first of them is drawn."""
    seen, _, *sums = examples[0]
    draw = Draw(pixels, 8)
    found = draw._drawn(len(seen.points), sums[0] if sums else None, np.random.default_rng(0))
    return np.bincount(found, minlength=len(seen.points))


def test_a_quarter_each_where_views_disagree_where_there_is_detail_and_gloss():
    one, other = torch.full((40,), 0.5), torch.full((40,), 0.5)
    other[7] = 3.0  # seen otherwise from elsewhere
    detail = torch.zeros(40)
    detail[11] = 0.3
    material = frame(one).material.clone()
    material[20, 6], material[20, 10:] = 0.05, 0.9
    seen = frame(one, material, detail)
    counts = drawn(Important(Frames(seen, frame(other))))
    assert counts.sum() == 400
    assert counts[7] > 90  # beside its share of the uniform quarter
    assert counts[11] >= 100
    assert counts[20] >= 100
    others = np.delete(counts, [7, 11, 20])
    assert 50 < others.sum() < 110


def test_without_importance_and_without_anything_important_all_pixels_are_alike():
    seen = frame(torch.full((40,), 0.5))
    for examples in (Frames(seen), Important(Frames(seen))):
        counts = drawn(examples, 4000)
        assert counts.min() > 60
        assert counts.max() < 150


def test_chances_are_summed_up_once_a_frame(monkeypatch):
    asked = []
    monkeypatch.setattr(draws, "sums_of", lambda chances: asked.append(1) or sums_of(chances))
    examples = Important(Made(2))
    draw, random = Draw(16, 8), np.random.default_rng(0)
    for index in (0, 1, 0, 1, 0):
        draw(examples[index], random)
    assert len(asked) == 2
    assert examples[0][2] is examples[0][2]
    assert (
        examples[0][2].dtype == np.float32
    )  # as the random numbers are, or each search would convert all of it
    monkeypatch.setattr(draws, "MOST_SUMS", 1)
    few = Important(Made(2))
    assert few[0][2] is not few[0][2]


def test_pixels_without_a_chance_are_never_drawn_and_others_as_often_as_theirs_says():
    chances = np.array([[0.0, 1.0, 0.0, 3.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0], [1e-30, 0.0, 0.0, 0.0, 1e-30]])
    sums = sums_of(chances)
    count = 40_000
    found = [
        np.bincount(draws._by_chance(row, count, np.random.default_rng(0)), minlength=5) / count
        for row in sums
    ]
    np.testing.assert_allclose(found, [[0, 0.25, 0, 0.75, 0], [0.2] * 5, [0.5, 0, 0, 0, 0.5]], atol=0.01)
    assert not found[0][[0, 2, 4]].any()


def test_a_brighter_environment_is_no_disagreement():
    light = torch.linspace(0.1, 0.2, 40)
    found = Disagreement([frame(light), frame(light + 1e-4)]).at(frame(light).points)
    assert found.max() < 1e-6


def test_half_of_the_wavelets_are_the_largest_by_area_and_none_comes_twice():
    seen, coefficients = Made(1)[0]
    example = Draw(16, 40)((seen, coefficients), np.random.default_rng(1))
    places = example.inputs[2].numpy()
    assert len(np.unique(places)) == 40
    np.testing.assert_array_equal(places[:20], largest(coefficients, 20, "area"))
    assert example.inputs[3].shape == (40, 3)
    assert example.truth.shape == (16, 3)
    again = Draw(16, 40)((seen, coefficients), np.random.default_rng(1))
    assert torch.equal(again.inputs[2], example.inputs[2])
    few = Draw(16, 1000)((seen, coefficients), np.random.default_rng(1))  # of 96
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
    places = Draw(16, 96)._places(coefficients, np.random.default_rng(0))
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
    places = Draw(16, 96)._places(coefficients, np.random.default_rng(0))
    assert len(np.unique(places)) == 96
    assert (np.sort(rank[places[:48]]) == np.arange(48)).all()
    assert (rank[places[48:72]] < 48 + NEXT).all()
    assert (rank[places[72:]] >= 48 + NEXT).any()


def test_a_frame_that_sees_nothing_is_black():
    seen, coefficients = Made(1)[0]
    empty = Seen(*(part[:0] for part in seen))
    example = Draw(16, 8)(Important(Frames(empty))[0], np.random.default_rng(0))
    assert not example.truth.any()
    assert not example.inputs[3].any()
    assert spread((empty, coefficients), 10, 8).inputs[0].shape == (0, 3)


@pytest.mark.parametrize(("pixels", "count"), [(10, 10), (10**6, 200)])
def test_held_out_pixels_are_spread_evenly(pixels, count):
    example = spread(Made(1)[0], pixels, 16)
    assert example.inputs[0].shape == (count, 3)
    assert len(torch.unique(example.inputs[0], dim=0)) == count
    assert example.inputs[3].shape == (16, 3)
