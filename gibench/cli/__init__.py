"""The commands `gibench` and `make-dataset`.

A mistake of the user ends with one line on stderr and exit code 2, a failure with one line and code 1, Ctrl-C
with 130, SIGTERM with 143 and SIGHUP with 129; with GIBENCH_DEBUG set in the environment the traceback is shown too.
"""

from __future__ import annotations

import os
import sys
from typing import NoReturn

import typer

from gibench.cli.output import say
from gibench.errors import GibenchError

#: Exit code by the name of the error; every other `GibenchError` is a failure, 1.
EXIT_CODES = {
    **dict.fromkeys(("RecipeError", "FolderError", "DatasetError", "SceneFileError", "GateError"), 2),
    **dict.fromkeys(("NoPlaceForCamera", "BadScene", "ClusterError"), 2),
    **dict.fromkeys(("UnknownChannelError", "UnknownChannel"), 2),
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
    from gibench.cli.stopping import stoppable

    with stoppable() as received:
        try:
            code = _answered(app, arguments)
        except KeyboardInterrupt:
            code = _failed("stopped", 130)
        except OSError as problem:
            if os.environ.get("GIBENCH_DEBUG"):
                raise
            code = _no_output(problem)
    return 128 + received[0] if received else code


def _answered(app: typer.Typer, arguments: list[str] | None) -> int:
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
    sys.stdout.flush()  # here, so that a full disk behind it is told of
    return code if isinstance(code, int) else 0


def _failed(message: str, code: int) -> int:
    try:
        say(f"error: {' '.join(message.split())}", err=True)
    except OSError:  # nobody reads, or the disk behind it is full
        _silence()
    return code


def _no_output(problem: OSError) -> int:
    """End where something could not be written or read that no part of the program answers for."""
    if isinstance(problem, BrokenPipeError):  # whoever read has had enough, as `head` has
        _silence()
        return 141
    reason = problem.strerror or " ".join(str(problem).split())
    where = problem.filename or "what the command prints"
    code = _failed(f"{where}: {reason}", 1)
    _silence()
    return code


def _silence() -> None:
    """Keep Python from writing again, at its end, what could not be written."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
