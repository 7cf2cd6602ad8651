"""The commands `gibench` and `make-dataset`.

A mistake of the user ends with one line on stderr and exit code 2, a failure with one line and code 1, Ctrl-C
with 130; with GIBENCH_DEBUG set in the environment the traceback is shown too.
"""

from __future__ import annotations

import os
import sys
from typing import NoReturn

import typer

from gibench.errors import GibenchError

#: Exit code by the name of the error; every other `GibenchError` is a failure, 1.
EXIT_CODES = {
    **dict.fromkeys(("RecipeError", "FolderError", "DatasetError", "SceneFileError"), 2),
    **dict.fromkeys(("TrackError", "RegistryError", "ResultsError", "MethodError", "UnknownMetricError"), 2),
    "Interrupted": 130,
}


def main() -> NoReturn:
    """Run the command `gibench`."""
    from gibench.cli.app import app

    sys.exit(run(app))


def make_dataset() -> NoReturn:
    """Run the command `make-dataset`, the short form of `gibench dataset make`."""
    from gibench.cli.app import make_app

    sys.exit(run(make_app))


def run(app: typer.Typer, arguments: list[str] | None = None) -> int:
    """Run a command and return its exit code. arguments: those of the process by default."""
    try:
        code = typer.main.get_command(app).main(arguments, standalone_mode=False)
    except typer.TyperException as problem:  # misuse of the command line itself
        return _failed(problem.format_message(), problem.exit_code)
    except typer.Abort:
        return _failed("stopped", 130)
    except GibenchError as problem:
        if os.environ.get("GIBENCH_DEBUG"):
            raise
        return _failed(str(problem), EXIT_CODES.get(type(problem).__name__, 1))
    except KeyboardInterrupt:
        return _failed("stopped", 130)
    return code if isinstance(code, int) else 0


def _failed(message: str, code: int) -> int:
    typer.echo(f"error: {' '.join(message.split())}", err=True)
    return code
