"""Source of a report: the tables and images of a run, as `gibench.benchmarks.results` reads them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gibench.errors import GibenchError

if TYPE_CHECKING:
    import pandas as pd

PREPARATION = ("lightmap", "probes", "references", "training")
"""Kinds of preparation; the columns are prepare_<name>_s."""

PARTS = {
    "full": "Full image",
    "indirect": "Indirect light",
    "diffuse": "Diffuse part",
    "specular": "Specular part",
}
"""Scored parts of an image, with their names for readers."""


class ReportError(GibenchError):
    """A report that cannot be made from these results, or not as asked."""


class ReportSource(Protocol):
    """A run's tables, and its images when they are asked for.

    run: track, preset, seed, machine (a mapping), created, unbiased (metrics against the truth). results: a row a
    result, that is (scene, method, knobs, seed). stages: milliseconds per frame by result and stage. frames: metric
    values by result, frame and part. sequences: values of metrics in time by result and part. floor: what each
    metric says of a second, independent reference, by scene, frame and part. extras: numbers that methods say of their
    frames. curves: looks at the held-out error of
    trainings, a row a look. paths: which frames of a scene follow each other.
    """

    @property
    def root(self) -> Path:
        """Folder of the results."""

    @property
    def run(self) -> Mapping[str, Any]:
        """Record of the run: track, machine, dates."""

    @property
    def results(self) -> pd.DataFrame:
        """Columns result, track, scene, method, title, family, label, knobs, seed, status, reason, ms_median, …"""

    @property
    def stages(self) -> pd.DataFrame:
        """Columns result, stage, ms_median, ms_p95."""

    @property
    def frames(self) -> pd.DataFrame:
        """Columns result, frame, ms, metric, part, value."""

    @property
    def sequences(self) -> pd.DataFrame:
        """Columns result, metric, part, value."""

    @property
    def floor(self) -> pd.DataFrame:
        """Columns scene, frame, metric, part, value."""

    @property
    def extras(self) -> pd.DataFrame:
        """Columns result, frame, name, value."""

    @property
    def curves(self) -> pd.DataFrame:
        """Columns result, training, step, seconds, error."""

    @property
    def paths(self) -> pd.DataFrame:
        """Columns scene, frame, sequence: the name of the sequence that the frame lies in, "" for a still."""

    def prediction(self, result: str, frame: int, part: str) -> NDArray[np.float32]:
        """Prediction of a method, (H, W, 3), linear radiance."""

    def reference(self, scene: str, frame: int, part: str) -> NDArray[np.float32]:
        """Reference, (H, W, 3), linear radiance."""

    def exposure(self, scene: str, frame: int) -> float:
        """The factor from radiance to display values of a frame of a scene."""
