"""The interface of methods: a card with its needs, and the stages that do the work.

The card is light: listing methods imports neither torch nor Mitsuba, which come with the implementation. A package
offers its cards through the entry-point group `gibench.methods`; `docs/adding-a-method.md` walks through one.
"""

from __future__ import annotations

import difflib
import importlib
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gibench.errors import GibenchError

if TYPE_CHECKING:
    from gibench.baselines.bakes import BakeCache
    from gibench.baselines.stages import Stages
    from gibench.baselines.training_set import TrainingSet
    from gibench.datasets.loading import Frame
    from gibench.rendering.camera import PinholeCamera
    from gibench.rendering.light_rig import LightRig
    from gibench.rendering.lighting import Shot
    from gibench.rendering.scene import Scene

Setting = int | float | str | bool

MAX_DEPTH = 8
"""Scattering events of a path where no recipe says: that of recipes."""


class MethodError(GibenchError):
    """A method that is asked for what it does not have, or that cannot do what it promises."""


@contextmanager
def reading(what: str, folder: Path) -> Iterator[None]:
    """Read what a training left, `what` for people. Raises MethodError that names the folder for all that fails."""
    try:
        yield
    except (GibenchError, OSError, RuntimeError, LookupError, ValueError, TypeError) as problem:
        first = next(iter(str(problem).splitlines()), type(problem).__name__)
        raise MethodError(f"{what} in {folder} cannot be read ({first}): remove that folder") from problem


@dataclass(frozen=True)
class Knob:
    """One setting of a method, and what it may be.

    values: allowed settings, cheapest first. bakes: a change needs another preparation; otherwise one preparation
    serves all settings. trains: a change needs another training, and so another preparation.
    """

    name: str
    default: Setting
    values: tuple[Setting, ...]
    meaning: str
    bakes: bool = False
    trains: bool = False

    def __post_init__(self) -> None:
        """Raises MethodError for a default that is not allowed."""
        if self.default not in self.values:
            raise MethodError(f"knob {self.name}: the default {self.default!r} is not among {self.values}")


@dataclass(frozen=True)
class Variant:
    """A method with other defaults, such as one of its parts switched off, that has a row of its own.

    name: what its id ends in, after a colon. settings: knobs that differ.
    """

    name: str
    settings: Mapping[str, Setting]


@dataclass(frozen=True)
class Method:
    """The card of a method.

    id: the column `method` of every table. tracks: ids of the tracks it can run on. family: what kind of method it
    is ("probes", "ray tracing" …). paper: where it is from. implementation: "package.module:Class", an
    `Implementation`, imported only to run it. channels: of the training views that it reads. knobs: its settings.
    budget: the knob that equal-time comparisons turn. trained: draws random numbers while it is prepared, so that
    several seeds say more than one. trains: has the stage `train`. variants: the ablations that its paper shows,
    methods of their own on a board. own: of a variant, the knobs that make it one.
    """

    id: str
    title: str
    family: str
    tracks: tuple[str, ...]
    paper: str
    implementation: str
    channels: tuple[str, ...] = ()
    knobs: tuple[Knob, ...] = ()
    budget: str | None = None
    trained: bool = False
    trains: bool = False
    variants: tuple[Variant, ...] = ()
    own: tuple[str, ...] = ()

    def with_variants(self) -> tuple[Method, ...]:
        """This method and its variants, each a card of its own. Raises MethodError for settings that do not exist."""
        return (self, *(self._variant(variant) for variant in self.variants))

    def _variant(self, variant: Variant) -> Method:
        self.settings(variant.settings)
        return replace(
            self,
            id=f"{self.id}:{variant.name}",
            title=f"{self.title} ({variant.name.replace('-', ' ')})",
            knobs=tuple(
                replace(knob, default=variant.settings.get(knob.name, knob.default)) for knob in self.knobs
            ),
            variants=(),
            own=tuple(variant.settings),
        )

    def settings(self, given: Mapping[str, Setting] | None = None) -> dict[str, Setting]:
        """All knobs, those that are not given at their defaults.

        Raises MethodError for a knob that does not exist (with the nearest names) or a value that is not allowed.
        """
        known = {knob.name: knob for knob in self.knobs}
        for name, value in (given or {}).items():
            if name not in known:
                near = difflib.get_close_matches(name, known, n=3, cutoff=0.5) or sorted(known)
                raise MethodError(f"{self.id} has no knob '{name}'; known: {', '.join(near) or 'none'}")
            if value not in known[name].values or isinstance(value, bool) != isinstance(
                known[name].default, bool
            ):
                allowed = ", ".join(map(str, known[name].values))
                raise MethodError(f"{self.id}: {name} = {value!r} is not allowed; allowed are {allowed}")
        return {knob.name: (given or {}).get(knob.name, knob.default) for knob in self.knobs}

    def baked_settings(self, settings: Mapping[str, Setting]) -> dict[str, Setting]:
        """The settings that decide a preparation."""
        return {knob.name: settings[knob.name] for knob in self.knobs if knob.bakes or knob.trains}

    def trained_settings(self, settings: Mapping[str, Setting]) -> dict[str, Setting]:
        """The settings that decide a training."""
        return {knob.name: settings[knob.name] for knob in self.knobs if knob.trains}

    def load(self) -> type[Implementation]:
        """Import the implementation. Raises MethodError where it is not there."""
        module, _, name = self.implementation.partition(":")
        try:
            return getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError) as problem:
            raise MethodError(
                f"{self.id}: {self.implementation} cannot be imported ({problem}); "
                "pip install 'gibench[bench]' brings what our own methods need"
            ) from problem


@dataclass(frozen=True)
class Training:
    """Training data of a method: once a track on many rooms, or once a scene on that scene's views.

    views: frames to learn from, of one room or of many. seconds: after which a training ends by itself, with the best
    weights so far; None for no end but its own. seed: all that it may draw random numbers from. folder: where weights
    go; what lies there afterwards is what `Site.weights` shows to whoever uses them. checkpoint: a file for what a
    training must not lose when it is cut off; it goes once the weights are there. stages: where it is timed.
    """

    views: TrainingSet
    seconds: float | None
    seed: int
    folder: Path
    checkpoint: Path
    stages: Stages


@dataclass(frozen=True)
class Site:
    """Inputs of a method's preparation.

    scene: loaded under the run's variant. folder: with scene.xml and what it needs, but without any frame. resolution:
    (width, height) of the frames to come. training: views of the room that are not scored; whoever is handed one is
    charged with its rendering. seed: all that the method may draw random numbers from. bakes: files that are shared
    with other methods. stages: where preparation is timed. max_depth: scattering events of the paths that make the
    light. weights: the folder that `train` filled, None for methods that have no such stage. seconds: after which a
    training within `prepare` ends by itself, None for no end but its own. parts: of the image that are scored. rig:
    lights the scene, None where its light stays; it is set before each frame, and left at the scene's own light here.
    """

    scene: Scene
    folder: Path
    resolution: tuple[int, int]
    training: Sequence[Frame]
    seed: int
    bakes: BakeCache
    stages: Stages
    max_depth: int = MAX_DEPTH
    weights: Path | None = None
    seconds: float | None = None
    parts: tuple[str, ...] = ("full", "specular")
    rig: LightRig | None = None


@dataclass(frozen=True)
class View:
    """A frame to be rendered: a still, or a frame of a sequence.

    shot: its camera and its lighting, which the scene has already. previous: the shot of the frame before it; None for
    stills and at the start of a sequence, when a method must forget what it kept. seed: for what is drawn at random in
    this frame.
    """

    shot: Shot
    previous: Shot | None
    resolution: tuple[int, int]
    index: int
    seed: int

    @property
    def camera(self) -> PinholeCamera:
        """The camera of the shot."""
        return self.shot.camera


PARTS = ("diffuse", "specular", "indirect")
"""Of an image, besides all of it: those of a `Prediction` that a method may tell apart."""


class Prediction:
    """The images that a method gives for a frame: arrays (H, W, 3), finite, ≥ 0, in the units of the channels.

    An image is whatever array the method computes with: of NumPy, a tensor of torch, a mi.TensorXf, on any device.
    It is handed over as it is; the attributes copy it to the host when they are first read, which the benchmark does
    after its clock has stopped.
    """

    def __init__(
        self,
        color: Any,
        specular: Any = None,
        extra: Mapping[str, float] | Callable[[], Mapping[str, float]] | None = None,
        *,
        diffuse: Any = None,
        indirect: Any = None,
    ) -> None:
        """color: all of the light. specular, diffuse: what the first hit reflects by that lobe, direct and indirect.

        indirect: what comes to the first hit from other surfaces, by both lobes. None where the method cannot tell a
        part apart. A part that no frame shows, but that is scored, may be a function that works it out: it is called
        once the clock has stopped, as images are copied. extra: numbers worth a column, such as the samples that were
        spent, or a function for them likewise.
        """
        self._images = {"color": color, "diffuse": diffuse, "specular": specular, "indirect": indirect}
        self._extra = extra or {}

    def finish(self) -> None:
        """Have the device compute what of the images it has put off. Part of a frame's time."""
        evaluate([image for image in self._images.values() if image is not None and not callable(image)])

    @cached_property
    def extra(self) -> dict[str, float]:
        """Numbers worth a column."""
        return dict(self._extra() if callable(self._extra) else self._extra)

    @cached_property
    def color(self) -> NDArray[Any]:
        """All of the light, on the host."""
        return on_host(self._images["color"])

    @cached_property
    def diffuse(self) -> NDArray[Any] | None:
        """The diffuse part, on the host."""
        return on_host(self._images["diffuse"])

    @cached_property
    def specular(self) -> NDArray[Any] | None:
        """The specular part, on the host."""
        return on_host(self._images["specular"])

    @cached_property
    def indirect(self) -> NDArray[Any] | None:
        """The indirect part, on the host."""
        return on_host(self._images["indirect"])


def on_host(image: Any) -> Any:
    """An array of any library, or what a function makes, as one of NumPy; None stays None."""
    if callable(image):
        image = image()
    torch = sys.modules.get("torch")
    if torch is not None and isinstance(image, torch.Tensor):
        return image.detach().cpu().numpy()
    return None if image is None else np.asarray(image)


def evaluate(arrays: Any) -> None:
    """Have Dr.Jit compute those of the arrays that it has put off."""
    if drjit := sys.modules.get("drjit"):
        drjit.eval(arrays)


class Implementation(Protocol):
    """The stages. One object serves one training, or one scene, one preparation and one seed.

    A constructor takes the settings (`Method.settings`). A method whose card says `trains` has `train` too, see
    `Trainable`. One whose knobs that do not bake may be turned after `prepare` has `adjust`, which takes
    settings as the constructor does, from the next frame on.
    """

    def __init__(self, settings: Mapping[str, Setting]) -> None:
        """settings: every knob of the method."""

    def prepare(self, site: Site) -> None:
        """Bake and train for a scene. Called once."""

    def render(self, view: View, stages: Stages) -> Prediction:
        """Render one frame. The harness reads the clock around it; stages tells its parts apart."""


class Trainable(Protocol):
    """An implementation that trains, once for all rooms where the track has rooms to train on."""

    def train(self, training: Training) -> float | None:
        """Learn, and put into `training.folder` what `prepare` will need. The object is not used afterwards.

        May return seconds that were spent before, in a run that was cut off.
        """
