"""The commands. Nothing heavy is imported before a command runs, so that `--help` is quick."""

from __future__ import annotations

from typing import Annotated

import typer

from gibench import __version__
from gibench.cli import bench, convert, dataset, doctor, environments, exporting, gallery, noise, stress
from gibench.cli.output import say

app = typer.Typer(
    name="gibench",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


def _say_version(asked: bool) -> None:
    if asked:
        say(__version__)
        raise typer.Exit


@app.callback()
def main(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_say_version, is_eager=True, help="Say the version and exit."),
    ] = False,
) -> None:
    """Datasets for, and an honest comparison of, real-time global illumination."""


dataset.app.command("export")(exporting.export)
app.add_typer(dataset.app, name="dataset")
app.add_typer(bench.app, name="bench")
app.command("convert")(convert.convert)
app.command("doctor")(doctor.doctor)
app.command("environments")(environments.environments)
app.command("gallery")(gallery.gallery)
app.command("noise")(noise.noise)
app.command("stress")(stress.stress)

make_app = typer.Typer(name="make-dataset", add_completion=False, pretty_exceptions_enable=False)
make_app.command()(dataset.make)
