"""`gibench dataset make | verify | info | preview`, and `make-dataset`."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gibench.cli.output import say
from gibench.errors import GibenchError

if TYPE_CHECKING:
    from gibench.datasets.recipes import Recipe

app = typer.Typer(help="Make, check and look at datasets.", no_args_is_help=True)

SceneFiles = Annotated[
    list[Path] | None,
    typer.Option("--scene", help="A Mitsuba scene file as a room; may be repeated.", show_default=False),
]
UpAxis = Annotated[
    str | None, typer.Option(help="Axis of the scene file that is up: x, y or z.", show_default="auto")
]
Scale = Annotated[float | None, typer.Option(help="Metres of the scene file's unit.", show_default="1")]
AllowMissing = Annotated[
    bool, typer.Option("--allow-missing", help="Leave out what needs a file that is missing.")
]
AllowOutside = Annotated[
    bool, typer.Option("--allow-outside", help="Read files outside the folder of the scene.")
]

Parameters = Annotated[
    list[str] | None,
    typer.Option(
        "-D",
        "--define",
        metavar="NAME=VALUE",
        help="A $parameter of the scene files; may be repeated.",
        show_default=False,
    ),
]

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="The dataset's folder.", show_default=False)]


@app.command()
def make(
    rooms: Annotated[int | None, typer.Option(help="How many rooms.", show_default="the preset's")] = None,
    out: Annotated[Path | None, typer.Option(help="Where to.", show_default="data/PRESET")] = None,
    preset: Annotated[
        str | None, typer.Option(help="smoke, small, paper or unseen.", show_default="small")
    ] = None,
    recipe: Annotated[
        Path | None, typer.Option(help="A recipe of your own (TOML).", show_default=False)
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Decides every room.", show_default="0")] = None,
    views: Annotated[int | None, typer.Option(help="Frames a room.", show_default=False)] = None,
    resolution: Annotated[str | None, typer.Option(help="Such as 256x192.", show_default=False)] = None,
    spp: Annotated[int | None, typer.Option(help="Samples a pixel.", show_default=False)] = None,
    error: Annotated[
        float | None,
        typer.Option(help="Sample until the median relative error is below.", show_default=False),
    ] = None,
    channels: Annotated[
        str | None, typer.Option(help="Sets or channels, such as radiance,surface.", show_default=False)
    ] = None,
    kind: Annotated[
        str | None, typer.Option(help="Kinds of rooms, such as living,office.", show_default="all")
    ] = None,
    lighting: Annotated[
        str | None,
        typer.Option(
            help="own, area-light or environments: what lights a frame, one of its own each.",
            show_default="own",
        ),
    ] = None,
    environments: Annotated[
        str | None,
        typer.Option(
            help="Maps that light frames: indoor, outdoor, train, test, a folder or file, names of maps.",
            show_default="indoor",
        ),
    ] = None,
    opened: Annotated[
        str | None,
        typer.Option(help="What is taken away: ceiling, or stage: a wall too.", show_default="none"),
    ] = None,
    gloss: Annotated[
        str | None, typer.Option(help="much: rooms with polished floors and furniture.", show_default="any")
    ] = None,
    scene: SceneFiles = None,
    up: UpAxis = None,
    scale: Scale = None,
    cameras: Annotated[
        Path | None,
        typer.Option(help="Cameras of the scene from a JSON file; none are sampled.", show_default=False),
    ] = None,
    allow_missing: AllowMissing = False,
    allow_outside: AllowOutside = False,
    define: Parameters = None,
    variant: Annotated[str, typer.Option(help="Mitsuba's, or auto: the fastest that works.")] = "auto",
    workers: Annotated[int, typer.Option(help="Processes that render at the same time.")] = 1,
    cluster: Annotated[
        str | None,
        typer.Option(
            help="Make the rooms on Dask: a scheduler's address or file, or local:N.", show_default=False
        ),
    ] = None,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Build and check the rooms; keep nothing, estimate time and disk."),
    ] = False,
) -> None:
    """Make a dataset of furnished rooms or of scenes, or continue or extend the one that the folder holds."""
    from gibench.datasets.pool import MOST_WORKERS

    if preset is not None and recipe is not None:
        raise _usage("--preset and --recipe exclude each other: keep one of them")
    if not 1 <= workers <= MOST_WORKERS:
        raise _usage(f"--workers: {workers} is not allowed; allowed is an integer from 1 to {MOST_WORKERS}")
    if cluster is not None and workers != 1:
        raise _usage("--cluster and --workers exclude each other: a cluster has workers of its own")
    if scene and (rooms is not None or kind is not None):
        raise _usage("--scene takes the place of rooms: leave out --rooms and --kind")
    if cameras is not None and views is None:
        views = 0
    asked = {
        "rooms": rooms,
        "seed": seed,
        "views": views,
        "resolution": None if resolution is None else resolution_of(resolution),
        "spp": spp,
        "error": error,
        "channels": None if channels is None else names_in(channels, "--channels"),
        "kinds": None if kind is None else names_in(kind, "--kind"),
        "lighting": lighting or (None if environments is None else "environments"),
        "environments": None if environments is None else names_in(environments, "--environments"),
        "opened": opened,
        "gloss": gloss,
        "cameras": None if cameras is None else str(cameras),
        **scene_options(scene, up, scale, allow_missing, allow_outside, define),
    }
    chosen = _recipe(preset, recipe, {key: value for key, value in asked.items() if value is not None})
    check_variant(variant)
    root = out or Path("data") / (recipe.stem if recipe is not None else preset or "small")
    if dry_run:
        from gibench.cli.making import dry_run as estimate_and_print

        estimate_and_print(chosen, variant, workers)
        return
    given = {
        "--rooms": None if chosen.scenes else chosen.rooms,
        "--out": root,
        "--preset": preset,
        "--recipe": recipe,
        "--seed": seed,
        "--views": views,
        "--resolution": resolution,
        "--spp": spp,
        "--error": error,
        "--channels": channels,
        "--kind": kind,
        "--lighting": lighting,
        "--environments": environments,
        "--opened": opened,
        "--gloss": gloss,
        "--cameras": cameras,
        "--variant": None if variant == "auto" else variant,
        "--workers": None if workers == 1 else workers,
        "--cluster": cluster,
    }
    words = [str(word) for option, value in given.items() if value is not None for word in (option, value)]
    words += scene_words(scene, up, scale, allow_missing, allow_outside, define)
    from gibench.cli.making import make_and_print

    command = shlex.join(["make-dataset", *words])
    make_and_print(root, chosen, variant, workers, command, cluster)


@app.command()
def verify(folder: Folder) -> None:
    """Check a dataset: hashes, completeness, finite values, color equal to the sum of its parts."""
    from gibench.cli.progress import counting
    from gibench.datasets.manifest import processors_told, read_manifest
    from gibench.datasets.verifying import verify as problems_of

    with counting("rooms checked") as on_room:
        problems = problems_of(folder, on_room)
    for problem in problems:
        say(f"{folder / problem.file}: {problem.what}")
    if problems:
        files = len({problem.file for problem in problems})
        say(f"error: {len(problems)} problems in {files} files of {folder}", err=True)
        raise typer.Exit(1)
    if processors := processors_told(read_manifest(folder)):
        say(f"processors: {processors}")
    say(f"{folder} is whole: every file is as it was written, every frame keeps the channel contract")


@app.command()
def info(folder: Folder) -> None:
    """Say what a dataset holds and how it was made."""
    from gibench.cli.making import describe
    from gibench.datasets.manifest import read_manifest

    describe(folder, read_manifest(folder))


@app.command()
def cache(
    folder: Folder,
    channels: Annotated[
        str | None, typer.Option(help="Sets or channels, such as radiance,normal.", show_default="all")
    ] = None,
) -> None:
    """Decode frames once into arrays that trainings read many times faster; the same command adds channels."""
    from gibench.cli.progress import amount, counting
    from gibench.datasets.cache import cache_bytes, make_cache
    from gibench.datasets.loading import open_dataset
    from gibench.rendering.channels import resolve

    names = () if channels is None else resolve(names_in(channels, "--channels"))
    with counting("frames decoded") as on_frame:
        added = make_cache(folder, names, on_frame)
    size = amount(cache_bytes(open_dataset(folder), added), "B")
    say(
        f"{folder / 'cache'}: {len(added)} channels added, {size}"
        if added
        else f"{folder / 'cache'} is there"
    )


@app.command()
def preview(
    folder: Folder,
    frame: Annotated[
        int | None, typer.Option(help="One frame with all its channels, by its number.", show_default=False)
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Where to.", show_default="preview.png or frame-N.png in DIR")
    ] = None,
) -> None:
    """Draw a contact sheet, or one frame with all its channels."""
    from gibench.datasets.errors import DatasetError
    from gibench.datasets.loading import open_dataset
    from gibench.datasets.previews import contact_sheet, frame_panel, write_picture

    dataset = open_dataset(folder)
    if not len(dataset):
        raise DatasetError(f"{folder} has no frame yet; to continue it run `{dataset.manifest['command']}`")
    if frame is None:
        path, picture = out or folder / "preview.png", contact_sheet(folder, dataset.frames)
    elif 0 <= frame < len(dataset):
        path, picture = out or folder / f"frame-{frame}.png", frame_panel(dataset[frame])
    else:
        raise _usage(f"--frame: there is no frame {frame}; {folder} has frames 0 to {len(dataset) - 1}")
    try:
        write_picture(path, picture)
    except OSError as problem:
        raise GibenchError(f"{path} cannot be written: {problem.strerror}") from None
    say(str(path))


def scene_options(
    scenes: list[Path] | None,
    up: str | None,
    scale: float | None,
    allow_missing: bool,
    allow_outside: bool,
    define: list[str] | None = None,
) -> dict[str, Any]:
    """Keys of a recipe for the options of imported scenes; None where an option was not given."""
    return {
        "scenes": tuple(map(str, scenes)) if scenes else None,
        "up": up,
        "scale": scale,
        "allow_missing": allow_missing or None,
        "allow_outside": allow_outside or None,
        "parameters": tuple(define) if define else None,
    }


def scene_words(
    scenes: list[Path] | None,
    up: str | None,
    scale: float | None,
    allow_missing: bool,
    allow_outside: bool,
    define: list[str] | None = None,
) -> list[str]:
    """The same options as words of a command line."""
    words = [word for scene in scenes or () for word in ("--scene", str(scene))]
    words += [] if up is None else ["--up", up]
    words += [] if scale is None else ["--scale", repr(scale)]
    words += ["--allow-missing"] if allow_missing else []
    words += ["--allow-outside"] if allow_outside else []
    return words + [word for text in define or () for word in ("-D", text)]


def _recipe(preset: str | None, recipe: Path | None, overrides: dict[str, Any]) -> Recipe:
    from gibench.datasets.recipes import load_preset, load_recipe

    return load_recipe(recipe, overrides) if recipe is not None else load_preset(preset or "small", overrides)


def check_variant(variant: str) -> None:
    """Raise a named error for a variant that does not exist."""
    from gibench.datasets.errors import nearest
    from gibench.rendering.backend import VARIANTS

    if variant not in ("auto", *VARIANTS):
        raise _usage(f"--variant: no variant '{variant}'; {nearest(variant, ('auto', *VARIANTS))}")


def resolution_of(text: str) -> tuple[int, int]:
    """Width and height, as an option gives them."""
    match = re.fullmatch(r"(\d{1,6})[x×](\d{1,6})", text.strip().lower())
    if match is None:
        raise _usage(f"--resolution: '{text}' is no resolution; write WIDTHxHEIGHT, like 256x192")
    return int(match[1]), int(match[2])


def names_in(text: str, option: str) -> tuple[str, ...]:
    """Names with commas between them, as an option gives them."""
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    if not names:
        raise _usage(f"{option}: '{text}' names nothing; write names with commas between them")
    return names


def _usage(message: str) -> GibenchError:
    from gibench.datasets.errors import RecipeError

    return RecipeError(message)
