"""`gibench convert`: a scene file of any age as a folder that Mitsuba 3 opens."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gibench.cli.dataset import AllowMissing, AllowOutside, Parameters, Scale, UpAxis
from gibench.cli.output import say


def convert(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="A Mitsuba scene file.", show_default=False)],
    out: Annotated[Path, typer.Option(help="A new folder.", show_default=False)],
    up: UpAxis = None,
    scale: Scale = None,
    allow_missing: AllowMissing = False,
    allow_outside: AllowOutside = False,
    define: Parameters = None,
) -> None:
    """Write a scene for Mitsuba 3: Z up, metres, with all its files, and say what was changed."""
    from gibench.cli.making import print_scene
    from gibench.datasets.files import whole_folder
    from gibench.generators.imported.errors import SceneFileError
    from gibench.generators.imported.room import describe, import_room, write_imported_room
    from gibench.generators.imported.scene import ImportSettings, import_scene

    settings = ImportSettings(
        up or "auto",
        1.0 if scale is None else scale,
        allow_missing,
        allow_outside,
        parameters=tuple(define or ()),
    )
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise SceneFileError(f"{out} is there already: choose a new folder with --out")
    read = import_scene(scene, settings)
    room = import_room(read, resolution=read.resolution, views=0 if read.cameras else 1)
    try:
        with whole_folder(out.resolve()) as partial:
            write_imported_room(room, partial, max_depth=read.max_depth, resolution=read.resolution, spp=64)
    except OSError as problem:
        where = f"{problem.filename}: " if problem.filename else ""
        raise SceneFileError(f"{out} cannot be written: {where}{problem.strerror or problem}") from None
    print_scene(describe(room))
    say(str(out / "scene.xml"))
