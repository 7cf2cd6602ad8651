"""Tracks: the questions that a benchmark asks, as TOML files that are checked before anything is made."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from gibench import gate
from gibench.baselines.method import Method
from gibench.benchmarks.errors import TrackError
from gibench.datasets.checked import Name
from gibench.datasets.errors import RecipeError, nearest
from gibench.datasets.recipes import Recipe, check_recipe, toml_values
from gibench.metrics import METRICS
from gibench.rendering.channels import SAMPLED

Names = Annotated[tuple[str, ...], Field(strict=False)]
Part = Literal["full", "diffuse", "specular", "indirect"]
Value = int | float | str | bool

#: Channels of a frame whose sum a part of the image is.
CHANNELS_OF: dict[str, tuple[str, ...]] = {
    "full": ("color",),
    "diffuse": ("direct_diffuse", "indirect_diffuse"),
    "specular": ("direct_specular", "indirect_specular"),
    "indirect": ("indirect_diffuse", "indirect_specular"),
}

#: The same of the samples of an image that is denoised beside them.
SAMPLES_OF: dict[str, tuple[str, ...]] = {
    part: tuple(
        name
        for channel in channels
        for name in (("emission", *SAMPLED) if channel == "color" else (f"sampled_{channel}",))
    )
    for part, channels in CHANNELS_OF.items()
}

#: Channels that tell which pixels the frame before shows too, for metrics of sequences.
MOVING = ("position", "shape_id", "motion", "motion_valid")


#: Keys of a recipe that mean generated rooms alone.
OF_ROOMS = ("kinds", "gloss", "environment")

#: Keys of a recipe for frames that are held out.
HELD_OUT = ("path_views", "held_out", "sequences")


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Budget(_Strict):
    """Time limits after which a result counts as failed, seconds.

    prepare: of a preparation, or of a training on rooms. render: of all frames of one setting, warm-up included.
    training: after which a training ends by itself, with the best weights so far; it has not failed then.
    """

    prepare: float = Field(gt=0)
    render: float = Field(gt=0)
    training: float | None = Field(None, gt=0)


class Panoramas(_Strict):
    """Panoramas of generated rooms that frames to train on are lit by, beside the maps that `training` names.

    count: how many. seed, spp: see `environment_panoramas.make_environments`.
    """

    count: int = Field(ge=1, le=99999)
    seed: int = Field(0, ge=0, lt=2**63)
    spp: int = Field(16, ge=1, le=2**20)


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
    share. training, reference: keys of the recipe of either; references are rendered twice, and without `training`
    there is nothing to learn from. panoramas: of rooms, that light frames to train on too. training_rooms,
    training_seed: of a track that trains on rooms of their own. knobs: values for every method that has a knob of that
    name, so that all share what is baked. methods: by id; a method that is not named runs at its defaults. A variant
    has the base of its method, but for the knobs that make it one, and is run once. variants: whether those of methods
    run too where nobody says which methods do.

    In a file, `like` names another preset of the track: what a preset says stands over what that one says, table by
    table, and all else is as there.
    """

    rooms: int = Field(ge=1)
    seed: int = Field(0, ge=0)
    seeds: Annotated[tuple[int, ...], Field(strict=False, min_length=1)] = (0,)
    warmup: int = Field(ge=0)
    room: dict[str, Any]
    training: dict[str, Any] | None = None
    panoramas: Panoramas | None = None
    training_rooms: int | None = Field(None, ge=1)
    training_seed: int | None = Field(None, ge=0)
    reference: dict[str, Any]
    budget: Budget
    knobs: dict[str, Value] = {}
    methods: dict[str, MethodPlan] = {}
    variants: bool = True

    def plan(self, method: Method) -> MethodPlan:
        """Plan of this preset for a method."""
        plan = self.methods.get(method.id, MethodPlan())
        shared = {knob.name: self.knobs[knob.name] for knob in method.knobs if knob.name in self.knobs}
        whole, variant, _ = method.id.partition(":")
        if variant and whole in self.methods:
            shared |= self.methods[whole].base
        inherited = {name: value for name, value in shared.items() if name not in method.own}
        return MethodPlan(base={**inherited, **plan.base}, vary=plan.vary)

    def recipe(
        self,
        which: Literal["training", "reference", "reference-again"],
        rooms: int | None = None,
        scenes: Mapping[str, Any] | None = None,
        panoramas: Path | None = None,
    ) -> Recipe:
        """The recipe of the training views, or of the frames that are held out, once or once more with other samples.

        All make the same rooms, for what decides a room and its cameras is in `room`; but where there are
        `training_rooms` the training views are of those. scenes: keys of a recipe that put scene files in the place of
        rooms, those to train on excepted. panoramas: the folder of those that light frames to train on too.

        Raises TrackError.
        """
        values = {
            **self.room,
            **((self.training or {}) if which == "training" else self.reference),
            "rooms": rooms or self.rooms,
            "seed": self.seed,
            "rendered": "stills" if which == "training" else "path",
            "sample_seed": int(which == "reference-again"),
            "splits": {"test": 1.0},
            **(scenes or {}),
        }
        if which == "training" and panoramas is not None:
            named = values.get("environments", ())
            values["environments"] = [*([named] if isinstance(named, str) else named), str(panoramas)]
        on_rooms = which == "training" and self.training_rooms is not None
        if scenes and not on_rooms:
            values = {key: value for key, value in values.items() if key not in OF_ROOMS}
        if on_rooms:
            apart = (*HELD_OUT, "path", "path_rooms", *(scenes or {}))
            values = {key: value for key, value in values.items() if key not in apart}
            values |= {"rooms": self.training_rooms, "seed": self.training_seed, "rendered": "all"}
        try:
            return check_recipe(values, source=which)
        except RecipeError as problem:
            raise TrackError(str(problem)) from None


class Track(_Strict):
    """A question: what changes at run time, what may be prepared, what is scored.

    id, title, question: for people. varies: what changes from frame to frame. prepare_on: "scene" where methods train
    for each scene, "rooms" where they train once, on rooms of their own. prepared: what may be baked or trained, and
    for what. parts: of the image that are scored. metrics: of single frames, sequence_metrics: of the path
    (`gibench.metrics`). source: papers that ask it.
    """

    id: Name
    title: str
    question: str
    varies: Names
    prepare_on: Literal["scene", "rooms"] = "scene"
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

    def with_training_seconds(self, name: str, seconds: float) -> Track:
        """The same track, but each training of a preset ends after so many seconds. Raises TrackError."""
        preset = self.preset(name)
        if preset.training is None:
            raise TrackError(
                f"preset {name} of track {self.id} has nothing to train on: it takes no training seconds"
            )
        budget = preset.budget.model_copy(update={"training": seconds})
        preset = preset.model_copy(update={"budget": budget})
        _check_training(self, preset, f"track {self.id}, preset {name}")
        return self.model_copy(update={"presets": {**self.presets, name: preset}})


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
            content = gate.read_regular(path)
        except gate.GateError as problem:
            raise TrackError(f"track {problem}") from None
    elif name in track_names():
        content = (resources.files("gibench.benchmarks") / "tracks" / f"{name}.toml").read_bytes()
    else:
        raise TrackError(
            f"no track '{name}'; {nearest(name, track_names())}, or give the path of a .toml file"
        )
    try:
        values = toml_values(content)
    except ValueError as problem:
        raise TrackError(f"track {name} is no valid TOML: {problem}") from None
    return check_track(values, source=f"track {name}")


def check_track(values: Mapping[str, Any], *, source: str = "track") -> Track:
    """Check a track, its presets' recipes included. Raises TrackError; source: what it calls the place."""
    try:
        track = Track.model_validate({**values, **_with_likes(values, source)})
    except ValidationError as problems:
        problem = problems.errors()[0]
        place = ".".join(map(str, problem["loc"]))
        raise TrackError(f"{source}: {place}: {problem['msg'].removeprefix('Value error, ')}") from None
    for name, preset in track.presets.items():
        place = f"{source}, preset {name}"
        if not any(preset.room.get(key) or preset.reference.get(key) for key in HELD_OUT):
            raise TrackError(
                f"{place}: room: {', '.join(HELD_OUT)} are missing: without one of them nothing is scored"
            )
        _check_training(track, preset, place)
        try:
            reference = preset.recipe("reference")
            if preset.training is not None:
                preset.recipe("training")
        except TrackError as problem:
            raise TrackError(f"{place}: {problem}") from None
        needed = [channel for part in track.parts for channel in CHANNELS_OF[part]]
        needed += MOVING if track.sequence_metrics else ()
        if missing := [c for c in dict.fromkeys(needed) if c not in reference.channels]:
            raise TrackError(f"{place}: reference: channels lacks {', '.join(missing)}, which scoring needs")
    return track


def _with_likes(values: Mapping[str, Any], source: str) -> dict[str, Any]:
    """The table of presets, each with what it takes from the one that it is `like`; {} where there is no such table."""
    presets = values.get("presets")
    if not isinstance(presets, Mapping):
        return {}
    others = {n: p for n, p in presets.items() if isinstance(p, Mapping) and "like" not in p}
    whole = {}
    for name, preset in presets.items():
        if isinstance(preset, Mapping) and "like" in preset:
            other = preset["like"]
            if not isinstance(other, str) or other not in others:
                raise TrackError(
                    f"{source}: presets.{name}.like: no preset {other!r} that stands for itself; "
                    f"{nearest(str(other), others)}"
                )
            preset = _over(others[other], {key: value for key, value in preset.items() if key != "like"})
        whole[name] = preset
    return {"presets": whole}


def _over(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Two tables as one: values of `above` in the place of those below, tables within tables likewise."""
    result = dict(below)
    for key, value in above.items():
        under = result.get(key)
        if isinstance(value, Mapping) and isinstance(under, Mapping):
            value = _over(under, value)
        result[key] = value
    return result


def _check_training(track: Track, preset: Preset, place: str) -> None:
    """Refuse rooms to train on that are not asked for, not there, or scored."""
    own = (preset.training_rooms, preset.training_seed)
    if track.prepare_on == "scene" and own != (None, None):
        raise TrackError(f'{place}: training_rooms and training_seed need prepare_on = "rooms"')
    if track.prepare_on == "rooms":
        if preset.training is None or None in own:
            raise TrackError(
                f'{place}: prepare_on = "rooms" needs training, training_rooms and training_seed'
            )
        if preset.training_seed == preset.seed:
            raise TrackError(
                f"{place}: training_seed is {preset.seed}, as seed is: the rooms to train on would be those that are "
                "scored; choose another"
            )
    if preset.panoramas is not None and (preset.training or {}).get("environments") is None:
        raise TrackError(
            f"{place}: panoramas needs training with environments, beside which they light frames"
        )
    if preset.budget.training is not None and preset.budget.training >= preset.budget.prepare:
        raise TrackError(
            f"{place}: budget: training ({preset.budget.training:g} s) must be below prepare "
            f"({preset.budget.prepare:g} s), after which the process is killed"
        )
