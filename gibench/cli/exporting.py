"""`gibench dataset export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gibench.cli.output import say


def export(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The dataset's folder.", show_default=False)],
    to: Annotated[
        str,
        typer.Option(help="nerfstudio, webdataset, hypersim-like-hdf5 or huggingface.", show_default=False),
    ],
    out: Annotated[Path, typer.Option(help="A folder that does not exist yet.", show_default=False)],
    channels: Annotated[
        str | None, typer.Option(help="Sets or channels, such as color,surface.", show_default="all")
    ] = None,
    split: Annotated[str | None, typer.Option(help="One split only.", show_default="all")] = None,
) -> None:
    """Write a dataset in the layout that another tool reads."""
    from gibench.cli.dataset import names_in
    from gibench.cli.progress import counting
    from gibench.datasets.export import export as write
    from gibench.datasets.loading import open_dataset
    from gibench.rendering.channels import resolve

    dataset = open_dataset(folder)
    if split is not None:
        dataset = dataset.split(split)
    names = () if channels is None else resolve(names_in(channels, "--channels"))
    with counting("frames exported") as on_frame:
        say(str(write(dataset, to, out, channels=names, tell=on_frame)))
