"""Boxes around what training frames see."""

from __future__ import annotations

import pytest
import torch

from gibench.baselines.relighting.surfaces import Box


def test_the_box_holds_all_places_and_comes_back_from_facts():
    generator = torch.Generator().manual_seed(0)
    places = [torch.rand(20, 3, generator=generator) * torch.tensor([4.0, 2.0, 0.0]) for _ in range(3)]
    box = Box.around([*places, torch.zeros(0, 3)])
    inside = torch.cat([box.inside(some) for some in places])
    assert ((inside > 0) & (inside < 1)).all()
    assert inside[:, :2].amax() > 0.99
    assert Box.of_facts(box.facts()) == box
    assert box.inside(torch.tensor([[9.0, -9.0, 0.0]]))[0, :2].tolist() == [1.0, 0.0]


def test_nothing_was_seen():
    assert Box.around([]).size == pytest.approx((1, 1, 1), rel=1e-2)
