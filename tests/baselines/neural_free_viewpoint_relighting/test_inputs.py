"""What the network is given of a pixel, against closed forms."""

from __future__ import annotations

import math

import pytest
import torch

from gibench.baselines.neural_free_viewpoint_relighting.inputs import coded
from gibench.baselines.relighting.surfaces import hit, surfaces
from gibench.rendering.camera import PinholeCamera

EYE = PinholeCamera((0.0, -1.0, 1.0), (0.0, 0.0, 0.0), 1.0)


def images(**channels):
    """Two pixels: one sees a floor at the origin, one sees nothing."""
    found = {name: torch.zeros(3, 1, 2) for name in ("position", "normal", "albedo", "specular_albedo")}
    found["roughness"] = torch.zeros(1, 1, 2)
    found["normal"][:, 0, 0] = torch.tensor([0.0, 0.0, 1.0])
    for name, value in channels.items():
        found[name][:, 0, 0] = torch.tensor(value)
    return found


def test_the_eye_is_mirrored_by_the_surface():
    given = images(roughness=[0.04], albedo=[0.1, 0.2, 0.3], specular_albedo=[0.5, 0.6, 0.7])
    seen = hit(given)
    assert seen.tolist() == [[True, False]]
    place, material = surfaces(given, EYE, seen)
    assert place.shape == (1, 3)
    expected = torch.tensor([[0, 0, 1, 0, 0.5**0.5, 0.5**0.5, 0.04, 0.1, 0.2, 0.3, 0.5, 0.6, 0.7]])
    torch.testing.assert_close(material, expected)
    code = coded(material, None)
    torch.testing.assert_close(code[0, :3], torch.tensor([0.5, 0.5, 1.0]))
    assert code[0, 6] == pytest.approx(math.log(2) / math.log(26))
    torch.testing.assert_close(code[0, 7:10], torch.tensor([-0.8, -0.6, -0.4]))
    assert coded(material, 3).shape == (1, 13 + 16)


def test_rough_surfaces_and_mirrors_are_told_apart():
    material = torch.zeros(4, 13)
    material[:, 6] = torch.tensor([0.0, 0.005, 0.05, 1.0])
    code = coded(material, None)[:, 6]
    assert code[0] == 0
    assert code[3] == pytest.approx(1)
    assert (code.diff() > 0.03).all()
    assert coded(material, 3).isfinite().all()


def test_the_eye_at_the_surface_gives_finite_numbers():
    place, material = surfaces(images(position=[0.0, -1.0, 1.0]), EYE, hit(images()))
    assert place.isfinite().all()
    assert coded(material, 3).isfinite().all()
