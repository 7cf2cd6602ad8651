"""One room, from its number to its folder. This is what workers run; only here is anything rendered."""

from __future__ import annotations

import errno
import hashlib
import importlib.metadata
import math
import shutil
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

import gibench
from gibench.datasets import exr, unfinished
from gibench.datasets.errors import RecipeError, StorageError
from gibench.datasets.files import as_json, process_number, sync_tree
from gibench.datasets.folder import RECORD, partial_folder, room_folder
from gibench.datasets.lightings import keep_panorama
from gibench.datasets.recipes import ENVIRONMENTS, Recipe
from gibench.datasets.records import PROCESSOR
from gibench.datasets.splits import split_of
from gibench.generators.parts import Room
from gibench.generators.shots import shot_before, shot_of
from gibench.rendering.machine import processor
from gibench.rendering.panoramas import Panorama

if TYPE_CHECKING:
    from gibench.generators.environments.files import EnvironmentFile
    from gibench.generators.imported.room import ImportedRoom
    from gibench.generators.imported.scene import ImportedScene
    from gibench.rendering.light_rig import LightRig
    from gibench.rendering.render import RenderedFrame
    from gibench.rendering.scene import Scene

#: Lane of the random numbers that rendering draws; far above those that the generators spawn for a room.
RENDER_LANE = 1000

#: Other packages whose version decides what the pixels are, beside those that the renderer names itself.
GENERATING = ("numpy", "scipy", "shapely", "trimesh", "colour-science")


@dataclass(frozen=True)
class Renderer:
    """Makes a worker ready; the answer says what will make the pixels.

    threads: CPU threads that this worker may use. recipe: its environments are looked through before anything is made.
    """

    variant: str
    threads: int
    recipe: Recipe

    def __call__(self) -> dict[str, Any]:
        """Return `variant`, `versions` and `gpu`. Raises `BackendError`, and `RecipeError` for a bad environment."""
        from gibench.generators.daylight import BadEnvironment, hdr
        from gibench.rendering import backend

        variant = backend.select_variant(self.variant)
        backend.limit_threads(self.threads)
        if self.recipe.environment not in ENVIRONMENTS:
            try:
                hdr(path=self.recipe.environment, rotation=0.0, lux=1.0)
            except BadEnvironment as problem:
                raise RecipeError(f"environment: {problem}") from None
        panoramas_of(self.recipe)
        return {
            "variant": variant,
            "versions": versions_here(),
            "gpu": backend.find_gpu() if variant.startswith("cuda") else None,
        }


def versions_here() -> dict[str, str]:
    """Versions that decide the pixels, by package. After the variant is selected."""
    from gibench.rendering import backend

    versions = {"gibench": gibench.__version__}
    versions |= {name: importlib.metadata.version(name) for name in GENERATING}
    return versions | backend.versions()


def frame_seed(recipe: Recipe, room: int, view: int) -> int:
    """Seed of a frame's samples: 32 bits that depend on the recipe's two seeds, the room and the view alone."""
    lane = (room, RENDER_LANE, view, *([recipe.sample_seed] if recipe.sample_seed else []))
    return int(np.random.SeedSequence(recipe.seed, spawn_key=lane).generate_state(1)[0])


def imported(recipe: Recipe, room: int) -> ImportedScene:
    """The scene of room number `room`, read from its files. Raises `SceneFileError`."""
    from gibench.generators.imported.scene import import_scene

    return import_scene(Path(recipe.scenes[room]), recipe.import_settings())


@lru_cache(maxsize=1)
def _panoramas(files: tuple[EnvironmentFile, ...]) -> tuple[Panorama, ...]:
    from gibench.generators.daylight import BadEnvironment
    from gibench.generators.environments.files import read_environment

    try:
        return tuple(Panorama.of(file.name, read_environment(file.path)) for file in files)
    except BadEnvironment as problem:
        raise RecipeError(f"environments: {problem}") from None


def panoramas_of(recipe: Recipe) -> tuple[Panorama, ...]:
    """The environments of a recipe, none where it has none. Raises `RecipeError` for one that lights nothing."""
    return _panoramas(recipe.environment_files()) if recipe.environments else ()


def sampled_room(recipe: Recipe, room: int) -> Room | ImportedRoom:
    """Build or import room number `room` of a recipe, with the light of its frames; nothing is written.

    Raises `RejectedRoom`, `SceneFileError`.
    """
    from gibench.generators.shots import AreaLights, Environments, light_space, lit

    built = _sampled(recipe, room)
    if recipe.lighting == "area-light":
        aspect = recipe.resolution[0] / recipe.resolution[1]
        built = lit(built, AreaLights(light_space(built), aspect), recipe.moves())
    elif recipe.lighting == "environments":
        built = lit(built, Environments(panoramas_of(recipe), recipe.rotations), recipe.moves())
    return _opened(built, recipe.opened)


def _opened(room: Room | ImportedRoom, opened: str) -> Room | ImportedRoom:
    """After cameras and lights have found their places, which they have between walls and under a ceiling."""
    if opened == "none":
        return room
    if isinstance(room, Room):
        from gibench.generators.opened import opened_room

        return opened_room(room, opened)
    from gibench.generators.imported.room import opened_import

    return opened_import(room, opened)


def _sampled(recipe: Recipe, room: int) -> Room | ImportedRoom:
    if recipe.scenes:
        from gibench.generators.imported.room import import_room

        return import_room(
            imported(recipe, room),
            resolution=recipe.resolution,
            seed=recipe.seed,
            index=room,
            views=recipe.views,
            path=None if recipe.path == "stills" or recipe.path_views else recipe.path,
            sequences=recipe.plans(),
            spread=recipe.spread,
        )
    from gibench.generators.rooms import sample_room

    return sample_room(
        recipe.seed,
        room,
        kinds=recipe.kinds,
        views=recipe.views,
        path=None if recipe.path == "stills" or recipe.path_views else recipe.path,
        sequences=recipe.plans(),
        spread=recipe.spread,
        environment=None if recipe.environment == "auto" else recipe.environment,
        gloss=recipe.gloss,
    )


def written_room(room: Room | ImportedRoom, folder: Path, recipe: Recipe) -> None:
    """Write everything of a room but its frames."""
    settings: dict[str, Any] = {
        # Mitsuba counts segments, of which there is one more than scattering events.
        "max_depth": recipe.max_depth + 1,
        "resolution": recipe.resolution,
        "spp": recipe.spp or recipe.spp_cap,
    }
    if recipe.scenes:
        from gibench.generators.imported.room import write_imported_room

        write_imported_room(cast("ImportedRoom", room), folder, **settings)
    else:
        from gibench.generators.scene_files import write_room

        write_room(cast(Room, room), folder, **settings)


@dataclass(frozen=True)
class LoadedRoom:
    """A room that is ready to be rendered. rig: None where all frames have the room's own light."""

    recipe: Recipe
    room: Room | ImportedRoom
    scene: Scene
    rig: LightRig | None

    @classmethod
    def of(cls, recipe: Recipe, room: Room | ImportedRoom, folder: Path) -> LoadedRoom:
        """From the folder that it was written into."""
        from gibench.rendering.scene import load_scene

        scene = load_scene(folder / "scene.xml", share_kernels=True, sampling=recipe.room_sampling)
        if not room.lightings:
            return cls(recipe, room, scene, None)
        from gibench.rendering.light_rig import LightRig

        rig = LightRig(scene, panoramas=recipe.lighting == "environments")
        return cls(recipe, room, rig.scene, rig)

    def rendered(self, view: int, **settings: Any) -> RenderedFrame:
        """Render one view with the recipe's settings, or with other `settings` of `render_frame`."""
        from gibench.rendering.render import render_frame

        recipe, room = self.recipe, self.room
        shot, before = shot_of(room, view), shot_before(room, view)
        if self.rig is not None:
            self.rig.set(shot.lighting)
        samples = (
            {"spp": recipe.spp}
            if recipe.error is None
            else {"error": recipe.error, "spp_cap": recipe.spp_cap}
        )
        return render_frame(
            self.scene,
            shot.camera,
            **{
                "resolution": recipe.resolution,
                "channels": recipe.channels,
                "seed": frame_seed(recipe, room.index, view),
                "max_depth": recipe.max_depth,
                "denoise": recipe.denoise,
                "previous_camera": None if before is None else before.camera,
                **samples,
                **settings,
            },
        )


@dataclass(frozen=True)
class RoomMaker:
    """Makes whole room folders of one dataset; the job that workers are given.

    Returns the room's record, as it lies in `frames.json`, or {"rejected": reason} where no try of the room
    passed the checks of the generators.
    """

    root: Path
    recipe: Recipe

    def __call__(self, room: int, report: Callable[[str, Any], None]) -> dict[str, Any]:
        """Make room number `room`; reports ("frame", {"paths", "seconds" in kernels}) after each frame."""
        from gibench.generators.imported.errors import NoPlaceForCamera
        from gibench.generators.rooms import RejectedRoom

        final = room_folder(self.root, room)
        partial = partial_folder(self.root, room, process_number())
        partial.mkdir(parents=True)
        try:
            record = self._filled(partial, room, report)
            (partial / RECORD).write_bytes(as_json(record))
            (partial / unfinished.JOURNAL).unlink(missing_ok=True)
            sync_tree(partial)
            _renamed(partial, final)
            unfinished.forget_frames(self.root, room)
        except (RejectedRoom, NoPlaceForCamera) as reason:
            shutil.rmtree(partial)
            unfinished.forget_frames(self.root, room)
            if len(self.recipe.scenes) == 1:
                raise
            return {"rejected": str(reason)}
        except BaseException:
            unfinished.keep_frames(self.root, room, partial)
            raise
        return record

    def _filled(self, folder: Path, number: int, report: Callable[[str, Any], None]) -> dict[str, Any]:
        recipe = self.recipe
        clock = Stopwatch()
        room = sampled_room(recipe, number)
        clock.lap("build")
        written_room(room, folder, recipe)
        clock.lap("write")
        loaded = LoadedRoom.of(recipe, room, folder)
        clock.lap("load")
        files = {
            str(path.relative_to(folder).as_posix()): _fingerprint(path.read_bytes())
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        }
        (folder / "frames").mkdir()
        for lighting in dict.fromkeys(room.lightings):
            if lighting.environment is not None:
                keep_panorama(self.root, lighting.environment.panorama)
        waiting = unfinished.WaitingFrames(self.root, number)
        kept: list[dict[str, Any]] = []
        frames: list[Future[dict[str, Any]]] = []
        # Compressing and writing a frame goes on while the next one renders. One frame at most waits for it,
        # so memory does not grow with the number of views.
        with ThreadPoolExecutor(max_workers=1) as writer:
            for view in recipe.rendered_views(room.given_cameras, number):
                if (waited := waiting.take(self._known(room, view), folder)) is not None:
                    kept.append(waited)
                    report("frame", {"paths": 0, "seconds": 0.0})
                    continue
                rendered = loaded.rendered(view)
                report("frame", {"paths": rendered.paths, "seconds": rendered.kernel_seconds})
                if frames:
                    frames[-1].result()
                frames.append(writer.submit(self._stored, folder, room, view, rendered))
        records = sorted([*kept, *(frame.result() for frame in frames)], key=lambda record: record["view"])
        clock.lap("render")
        return {
            "room": number,
            "kind": room.kind,
            "split": split_of(number, recipe.splits),
            "given_cameras": room.given_cameras,
            "materials": list(loaded.scene.materials),
            "shapes": list(loaded.scene.shapes),
            "rejections": dict(room.rejections),
            "seconds": clock.laps,
            "frames": records,
            "files": files,
        }

    def _known(self, room: Room | ImportedRoom, view: int) -> dict[str, Any]:
        """What the record of a frame says that is known before it is rendered."""
        from gibench.generators.scene_files import lighting_record

        camera = room.cameras[view]
        return {
            "view": view,
            "file": f"frames/{view:04d}.exr",
            "camera": list(camera.position),
            "target": list(camera.target),
            "fov": camera.fov,
            **camera.peculiarities,
            "path": camera.path,
            "step": camera.step,
            **({"lighting": lighting_record(room.lightings[view])} if room.lightings else {}),
            "seed": frame_seed(self.recipe, room.index, view),
        }

    def _stored(
        self, folder: Path, room: Room | ImportedRoom, view: int, rendered: RenderedFrame
    ) -> dict[str, Any]:
        from gibench.metrics import reference_exposure

        try:
            content = exr.encode(rendered.arrays)
        except StorageError as problem:
            raise StorageError(f"view {view}: {problem}") from None
        known = self._known(room, view)
        (folder / known["file"]).write_bytes(content)
        color = rendered.arrays.get("color")
        record = {
            **known,
            **_fingerprint(content),
            "exposure": None if color is None else float(reference_exposure(color)),
            "largest": None if color is None else float(color.max()),
            "spp": rendered.spp,
            "paths": rendered.paths,
            "invalid_paths": rendered.invalid_paths,
            "median_error": rendered.median_error if math.isfinite(rendered.median_error) else None,
            "kernel_seconds": rendered.kernel_seconds,
            "denoise_seconds": rendered.denoise_seconds,
            "denoise_change": rendered.denoise_change,
            "processor": processor()[:PROCESSOR],
            "seconds": rendered.seconds,
        }
        unfinished.write_down(folder, record)
        return record


def _renamed(partial: Path, final: Path) -> None:
    """Give a whole room its name. A room that another worker has made in the meantime is the same, and stays."""
    try:
        partial.rename(final)
    except OSError as problem:
        if problem.errno not in (errno.EEXIST, errno.ENOTEMPTY) or not (final / RECORD).is_file():
            raise
        shutil.rmtree(partial, ignore_errors=True)


class Stopwatch:
    """Seconds of wall time between laps, by the lap's name."""

    def __init__(self) -> None:
        """Start the first lap."""
        self.laps: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        """End the current lap and call it `name`."""
        now = time.perf_counter()
        self.laps[name] = now - self._last
        self._last = now


def _fingerprint(content: bytes) -> dict[str, Any]:
    return {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
