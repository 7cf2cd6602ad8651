"""Area lights in the room of `material_strips`, and frames of methods under them."""

from __future__ import annotations

import numpy as np

from gibench.baselines.method import View
from gibench.baselines.stages import Stages
from gibench.rendering.lighting import AreaLight, Lighting, Shot
from tests.baselines.material_strips import CAMERA

LIGHT = AreaLight((0.0, 0.0, 1.8), (0, 0.1, -1), 0.6, 0.6, (5, 4, 3))

HARD_LIGHTS = [
    AreaLight((0.0, 1.5, 1.0), (0, -1, 0), 0.6, 0.6, (5, 4, 3)),  # in a wall
    AreaLight((0.0, 0.0, -0.5), (0, 0, -1), 0.6, 0.6, (5, 4, 3)),  # seen by no surface
    AreaLight((0.0, -1.8, 1.0), (0, -1, 0), 3.0, 3.0, (5, 4, 3)),  # fills the view
    AreaLight((0.0, 0.0, 1.8), (0, 0, -1), 0.01, 0.01, (5, 4, 3)),
]


def lit_frame(rig, method, light, resolution, stages, camera=CAMERA):
    """A frame of a prepared method, finite and not negative, in just these stages beside those of direct light."""
    rig.set(Lighting(area=light))
    taken = Stages()
    found = method.render(View(Shot(camera, Lighting(area=light)), None, resolution, 0, 0), taken)
    assert {"g-buffer", "shadow rays", "filtering", *stages} == set(taken.seconds)
    for image in (found.color, found.indirect):
        assert image.shape == (resolution[1], resolution[0], 3)
        assert np.isfinite(image).all()
        assert (image >= 0).all()
    return found
