"""The commands. Nothing heavy is imported before a command runs, so that `--help` is quick."""

from __future__ import annotations

import typer

from gibench.cli import bench, convert, dataset, doctor, environments, exporting, gallery, noise, stress

app = typer.Typer(
    name="gibench",
    help="Datasets for, and an honest comparison of, real-time global illumination.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
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
