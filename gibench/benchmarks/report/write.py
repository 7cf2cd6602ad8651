"""From a run to everything that is read of it: CSV files, tables, plots, and the page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gibench.benchmarks.report.runs import Runs
from gibench.benchmarks.report.source import ReportError, ReportSource
from gibench.benchmarks.results import Results


def write_report(
    results: ReportSource | Results | Sequence[Results], out: Path, *, against: str | None = None
) -> Path:
    """Write leaderboard.csv, frames.csv, stages.csv and more, tables/, plots/, and index.html with its images.

    results: a run, or several, of one track or of several.

    against: the label of a setting, or a method with one setting, that differences are taken against.

    Returns: the path of index.html, which is written last.

    Raises:
        ReportError: for a run without results, or an `against` that is not there.
        GibenchError: where a result's images cannot be read.
        OSError: when the disk is full.
    """
    try:
        import jinja2  # noqa: F401
        import matplotlib  # noqa: F401
    except ImportError as problem:
        raise ReportError(f"a report needs {problem.name}: pip install 'gibench[bench]'") from problem
    from gibench.benchmarks.report.csv_files import write_csv_files
    from gibench.benchmarks.report.image_files import write_images
    from gibench.benchmarks.report.page import write_page
    from gibench.benchmarks.report.plots import write_plots
    from gibench.benchmarks.report.summary import summarise
    from gibench.benchmarks.report.tables import write_tables

    if isinstance(results, Results):
        results = Runs([results])
    elif isinstance(results, Sequence):
        results = Runs(results)
    summary = summarise(results, against=against)
    again = (out / "index.html").is_file()
    for folder in (out, out / "tables", out / "plots"):
        folder.mkdir(parents=True, exist_ok=True)
    written = {
        *write_csv_files(results, summary, out),
        *write_tables(results, summary, out / "tables"),
        *write_plots(results, summary, out / "plots"),
        *write_images(results, summary.results[summary.results["status"] == "ok"], out),
    }
    page = write_page(results, summary, out)
    if again:
        _remove_older(out, written)
    return page


OWN = (
    *(
        f"tables/*{name}*.{kind}"
        for name in ("errors", "preparation", "frame-time", "failed")
        for kind in ("md", "tex")
    ),
    *(
        f"plots/*{name}*.{kind}"
        for name in ("error-a", "stages", "training-curves")
        for kind in ("svg", "png")
    ),
    *(f"{kind}/*/[0-9][0-9][0-9][0-9]-*.js" for kind in ("images", "errors")),
)
"""Names of what a report writes beside its page and CSV files, by which an older one's in the same folder are known."""


def _remove_older(out: Path, written: set[Path]) -> None:
    """Remove what a report of before left that this one does not have: a table of what failed then, say."""
    for pattern in OWN:
        for path in out.glob(pattern):
            if path not in written and not path.is_symlink():
                path.unlink()
    for folder in (*out.glob("images/*"), *out.glob("errors/*")):
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
