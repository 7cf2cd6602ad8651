"""`gibench noise`: where the noise of a frame is."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gibench.cli.dataset import (
    AllowMissing,
    AllowOutside,
    Parameters,
    Scale,
    UpAxis,
    check_variant,
    resolution_of,
)
from gibench.cli.output import one_line, say

if TYPE_CHECKING:
    from gibench.rendering.noise.splitting import FrameNoise, Split, WorstPath

NAME = 46
"""Columns of the names of terms."""

ROWS = 10
"""Terms of a split that are printed; the smaller ones are summed."""


def noise(
    scene: Annotated[
        Path,
        typer.Argument(
            metavar="SCENE", help="A scene file, or a room: DIR/rooms/000000.", show_default=False
        ),
    ],
    view: Annotated[int, typer.Option(min=0, help="Which frame of the room, or camera of the file.")] = 0,
    resolution: Annotated[str, typer.Option(help="Of the frame.")] = "96x64",
    spp: Annotated[int, typer.Option(min=2, max=2**20, help="Samples a pixel.")] = 64,
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, help="Decides every path.")] = 0,
    sampling: Annotated[
        str | None, typer.Option(help="plain or guided.", show_default="the dataset's, or plain")
    ] = None,
    paths: Annotated[int, typer.Option(min=0, max=1000, help="How many of the worst paths to name.")] = 5,
    up: UpAxis = None,
    scale: Scale = None,
    allow_missing: AllowMissing = False,
    allow_outside: AllowOutside = False,
    define: Parameters = None,
    variant: Annotated[str, typer.Option(help="Mitsuba's, or auto: the fastest that works.")] = "auto",
    as_json: Annotated[bool, typer.Option("--json", help="For programs.")] = False,
) -> None:
    """Split the variance of a frame by depth, lobe, light and technique, and name the paths that make most of it."""
    size = resolution_of(resolution)
    check_variant(variant)
    from gibench.cli.progress import counting
    from gibench.datasets.errors import RecipeError
    from gibench.datasets.room_view import open_view
    from gibench.generators.imported.scene import ImportSettings
    from gibench.rendering.backend import select_variant
    from gibench.rendering.noise.splitting import split_noise
    from gibench.rendering.render import MAX_DEPTH
    from gibench.rendering.scene import SAMPLINGS

    if sampling not in (None, *SAMPLINGS):
        raise RecipeError(f"--sampling: there is no sampling '{sampling}'; allowed: {' or '.join(SAMPLINGS)}")
    select_variant(variant)
    settings = ImportSettings(
        up or "auto",
        1.0 if scale is None else scale,
        allow_missing,
        allow_outside,
        parameters=tuple(define or ()),
    )
    found = open_view(scene, view, sampling, settings)
    with counting("pixels") as on_pixels:
        split = split_noise(
            found.scene,
            found.camera,
            resolution=size,
            spp=spp,
            seed=seed,
            max_depth=MAX_DEPTH if found.max_depth is None else found.max_depth,
            paths=paths,
            on_pixels=on_pixels,
        )
    if as_json:
        facts = {"scene": found.name, "sampling": found.scene.sampling, **asdict(split)}
        say(json.dumps(facts, indent=1, ensure_ascii=False, allow_nan=False))
    else:
        _print(f"{found.name}: {found.scene.sampling} sampling", split)


def _print(title: str, noise: FrameNoise) -> None:
    width, height = noise.resolution
    say(one_line(title))
    say(f"{width}x{height} pixels, {noise.spp} paths each in {noise.groups} independent groups")
    if noise.invalid_paths:
        say(f"{noise.invalid_paths} paths came back with NaN or infinity and count as 0")
    if not noise.variance:
        say("no noise" if any(noise.mean) else "no light, and no noise")
        return
    say(f"relative variance {noise.variance:.3g}, {noise.noisiest:.0%} of it in 1% of the pixels")
    for axis, split in noise.splits.items():
        say("")
        say(f"{'by ' + axis:<{NAME}}{'of variance':>14}{'of light':>14}")
        _print_split(axis, split, noise.variance)
    if noise.paths:
        say("")
        say("the worst paths, one a pixel at most:")
    for path in noise.paths:
        _print_path(path)


def _print_split(axis: str, split: Split, variance: float) -> None:
    terms = [term for term in split.terms if term.variance or term.light]
    if axis != "depth":
        terms.sort(key=lambda term: -term.variance)
    rest = terms[ROWS:] if len(terms) > ROWS + 1 else []
    for term in terms[: len(terms) - len(rest)]:
        _row(term.name, term.variance / variance, term.light)
    if rest:
        own, light = (sum(getattr(term, what) for term in rest) for what in ("variance", "light"))
        _row(f"{len(rest)} others", own / variance, light)
    if len(terms) > 1:
        _row("covariances", split.covariance / variance, None)


def _row(name: str, variance: float, light: float | None) -> None:
    shown = "" if light is None else f"{light:.1%}"
    say(f"  {_short(name, NAME - 3):<{NAME - 2}}{f'{variance:.1%}':>14}{shown:>14}".rstrip())


def _print_path(path: WorstPath) -> None:
    column, row = path.pixel
    say(
        f"  pixel ({column}, {row}), depth {path.depth}: {path.contribution:.3g} x the mean there; the pixel holds "
        f"{path.pixel_share:.1%}"
    )
    for number, vertex in enumerate(path.vertices, start=1):
        x, y, z = vertex.position
        say(
            f"    {number} {_short(vertex.shape, 28):<28} {_short(vertex.material, 22):<22} {x:.2f} {y:.2f} {z:.2f}"
        )
    say(f"    found {_short(path.light, 40)} by {path.technique}")


def _short(name: str, most: int) -> str:
    name = one_line(name)
    return name if len(name) <= most else f"{name[: most - 3]}..."
