"""The naive lookup: glossy light as the nearest probe sees it on the same point.

Guo et al. 2022 ("Efficient Light Probes for Real-time Global Illumination"), section 4.3 and Figure 6: the shading
point and the probe are connected directly. Reflections are those that the probe sees, so they stand still where they
should move with the camera, and nothing asks whether the probe sees the point at all.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import drjit as dr
import mitsuba as mi

from gibench.baselines.method import Setting
from gibench.baselines.probes.deferred import ProbeLookup
from gibench.baselines.probes.maps import Probes


class NearestProbe(ProbeLookup):
    """Method `nearest-probe`."""

    @staticmethod
    def glossy(probes: Probes, point: Any, camera: Any, active: Any, settings: Mapping[str, Setting]) -> Any:
        """Bilinear lookup in the probe nearest to the camera."""
        probe = probes.nearest(camera, 1)[0]
        dr.eval(probe)  # one search a frame, not one a point
        return mi.Color3f(probes.bilinear("radiance", probe, point - probes.position(probe), active))
