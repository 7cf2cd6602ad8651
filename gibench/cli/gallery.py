"""`gibench gallery`: a page of pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gibench.cli.dataset import check_variant
from gibench.cli.output import say


def gallery(
    out: Annotated[Path, typer.Option(help="A folder, new or of an earlier run.", show_default=False)],
    results: Annotated[
        list[Path] | None,
        typer.Option(help="Results whose methods to show; may be repeated.", show_default=False),
    ] = None,
    rooms: Annotated[int, typer.Option(min=1, max=100, help="How many rooms to show.")] = 20,
    spp: Annotated[int, typer.Option(min=1, max=2**20, help="Samples a pixel, then denoised.")] = 64,
    workers: Annotated[int, typer.Option(min=1, max=64, help="Processes at the same time.")] = 1,
    variant: Annotated[str, typer.Option(help="Mitsuba's, or auto: the fastest that works.")] = "auto",
) -> None:
    """Render rooms, channels, a moving light and environments, and show them on a page; the same command continues."""
    from gibench.benchmarks.gallery import make_gallery
    from gibench.cli.progress import making

    check_variant(variant)
    with making() as on_progress:
        page = make_gallery(
            out,
            results or (),
            rooms=rooms,
            spp=spp,
            workers=workers,
            variant=variant,
            on_progress=on_progress,
        )
    say(str(page))
