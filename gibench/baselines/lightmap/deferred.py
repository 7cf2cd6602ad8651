"""Base of the methods on the lightmap: settings, a finer grid of camera rays, and kernels that are replayed."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, ClassVar

from gibench.baselines.lightmap.bake import baked_lightmap
from gibench.baselines.method import Setting, Site, View
from gibench.rendering.replay import Replay, arrays_of


class OnLightmap:
    """A method whose kernels read the scene and its lightmap.

    functions: what is recorded, by name: functions of the scene, the lightmap and what changes from frame to frame.
    They are no methods: a recording that held its owner would be a cycle for Python's collector to find at its leisure.
    """

    functions: ClassVar[Mapping[str, Callable[..., Any]]] = {}

    def __init__(self, settings: Mapping[str, Setting]) -> None:
        """settings: all knobs of the method."""
        self.adjust(settings)

    def adjust(self, settings: Mapping[str, Setting]) -> None:
        """Take other settings that do not bake."""
        self.settings = dict(settings)
        self.grid = math.isqrt(int(settings["rays"]))

    def prepare(self, site: Site) -> None:
        """Bake the lightmap or find it."""
        lightmap = baked_lightmap(site, self.settings)
        held = arrays_of(lightmap)
        self.kernels = {
            name: Replay(site.scene, partial(function, site.scene, lightmap), held)
            for name, function in self.functions.items()
        }

    def fine(self, view: View) -> tuple[int, int]:
        """(width, height) of the grid of camera rays."""
        return view.resolution[0] * self.grid, view.resolution[1] * self.grid
