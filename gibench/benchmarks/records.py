"""Schemas of the files of a run, checked before anything is made of them; see `gibench.datasets.checked`."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from gibench.benchmarks.predictions import LAYERS
from gibench.datasets.checked import Amount, Checked, Count, Fingerprint, Name, Sha256, shown
from gibench.datasets.errors import nearest
from gibench.metrics import METRICS

Text = Annotated[str, Field(max_length=4000)]
Setting = bool | int | float | str
Id = Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]


def _part(name: str) -> str:
    if name not in LAYERS:
        raise ValueError(f"there is no part {shown(name)}; {nearest(name, LAYERS)}")
    return name


def _metric(name: str) -> str:
    if name not in METRICS:
        raise ValueError(f"there is no metric {shown(name)}; {nearest(name, METRICS)}")
    return name


def _metric_or_side(name: str) -> str:
    return _metric(name.removesuffix("_prediction").removesuffix("_reference")) and name


Part = Annotated[str, AfterValidator(_part)]
"""Part of an image that is scored: "full", "specular" …"""

Metric = Annotated[str, AfterValidator(_metric)]
"""A metric that there is: it becomes part of a file's name, and is looked up."""

MetricOrSide = Annotated[str, AfterValidator(_metric_or_side)]
"""The same, or what it measured in the prediction or the reference alone."""


class Machine(Checked):
    """Facts of a machine that times depend on. All others are for people."""

    cpu: str
    cores: Count | None
    threads: Count
    gpu: str | None
    variant: str
    versions: dict[str, str | None]


class ThisMachine(Machine):
    """The machine of the last command, with its id."""

    id: str


class EqualTime(Checked):
    """Result of a search for a setting of a given time."""

    ms: Amount
    method: Name
    machine: str
    label: str | None
    tried: dict[str, Amount | None]


class Run(Checked):
    """`run.json`."""

    format: int
    track: Name
    preset: str
    seed: Count
    parts: Annotated[list[Part], Field(min_length=1)]
    metrics: list[Metric]
    sequence_metrics: list[Metric]
    created: str
    command: str
    equal_time: list[EqualTime]
    runs: list[dict[str, Any]]
    asked: dict[Id, str] = Field(default_factory=dict)
    identity: dict[str, Any]
    base_settings: dict[str, dict[str, Setting]] = Field(default_factory=dict)
    machine: ThisMachine
    machines: dict[str, Machine] = Field(default_factory=dict)


class Config(Checked):
    """Configuration that a result is keyed by."""

    track: Name
    scene: Name
    scene_sha256: Sha256
    frames: Count
    method: Name
    knobs: dict[str, Setting]
    seed: Count
    machine: str


class FrameTime(Checked):
    """Times of a frame, in seconds."""

    seconds: Amount
    stages: Annotated[dict[str, Amount], Field(max_length=100)]
    lighting_seconds: Amount = 0.0


class Look(Checked):
    """A look at the held-out error of a training."""

    step: Count
    seconds: Amount
    error: float | None


class Bake(Checked):
    """Something baked that a preparation used."""

    kind: str
    seconds: Amount
    bytes: Count


class Prepare(Checked):
    """Cost of a preparation, in seconds and bytes."""

    seconds: Amount
    bytes: Count
    wall_seconds: Amount
    stages: dict[str, Amount] = Field(default_factory=dict)
    bakes: list[Bake] = Field(default_factory=list)
    lightmap: Amount = 0.0
    probes: Amount = 0.0
    references: Amount = 0.0
    training: Amount = 0.0
    curves: list[list[Look]] = Field(default_factory=list)
    beside: Count = 0


class Result(Checked):
    """A result, whole or failed."""

    format: int
    id: Id
    key: Sha256
    config: Config
    title: Text
    family: Text
    label: Text
    room: Count
    tags: list[list[str]] = Field(default_factory=list)
    kind: str
    created: str
    machine: Machine
    status: Literal["ok", "failed"]
    reason: str = ""
    traceback: str = ""
    log: str = ""
    prepare: Prepare | None = None
    frames: list[FrameTime] = Field(default_factory=list)
    files: dict[Annotated[str, Field(pattern=r"^[0-9]{4,6}\.exr$")], Fingerprint] = Field(
        default_factory=dict
    )
    peak_mb: Amount | None = None
    gpu_mb: Amount | None = None

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if self.status == "ok" and not len(self.frames) == len(self.files) == self.config.frames > 0:
            raise ValueError(
                f"its path has {self.config.frames} frames, and it holds {len(self.frames)} times and "
                f"{len(self.files)} files"
            )
        return self


class Scores(Checked):
    """The scores of a result, or of the references themselves. None stands for what has no value.

    references: hash of what they are against, None in files of before. codes: digest of the sources by which a metric
    was computed. unbiased: metrics that are against the truth, by samples that were not denoised. clipped: of these,
    how many values stand as 0 for an estimate below it.
    """

    format: int
    frames: dict[Part, dict[Metric, list[float | None]]]
    sequences: dict[Part, dict[str, dict[MetricOrSide, float | None]]]
    skipped: dict[str, str]
    references: Sha256 | None = None
    exposures: list[Annotated[float, Field(gt=0)]] = Field(default_factory=list)
    codes: dict[str, str] = Field(default_factory=dict)
    unbiased: list[Metric] = Field(default_factory=list)
    clipped: dict[Metric, Count] = Field(default_factory=dict)
