"""Recipes: what a dataset is made of, as TOML files that are checked before anything is made."""

from __future__ import annotations

import hashlib
import os
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator
from pydantic_core import PydanticCustomError

from gibench import gate
from gibench.datasets.checked import plain_name
from gibench.datasets.errors import RecipeError, nearest
from gibench.rendering import channels as contract

if TYPE_CHECKING:
    from gibench.generators.cameras import PathPlan
    from gibench.generators.environments.files import EnvironmentFile
    from gibench.generators.imported.scene import ImportSettings
    from gibench.generators.trajectories import Spread

#: Environments that are no file: what `sample_room` would choose itself, sun and sky, or darkness outside.
ENVIRONMENTS = ("auto", "sunsky", "none")

#: SPDX's way to say: that of the scenes, whose licence files lie beside them in the dataset.
SCENE_LICENCE = "LicenseRef-of-the-scene"

#: Options of the commands whose name is not the key that they override.
OPTIONS = {
    "kinds": "--kind",
    "scenes": "--scene",
    "allow_missing": "--allow-missing",
    "allow_outside": "--allow-outside",
    "parameters": "-D",
}

#: Channels whose samples are counted until an error is reached; radiance cues take as many.
RADIANCE = frozenset((*contract.SETS["radiance"], *contract.SAMPLED))

#: Paths of a room from which on they are guided where nothing is said. Learning a guide takes the CPU time of 1.5
#: million plain paths, of 4 million with directions, and guided ones take half of their time at equal noise.
GUIDED_FROM = 1 << 23

#: Samples a pixel that a target error takes at least.
LEAST_OF_ERROR = 64

# Lists in TOML become tuples here: a recipe is a value that can be compared and hashed.
Names = Annotated[tuple[str, ...], Field(strict=False, min_length=1)]


Kind = Literal["walk", "orbit", "eight"]
Moves = Literal["camera", "light", "both"]


class Sequence(BaseModel):
    """A named sequence of frames of every room."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    views: int = Field(ge=1, le=9999)
    path: Kind = "walk"
    moves: Moves = "camera"


class Recipe(BaseModel):
    """Everything that decides the pixels of a dataset, apart from the versions and the variant.

    Recipes compare equal when they make the same frames. The defaults are those of the preset `small`.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    def __eq__(self, other: object) -> bool:
        """Whether all values are equal, and those of tables in the same order, which decides as much."""
        return isinstance(other, Recipe) and self.model_dump_json() == other.model_dump_json()

    rooms: int = Field(10, ge=1, le=10**6, description="an integer from 1 to 1000000")
    seed: int = Field(0, ge=0, lt=2**63, description="an integer from 0 to 2⁶³−1")
    kinds: Names = Field(("all",), validate_default=True, description='a list of room kinds, or ["all"]')
    views: int = Field(
        4,
        ge=0,
        le=9999,
        description="an integer from 1 to 9999 (frames a room), or 0 for the cameras that scenes bring along",
    )
    resolution: Annotated[
        tuple[Annotated[int, Field(ge=8, le=16384)], Annotated[int, Field(ge=8, le=16384)]],
        Field(strict=False),
    ] = Field((256, 192), description="two integers [width, height], each from 8 to 16384")
    spp: int | None = Field(
        None,
        ge=1,
        le=2**20,
        description="an integer from 1 to 1048576 (samples a pixel), or error in its place",
    )
    error: float | None = Field(
        None, gt=0, lt=1, description="a number between 0 and 1 (median relative error), or spp in its place"
    )
    spp_cap: int = Field(
        4096, ge=64, le=2**20, description="an integer from 64 to 1048576 (most samples for error)"
    )
    sample_seed: int = Field(
        0,
        ge=0,
        lt=2**32,
        description="an integer from 0 to 2³²−1 (another one gives the same rooms with independent noise)",
    )
    max_depth: int = Field(8, ge=1, le=1000, description="an integer from 1 to 1000 (scattering events)")
    sampling: Literal["plain", "guided"] | None = Field(
        None,
        description='"plain" or "guided" (paths choose lights and directions by what is learned of a room first), or '
        "left out",
    )
    denoise: bool = Field(True, description="true or false")
    channels: Names = Field(
        ("radiance", "surface"), validate_default=True, description="a list of channels or sets of channels"
    )
    environment: str = Field(
        "auto", description='"auto", "sunsky", "none" or the path of an equirectangular .hdr or .exr file'
    )
    path: Literal["stills", "walk", "orbit", "eight"] = Field(
        "stills", description='"stills", "walk", "orbit" or "eight" (the frames of a room lie on that path)'
    )
    path_views: int = Field(
        0,
        ge=0,
        le=9999,
        description="an integer from 0 to 9999 (frames on the path beside the views, which are then stills)",
    )
    path_rooms: int | None = Field(
        None,
        ge=0,
        description="an integer from 0 (rooms, the first ones, whose path is rendered; all without it)",
    )
    held_out: int = Field(
        0,
        ge=0,
        le=9999,
        description="an integer from 0 to 9999 (of the stills, the last ones, which are rendered with the path)",
    )
    trajectories: int = Field(
        0,
        ge=0,
        le=999,
        description="an integer from 0 to 999 (walks that the stills lie on, the far ones excepted; 0: anywhere)",
    )
    far: int = Field(
        0,
        ge=0,
        le=9999,
        description="an integer from 0 to 9999 (of the held-out stills, the last ones, away from all trajectories)",
    )
    path_moves: Moves = Field("camera", description='"camera", "light" or "both" (what moves along the path)')
    sequences: dict[Annotated[str, Field(min_length=1)], Sequence] = Field(
        {},
        description="a table of names, each of a table of views (from 1), path and moves (as path_moves)",
    )
    lighting: Literal["own", "area-light", "environments"] = Field(
        "own",
        description='"own" (the room\'s lamps and windows), "area-light" or "environments" (one of its own a frame)',
    )
    environments: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="a set of maps that ship, such as indoor or outdoor, a folder, or a list of maps"
    )
    rotations: int = Field(
        0,
        ge=0,
        le=360,
        description="an integer from 0 to 360 (turns that a map of a still may have, evenly around; 0: any)",
    )
    opened: Literal["none", "ceiling", "stage"] = Field(
        "none",
        description='"none", "ceiling" or "stage" (the ceiling, or the ceiling and one wall, are taken away)',
    )
    gloss: Literal["any", "much"] = Field(
        "any", description='"any" or "much" (rooms with polished floors and furniture)'
    )
    rendered: Literal["all", "stills", "path"] = Field(
        "all", description='"all", "stills" or "path" (which of the frames of a room are rendered)'
    )
    splits: dict[str, float] = Field(
        {"train": 0.8, "validation": 0.1, "test": 0.1},
        description="a table of names and shares from 0 to 1 that sum to 1",
    )
    scenes: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="a list of Mitsuba scene files, each a room in place of a generated one"
    )
    up: Literal["auto", "x", "y", "z"] = Field(
        "auto", description='"auto", "x", "y" or "z" (the axis of scene files that is up)'
    )
    scale: float = Field(1.0, gt=0, le=1e6, description="a number above 0 (metres of a scene file's unit)")
    allow_missing: bool = Field(False, description="true or false (leave out what needs a missing file)")
    allow_outside: bool = Field(False, description="true or false (read files outside of a scene's folder)")
    parameters: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description='a list such as ["samples=64"] (values of $parameters of scene files)'
    )
    cameras: str | None = Field(None, description="the path of a camera file for the scenes (JSON)")
    licence: str = Field("CC0-1.0", min_length=1, description="the SPDX name of the licence of the data")

    @model_validator(mode="before")
    @classmethod
    def _default_samples(cls, values: Any) -> Any:
        """Take 64 samples where the recipe sets neither `spp` nor `error`."""
        if isinstance(values, dict) and values.get("spp") is None and values.get("error") is None:
            return {**values, "spp": 64}
        return values

    @model_validator(mode="before")
    @classmethod
    def _a_room_a_scene(cls, values: Any) -> Any:
        if isinstance(values, dict) and isinstance(scenes := values.get("scenes"), list | tuple) and scenes:
            # What is rendered of a scene stays under the terms of its author.
            return {"licence": SCENE_LICENCE, **values, "rooms": len(scenes)}
        return values

    @model_validator(mode="after")
    def _samples_that_can_be(self) -> Self:
        if self.spp is not None and self.error is not None:
            raise PydanticCustomError("both", "spp and error are both set; keep one of them")
        asked = set(self.channels)
        if self.error is not None and asked & {*contract.CUES} and not asked & RADIANCE:
            raise PydanticCustomError(
                "cues", "radiance cues need spp where no radiance is asked for: give it in place of error"
            )
        if self.spp == 1 and "color_se" in self.channels:
            raise PydanticCustomError(
                "single", "channel color_se needs spp from 2 on; raise spp, or name channels without color_se"
            )
        return self

    @field_validator("environments", mode="before")
    @classmethod
    def _one_is_a_list_too(cls, environments: Any) -> Any:
        return (environments,) if isinstance(environments, str) else environments

    @model_validator(mode="before")
    @classmethod
    def _default_environments(cls, values: Any) -> Any:
        if isinstance(values, dict) and values.get("lighting") == "environments":
            return {**values, "environments": values.get("environments") or ("indoor",)}
        return values

    @model_validator(mode="after")
    def _light_that_can_be(self) -> Self:
        if self.environments and self.lighting != "environments":
            raise PydanticCustomError(
                "lighting", 'environments is set, but not the lighting: set lighting to "environments"'
            )
        if self.rotations and self.lighting != "environments":
            raise PydanticCustomError(
                "lighting", 'rotations is set, but not the lighting: set lighting to "environments"'
            )
        if self.lighting == "area-light" and "still-life" in self.kinds and not self.scenes:
            raise PydanticCustomError(
                "lighting",
                'kinds has still-life, which an environment lights: set lighting to "environments", or leave it out',
            )
        if self.sampling == "guided" and self.lighting != "own":
            raise PydanticCustomError(
                "sampling",
                'sampling is "guided", but what is learned of a room holds for one light: set lighting to "own"',
            )
        moving = self.path_moves != "camera" or any(s.moves != "camera" for s in self.sequences.values())
        if moving and self.lighting == "own":
            raise PydanticCustomError(
                "lighting",
                'light moves on a path, but the room keeps its own: set lighting to "area-light" or "environments"',
            )
        if self.path_moves != "camera" and self.path == "stills":
            raise PydanticCustomError("path", "path_moves needs a path: set path to walk, orbit or eight")
        return self

    @model_validator(mode="after")
    def _frames_that_can_be(self) -> Self:
        if self.sequences and self.path != "stills":
            raise PydanticCustomError(
                "path", "path and sequences are both set: leave path out, and make it one of the sequences"
            )
        if self.path_views and self.path == "stills":
            raise PydanticCustomError("path", "path_views needs a path: set path to walk, orbit or eight")
        if self.rendered != "all" and not (self.path_frames or self.held_out):
            raise PydanticCustomError(
                "rendered",
                f'rendered is "{self.rendered}", but only rooms with path_views, sequences or held_out have both kinds',
            )
        if self.held_out > self.views:
            raise PydanticCustomError("held_out", f"held_out is {self.held_out} of {self.views} views")
        if self.far > self.held_out:
            raise PydanticCustomError("far", f"far is {self.far} of {self.held_out} stills that are held out")
        if self.far and not self.trajectories:
            raise PydanticCustomError(
                "far", "far is set, but there are no trajectories to be far from: set trajectories"
            )
        if self.trajectories and self.path != "stills" and not self.path_views:
            raise PydanticCustomError(
                "path", "trajectories are for stills, but the views lie on the path: leave path out"
            )
        return self

    @model_validator(mode="after")
    def _scenes_that_can_be(self) -> Self:
        if not self.scenes:
            for key in ("up", "scale", "allow_missing", "allow_outside", "cameras", "parameters"):
                if getattr(self, key) != type(self).model_fields[key].default:
                    raise PydanticCustomError(
                        "scenes", "{key} is set, but only scenes have it: set scenes too", {"key": key}
                    )
            if self.views == 0 and not self.sequences:
                raise PydanticCustomError(
                    "views",
                    "0 is not allowed: only scenes have cameras of their own; allowed is an integer from 1",
                )
        elif self.gloss != "any":
            raise PydanticCustomError(
                "scenes", "gloss is set, but scenes bring their own materials: leave it out"
            )
        elif self.environment != "auto":
            raise PydanticCustomError(
                "scenes", "environment is set, but scenes bring their own: leave it out"
            )
        return self

    def plans(self) -> tuple[PathPlan, ...]:
        """Sequences of a room that come after its views, in order."""
        from gibench.generators.cameras import PathPlan

        if self.path_views:
            return (PathPlan(self.path, self.path, self.path_views, self.path_moves),)
        return tuple(PathPlan(name, s.path, s.views, s.moves) for name, s in self.sequences.items())

    @property
    def spread(self) -> Spread | None:
        """Where stills lie that are on trajectories, and away from them; None where they lie anywhere."""
        from gibench.generators.trajectories import Spread

        return Spread(self.trajectories, self.held_out, self.far) if self.trajectories else None

    def nearness(self, view: int, given: int = 0) -> str:
        """ "near" or "far" of a still that is held out, where they are told apart; else "".

        given: as of `rendered_views`.
        """
        stills = given + self.views
        if not self.trajectories or not stills - self.held_out <= view < stills:
            return ""
        return "near" if view < stills - self.far else "far"

    @property
    def path_frames(self) -> int:
        """Frames of a room on sequences that come after its views."""
        return self.path_views + sum(sequence.views for sequence in self.sequences.values())

    def moves(self) -> dict[str, str]:
        """Moving parts of a path, by the name that its frames bear."""
        moves: dict[str, str] = {plan.name: plan.moves for plan in self.plans()}
        return moves if self.path == "stills" else {**moves, self.path: self.path_moves}

    def rendered_views(self, given: int = 0, room: int = 0) -> range:
        """Numbers of the views of a room that are rendered.

        First come the cameras that it brings along, `given` of them, which count as stills; then the stills, then those
        on paths beside them. Of the stills the last `held_out` go with the paths.
        """
        stills = given + self.views
        apart = stills - self.held_out
        has_path = self.path_rooms is None or room < self.path_rooms
        last = stills + (self.path_frames if has_path else 0)
        return range(apart if self.rendered == "path" else 0, apart if self.rendered == "stills" else last)

    @field_validator("kinds")
    @classmethod
    def _known_kinds(cls, kinds: tuple[str, ...]) -> tuple[str, ...]:
        # Not needed by those who only read datasets.
        from gibench.generators.rooms import ALL_KINDS, KINDS

        for kind in kinds:
            if kind not in (*ALL_KINDS, "all"):
                text = f"no kind '{kind}'; {nearest(kind, ALL_KINDS)}"
                raise PydanticCustomError("unknown", "{text}", {"text": text})
        asked = {*kinds, *(KINDS if "all" in kinds else ())}
        return tuple(kind for kind in ALL_KINDS if kind in asked)

    @field_validator("channels")
    @classmethod
    def _known_channels(cls, channels: tuple[str, ...]) -> tuple[str, ...]:
        try:
            return contract.resolve(channels)
        except contract.UnknownChannelError as problem:
            raise PydanticCustomError("unknown", "{text}", {"text": str(problem)}) from None

    @field_validator("splits")
    @classmethod
    def _whole_splits(cls, splits: dict[str, float]) -> dict[str, float]:
        for name in splits:
            try:
                plain_name(name)  # exports make files of it
            except ValueError as problem:
                raise PydanticCustomError("splits", "{text}", {"text": str(problem)}) from None
        # Put so that NaN, which TOML has, fails too.
        if not (splits and all(s >= 0 for s in splits.values()) and abs(sum(splits.values()) - 1) <= 1e-6):
            raise PydanticCustomError("splits", "the shares do not sum to 1")
        return splits

    @property
    def room_sampling(self) -> str:
        """How paths are sampled, one of `scene.SAMPLINGS`: as it is said, or guided where that pays."""
        if self.sampling is not None:
            return self.sampling
        width, height = self.resolution
        paths = len(self.rendered_views()) * width * height * (self.spp or LEAST_OF_ERROR)
        return "guided" if self.lighting == "own" and paths >= GUIDED_FROM else "plain"

    @property
    def keys_of_files(self) -> frozenset[str]:
        """Keys of `identity` whose values are read from files."""
        keys = {key for key in ("environments", "scenes", "cameras") if getattr(self, key)}
        return frozenset(keys | ({"environment"} if self.environment not in ENVIRONMENTS else set()))

    def identity(self, *, files: bool = True) -> dict[str, Any]:
        """Return the recipe as JSON-able values without the number of rooms, which alone may grow.

        Files count by their content (SHA-256), not by where they lie. The order of tables counts (`other_values` of
        `gibench.datasets.manifest` compares it), as JSON keeps it. files: whether they are read; `keys_of_files` are
        left out otherwise. Raises `RecipeError` or `SceneFileError` for a file that cannot be read.
        """
        values = self.model_dump(mode="json", exclude={"rooms"})
        # Datasets that were begun before these keys existed hold the same frames.
        if not self.path_views:
            del values["path_views"]
        if not (self.path_frames or self.held_out):
            del values["rendered"]
        if not self.held_out:
            del values["held_out"]
        if self.path_rooms is None:
            del values["path_rooms"]
        if not self.sample_seed:
            del values["sample_seed"]
        for key in (
            "path_moves",
            "sequences",
            "trajectories",
            "far",
            "lighting",
            "environments",
            "rotations",
            "opened",
            "gloss",
        ):
            if not values[key] or values[key] == type(self).model_fields[key].default:
                del values[key]
        values["sampling"] = self.room_sampling
        if values["sampling"] == "plain":
            del values["sampling"]
        if self.scenes:
            del values["kinds"]
        else:
            for key in ("scenes", "up", "scale", "allow_missing", "allow_outside", "cameras"):
                del values[key]
        if not self.parameters:
            del values["parameters"]
        for key in sorted(self.keys_of_files):
            if files:
                values[key] = self._content(key)
            else:
                del values[key]
        return values

    def _content(self, key: str) -> Any:
        """What a key of `keys_of_files` stands for, by the content of its files."""
        if key == "environments":
            return {file.name: f"sha256:{file_sha256(file.path)}" for file in self.environment_files()}
        if key == "scenes":
            from gibench.generators.imported.scene import fingerprint

            settings = self.import_settings()
            return [f"sha256:{fingerprint(Path(scene), settings)}" for scene in self.scenes]
        return f"sha256:{file_sha256(Path(getattr(self, key)))}"

    def environment_files(self) -> tuple[EnvironmentFile, ...]:
        """The maps that frames are lit by. Raises `RecipeError` for a name that is none, or a folder without one."""
        from gibench.generators.daylight import BadEnvironment
        from gibench.generators.environments.files import environment_files

        try:
            return environment_files(self.environments)
        except BadEnvironment as problem:
            raise RecipeError(str(problem)) from None

    def import_settings(self) -> ImportSettings:
        """Options for reading the scene files."""
        from gibench.generators.imported.scene import ImportSettings

        cameras = None if self.cameras is None else Path(self.cameras)
        return ImportSettings(
            self.up, self.scale, self.allow_missing, self.allow_outside, cameras, self.parameters
        )


def file_sha256(path: Path) -> str:
    """SHA-256 of an environment file, hexadecimal. Raises `RecipeError` when it cannot be read."""
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as problem:
        raise RecipeError(f"environment file {path} cannot be read: {problem.strerror}") from None


def preset_names() -> tuple[str, ...]:
    """Names of the recipes that ship with gibench."""
    folder = resources.files("gibench.datasets") / "presets"
    return tuple(sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")))


def load_preset(name: str, overrides: Mapping[str, Any] | None = None) -> Recipe:
    """Load a recipe that ships with gibench; `overrides` as in `load_recipe`. Raises `RecipeError`.

    >>> load_preset("small", {"rooms": 3, "kinds": ["office"]}).rooms
    3
    """
    if name not in preset_names():
        raise RecipeError(f"no preset '{name}'; {nearest(name, preset_names())}")
    text = (resources.files("gibench.datasets") / "presets" / f"{name}.toml").read_text(encoding="utf-8")
    return check_recipe(tomllib.loads(text), source=f"preset {name}", overrides=overrides)


def load_recipe(path: Path, overrides: Mapping[str, Any] | None = None) -> Recipe:
    """Load a recipe from a TOML file; keys that it leaves out take their defaults.

    overrides: option → value, as given on the command line; they win over the file. Relative paths in it count from
    its folder. Raises `RecipeError` with the file, the key and what is allowed.
    """
    try:
        values = toml_values(gate.read_regular(path))
    except gate.GateError as problem:
        raise RecipeError(f"recipe {problem}") from None
    except ValueError as problem:
        raise RecipeError(f"recipe {path} is no valid TOML: {problem}") from None
    environment = values.get("environment")
    if isinstance(environment, str) and environment not in ENVIRONMENTS:
        values["environment"] = _beside(path, environment)
    if isinstance(maps := values.get("environments"), str | list):
        # The name of a map that ships is no file beside the recipe, or that file is meant.
        values["environments"] = [
            beside if isinstance(name, str) and os.path.exists(beside := _beside(path, name)) else name
            for name in ([maps] if isinstance(maps, str) else maps)
        ]
    if isinstance(scenes := values.get("scenes"), list):
        # What is no text is refused with the rest of the recipe.
        values["scenes"] = [_beside(path, scene) if isinstance(scene, str) else scene for scene in scenes]
    if isinstance(cameras := values.get("cameras"), str):
        values["cameras"] = _beside(path, cameras)
    return check_recipe(values, source=str(path), overrides=overrides)


def toml_values(content: bytes) -> dict[str, Any]:
    """Content of a TOML file. Raises ValueError, whose text fits on a line, for what is none."""
    try:
        # Editors of Windows write a byte order mark, which TOML does not know.
        return tomllib.loads(content.decode("utf-8-sig"))
    except RecursionError:
        raise ValueError("too many brackets in one another") from None


def _beside(recipe: Path, name: str) -> str:
    try:
        return str((recipe.parent / name).resolve())
    except (OSError, ValueError) as problem:
        reason = problem.strerror if isinstance(problem, OSError) else problem
        raise RecipeError(f"recipe {recipe}: {name[:60]!r} is no name of a file: {reason}") from None


def _is_file(name: str) -> bool:
    try:
        return Path(name).is_file()
    except (OSError, ValueError):  # too long, or with a null character
        return False


def check_recipe(
    values: Mapping[str, Any], *, source: str = "recipe", overrides: Mapping[str, Any] | None = None
) -> Recipe:
    """Check the keys of a recipe and lay the overrides over them. Raises `RecipeError`.

    source: what the errors call the place where `values` come from.
    """
    overrides = dict(overrides or {})
    recipe = _validated(dict(values), source)
    if not overrides:
        return recipe
    merged = dict(values)
    # Asking for samples replaces asking for an error, and the other way round.
    for asked, other in (("spp", "error"), ("error", "spp")):
        if asked in overrides and other not in overrides:
            merged.pop(other, None)
    return _validated(merged | overrides, source, frozenset(overrides))


def _validated(values: dict[str, Any], source: str, options: frozenset[str] = frozenset()) -> Recipe:
    try:
        recipe = Recipe.model_validate(values)
    except ValidationError as problems:
        raise RecipeError(_message(problems, values, source, options)) from None
    if recipe.environment not in ENVIRONMENTS and not _is_file(recipe.environment):
        near = nearest(recipe.environment, ENVIRONMENTS)
        raise RecipeError(f"{source}: environment: there is no file {recipe.environment[:200]}; {near}")
    if recipe.environments:
        recipe.environment_files()
    for scene in recipe.scenes:
        if not _is_file(scene):
            raise RecipeError(f"{_place('scenes', source, options)}: there is no scene file {scene[:200]}")
    if recipe.cameras is not None and not _is_file(recipe.cameras):
        raise RecipeError(
            f"{_place('cameras', source, options)}: there is no camera file {recipe.cameras[:200]}"
        )
    return recipe


def _message(
    problems: ValidationError, values: Mapping[str, Any], source: str, options: frozenset[str]
) -> str:
    problem = problems.errors()[0]
    if not problem["loc"]:
        if options >= {"spp", "error"}:
            source = "options"
        elif problem["type"] == "single" and "spp" in options:
            source = "--spp"
        elif problem["type"] == "cues" and "error" in options:
            source = "--error"
        elif problem["type"] == "views":
            source = _place("views", source, options)
        return f"{source}: {problem['msg']}"
    key = str(problem["loc"][0])
    if problem["type"] == "extra_forbidden":
        return f"{source}: unknown key '{key}'; {nearest(key, Recipe.model_fields)}"
    place = _place(key, source, options)
    if problem["type"] == "unknown":
        return f"{place}: {problem['msg']}"
    reason = f" ({problem['msg']})" if problem["type"] == "splits" else ""
    return (
        f"{place}: {values[key]!r} is not allowed{reason}; allowed is {Recipe.model_fields[key].description}"
    )


def _place(key: str, source: str, options: frozenset[str]) -> str:
    """Name in errors of the place that a key's value came from."""
    return OPTIONS.get(key, f"--{key}") if key in options else f"{source}: {key}"
