"""What `nfvr` alone can: other numbers of wavelets without another training."""

from __future__ import annotations

import numpy as np

from gibench.baselines.neural_free_viewpoint_relighting import METHOD
from gibench.baselines.neural_free_viewpoint_relighting.implementation import NeuralRelighting
from gibench.baselines.wavelets.selection import largest
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
