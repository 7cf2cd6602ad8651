"""What numbers of a room are divided by, in closed form."""

from __future__ import annotations

import pytest
import torch

from gibench.baselines.moving_light.measure import Measure
from tests.baselines.neural_global_illumination.test_inputs import AREA, frame


def test_the_measure_of_a_room():
    images = frame()
    found = Measure.of_frames([(images, AREA)])
    both = torch.cat([images["position"].flatten(1), images["reflected_position"].flatten(1)], dim=1)
    for k in range(3):
        assert found.centre[k] - found.half[k] == pytest.approx(float(both[k].min()), abs=1e-5)
        assert found.centre[k] + found.half[k] == pytest.approx(float(both[k].max()), abs=1e-5)
    light = (images["indirect_diffuse"] + images["indirect_specular"])[:2] / torch.tensor([4.0, 2.0])[
        :, None, None
    ]
    assert found.indirect == pytest.approx(float(light.sum() / (3 * 20)) / AREA.area, rel=1e-5)
    assert Measure.of_facts(found.facts()) == found
    dark = {name: torch.zeros_like(image) for name, image in images.items()}
    assert Measure.of_frames([(dark, AREA)]) == Measure((0.0,) * 3, (1.0,) * 3, 1.0, 1.0)
