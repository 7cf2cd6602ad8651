"""Tracks: the questions that a benchmark asks, as TOML files that are checked before anything is made."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from gibench.baselines.method import Method
from gibench.benchmarks.errors import TrackError
from gibench.datasets.checked import Name
from gibench.datasets.errors import RecipeError, nearest
from gibench.datasets.recipes import Recipe, check_recipe
from gibench.metrics import METRICS

Names = Annotated[tuple[str, ...], Field(strict=False)]
Part = Literal["full", "specular"]
Value = int | float | str | bool

#: Channels of a frame of the path without which nothing can be scored: the parts, and what tells which pixels the
#: frame before shows too.
SCORED = (
    "color",
    "direct_specular",
    "indirect_specular",
    "position",
    "shape_id",
    "motion",
    "motion_valid",
)


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Budget(_Strict):
    """What a result may take before it counts as failed, seconds.

    prepare: of a preparation. render: of all frames of one setting, warm-up included.
    """

    prepare: float = Field(gt=0)
    render: float = Field(gt=0)


class MethodPlan(_Strict):
    """Settings of a method that a preset runs.

    base: knobs that differ from the method's own defaults. vary: knob → values; all combinations are run. What
    neither names is at the method's default.
    """

    base: dict[str, Value] = {}
    vary: dict[str, Annotated[tuple[Value, ...], Field(strict=False, min_length=1)]] = {}


class Preset(_Strict):
    """One size of a track.

    rooms: how many scenes. seed: decides the rooms. seeds: of the methods; those that are not trained run the first
    alone. warmup: frames rendered before the clock counts. room: keys of a recipe that training views and references
    share. training, reference: keys of the recipe of either; references are rendered twice. knobs: values for every
    method that has a knob of that name, so that all share what is baked. methods: by id; a method that is not named
    runs at its defaults.
    """

    rooms: int = Field(ge=1)
    seed: int = Field(0, ge=0)
    seeds: Annotated[tuple[int, ...], Field(strict=False, min_length=1)] = (0,)
    warmup: int = Field(ge=0)
    room: dict[str, Any]
    training: dict[str, Any]
    reference: dict[str, Any]
    budget: Budget
    knobs: dict[str, Value] = {}
    methods: dict[str, MethodPlan] = {}

    def plan(self, method: Method) -> MethodPlan:
        """What this preset runs of a method."""
        plan = self.methods.get(method.id, MethodPlan())
        shared = {knob.name: self.knobs[knob.name] for knob in method.knobs if knob.name in self.knobs}
        return MethodPlan(base={**shared, **plan.base}, vary=plan.vary)

    @property
    def path_frames(self) -> int:
        """Frames of the path that are scored."""
        return int(self.room["path_views"])

    def recipe(
        self,
        which: Literal["training", "reference", "reference-again"],
        rooms: int | None = None,
        scenes: Mapping[str, Any] | None = None,
    ) -> Recipe:
        """The recipe of the training views, or of the frames on the path, once or once more with other samples.

        All make the same rooms: what decides a room and its cameras is in `room`. scenes: keys of a recipe that put
        scene files in the place of rooms. Raises TrackError.
        """
        own = self.training if which == "training" else self.reference
        values = {
            **self.room,
            **own,
            "rooms": rooms or self.rooms,
            "seed": self.seed,
            "rendered": "stills" if which == "training" else "path",
            "sample_seed": int(which == "reference-again"),
            "splits": {"test": 1.0},
            **(scenes or {}),
        }
        try:
            return check_recipe(values, source=which)
        except RecipeError as problem:
            raise TrackError(str(problem)) from None


class Track(_Strict):
    """A question: what changes at run time, what may be prepared, what is scored.

    id, title, question: for people. varies: what changes from frame to frame. prepared: what may be baked or trained,
    and for what. parts: of the image that are scored. metrics: of single frames, sequence_metrics: of the path
    (`gibench.metrics`). source: papers that ask it.
    """

    id: Name
    title: str
    question: str
    varies: Names
    prepared: str
    source: Names
    parts: Annotated[tuple[Part, ...], Field(strict=False, min_length=1)]
    metrics: Names
    sequence_metrics: Names
    presets: dict[str, Preset]

    @field_validator("metrics", "sequence_metrics")
    @classmethod
    def _known_metrics(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if name not in METRICS:
                raise ValueError(f"no metric '{name}'; {nearest(name, METRICS)}")
        return names

    def preset(self, name: str) -> Preset:
        """A preset by its name. Raises TrackError with the nearest names."""
        if name not in self.presets:
            raise TrackError(f"track {self.id} has no preset '{name}'; {nearest(name, self.presets)}")
        return self.presets[name]


def track_names() -> tuple[str, ...]:
    """Ids of the tracks that ship with gibench."""
    folder = resources.files("gibench.benchmarks") / "tracks"
    return tuple(sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")))


def load_track(name: str) -> Track:
    """A track that ships with gibench, by its id, or one of the user's own, by the path of its TOML file.

    Raises TrackError with the file, the key and what is wrong.
    """
    if name.endswith(".toml"):
        path = Path(name)
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as problem:
            reason = problem.strerror if isinstance(problem, OSError) else "it is no text"
            raise TrackError(f"track {path} cannot be read: {reason}") from None
    elif name in track_names():
        text = (resources.files("gibench.benchmarks") / "tracks" / f"{name}.toml").read_text("utf-8")
    else:
        raise TrackError(
            f"no track '{name}'; {nearest(name, track_names())}, or give the path of a .toml file"
        )
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise TrackError(f"track {name} is no valid TOML: {problem}") from None
    return check_track(values, source=f"track {name}")


def check_track(values: Mapping[str, Any], *, source: str = "track") -> Track:
    """Check a track, its presets' recipes included. Raises TrackError; source: what it calls the place."""
    try:
        track = Track.model_validate(values)
    except ValidationError as problems:
        problem = problems.errors()[0]
        place = ".".join(map(str, problem["loc"]))
        raise TrackError(f"{source}: {place}: {problem['msg'].removeprefix('Value error, ')}") from None
    for name, preset in track.presets.items():
        place = f"{source}, preset {name}"
        if not preset.room.get("path_views"):
            raise TrackError(f"{place}: room: path_views is missing: without a path nothing is scored")
        try:
            reference, _ = preset.recipe("reference"), preset.recipe("training")
        except TrackError as problem:
            raise TrackError(f"{place}: {problem}") from None
        if missing := [channel for channel in SCORED if channel not in reference.channels]:
            raise TrackError(f"{place}: reference: channels lacks {', '.join(missing)}, which scoring needs")
    return track
