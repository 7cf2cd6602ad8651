"""`gibench environments`: panoramas of generated rooms, to train on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gibench.cli.dataset import check_variant
from gibench.cli.output import say


def environments(
    out: Annotated[Path, typer.Option(help="A folder, new or of an earlier run.", show_default=False)],
    count: Annotated[int, typer.Option(min=1, max=99999, help="How many panoramas.")] = 100,
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, help="Decides every room.")] = 0,
    spp: Annotated[int, typer.Option(min=1, max=2**20, help="Samples a pixel, then denoised.")] = 64,
    workers: Annotated[int, typer.Option(min=1, max=64, help="Processes at the same time.")] = 1,
    variant: Annotated[str, typer.Option(help="Mitsuba's, or auto: the fastest that works.")] = "auto",
) -> None:
    """Render environment maps of furnished rooms that are in no dataset; the same command continues."""
    from gibench.cli.progress import counting
    from gibench.datasets.environment_panoramas import make_environments

    check_variant(variant)
    with counting("panoramas") as on_done:
        files = make_environments(
            out, count=count, seed=seed, spp=spp, variant=variant, workers=workers, on_done=on_done
        )
    say(f"{len(files)} panoramas in {out}: make-dataset --environments {out}")
