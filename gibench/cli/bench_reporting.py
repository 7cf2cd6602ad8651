"""The work of `gibench bench report`: a report into a folder, into one file, or out of one."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from gibench.cli.output import say
from gibench.errors import GibenchError


def write_and_print(results: Sequence[Path], out: Path | None, archive: Path | None) -> None:
    """Write what was asked for and say where it is.

    results: runs, or a file that `archive` made. out: a folder for the page. archive: a file to pack it into. Raises
    TrackError for options that contradict each other, ReportError, ResultsError, or GibenchError where the disk
    refuses.
    """
    from gibench.benchmarks.errors import ResultsError, TrackError
    from gibench.benchmarks.report import write_report
    from gibench.benchmarks.report.archive import pack, unpack
    from gibench.benchmarks.results import load
    from gibench.cli.bench_board import mixed

    try:
        packed = next((path for path in results if path.is_file()), None)
        if packed is not None:
            if out is None or archive is not None or len(results) > 1:
                raise TrackError(
                    f"{packed} is a packed report: name it alone, a new folder for it with --out, and no --archive"
                )
            say(str(unpack(packed, out)))
            return
        if out is None and archive is None:
            raise TrackError("name a folder with --out, or a file with --archive, or both")
        loaded = [load(folder) for folder in results]
        for one in loaded:
            for label in one.mixed:
                say(mixed(label), err=True)
            for record in one.records():
                if record["status"] == "ok" and (changed := one.folder.changed_frame(record)):
                    file = one.folder.result_file(record["id"])
                    raise ResultsError(f"{file}: {changed}: remove it and run the same command again")
        if out is not None:
            write_report(loaded, out)
            say(str(out / "index.html"))
        if archive is not None:
            with tempfile.TemporaryDirectory() as scratch:
                if out is None:
                    write_report(loaded, Path(scratch) / "report")
                say(str(pack(out or Path(scratch) / "report", archive)))
    except OSError as problem:
        where = problem.filename or out or archive
        raise GibenchError(f"{where} cannot be written: {problem.strerror}") from None
