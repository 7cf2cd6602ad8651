"""The method `direct`: what is emitted, and light that was scattered once."""

from __future__ import annotations

from typing import ClassVar

from gibench.baselines.path_traced.tracer import PathTracer


class DirectLight(PathTracer):
    """See `gibench.baselines.direct_light.METHOD`."""

    max_depth: ClassVar[int | None] = 1
