"""What numbers of a room are divided by, in closed form."""

from __future__ import annotations

import pytest
import torch

from gibench.baselines.moving_light.measure import BESIDE, FARTHEST, THINNEST, Measure
from tests.baselines.neural_global_illumination.test_inputs import AREA, frame

PLACES = [(0.0, 1.0, 1.5), (4.0, 5.0, 0.5), (2.0, 2.0, 2.5)]


def test_the_measure_of_a_room():
    images = frame()
    found = Measure.of_frames(PLACES, [(images, AREA)])
    assert found.centre == pytest.approx((2, 3, 1.5))
    assert found.half == pytest.approx((2 * BESIDE, 2 * BESIDE, BESIDE))
    light = (images["indirect_diffuse"] + images["indirect_specular"])[:2] / torch.tensor([4.0, 2.0])[
        :, None, None
    ]
    assert found.indirect == pytest.approx(float(light.sum() / (3 * 20)) / AREA.area, rel=1e-5)
    assert Measure.of_facts(found.facts()) == found
    dark = {name: torch.zeros_like(image) for name, image in images.items()}
    assert Measure.of_frames([(1, 2, 3)], [(dark, AREA)]) == Measure((1.0, 2.0, 3.0), (1.0,) * 3, 1.0, 1.0)
    flat = Measure.of_frames([(0, 0, 1), (4, 2, 1)], [(images, AREA)])
    assert flat.half == pytest.approx((2 * BESIDE, BESIDE, 2 * BESIDE * THINNEST))


def test_what_a_window_shows_is_no_part_of_the_room():
    images = frame()
    found = Measure.of_frames(PLACES, [(images, AREA)])
    images["position"][:, 0, 0] = torch.tensor([1000.0, -1000.0, 0.0])
    assert Measure.of_frames(PLACES, [(images, AREA)]) == found
    inside = found.inside(images["position"])
    assert inside[:, 0, 0].tolist() == pytest.approx([FARTHEST, -FARTHEST, -1.2])
    near = found.nearest(images["position"])
    torch.testing.assert_close(found.inside(near), inside)
    # Lights and cameras are apart from each other as networks are given them.
    places = found.inside(torch.tensor(PLACES).T[:, :, None])
    assert places.std(dim=1).min() > 0.4
