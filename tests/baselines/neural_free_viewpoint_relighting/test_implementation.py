"""What `nfvr` alone can: other numbers of wavelets without another training."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gibench.baselines.neural_free_viewpoint_relighting import METHOD
from gibench.baselines.neural_free_viewpoint_relighting.implementation import NeuralRelighting
from gibench.baselines.wavelets.selection import energy_kept, largest
from gibench.rendering.lighting import EnvironmentMap
from gibench.rendering.panoramas import Panorama

SMALL = {"network": "small", "faces": 16, "table": 12}


def test_fewer_and_more_wavelets_need_no_training():
    pixels = np.random.default_rng(0).uniform(0, 2, (32, 64, 3))
    method = NeuralRelighting(METHOD.settings(SMALL))
    light = method.light_of(EnvironmentMap(Panorama.of("made", pixels)))
    trained = METHOD.trained_settings(METHOD.settings(SMALL))
    for count in (16, 64, 256):
        for selection in ("none", "area"):
            settings = METHOD.settings({**SMALL, "wavelets": count, "selection": selection})
            assert METHOD.trained_settings(settings) == trained
            method.adjust(settings)
            places, weights = method.told(light)
            assert weights.shape == (count, 3)
            np.testing.assert_array_equal(places.numpy(), largest(light, count, selection))


def test_frames_say_how_much_the_selection_holds_and_how_it_flickers():
    pixels = np.random.default_rng(1).uniform(0, 2, (32, 64, 3))
    method = NeuralRelighting(METHOD.settings({**SMALL, "wavelets": 32}))
    first, following = SimpleNamespace(previous=None), SimpleNamespace(previous="a shot")
    chosen = []
    for number in range(2):
        light = method.light_of(EnvironmentMap(Panorama.of("made", pixels), rotation=0.2 * number))
        told = method.told(light)
        chosen.append(told[0].numpy())
        said = method.numbers(following if number else first, light, told)
        assert said["energy"] == pytest.approx(energy_kept(light, largest(light, 32, "area")))
        assert 0 < said["energy"] < 1
        assert ("replaced" in said) == bool(number)
    assert said["replaced"] == len(set(chosen[1]) - set(chosen[0])) / 32 > 0
    assert method.numbers(following, light, method.told(light))["replaced"] == 0
