"""The table of a run: CSV for programs, Markdown for people."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

from gibench.datasets.files import write_whole
from gibench.stress.registry import FAIL, KNOWN, MENDED, PASS, SUBJECTS
from gibench.stress.running import Report, Row

COLUMNS = ("subject", "case", "part", "what", "error", "bound", "verdict", "seconds", "source", "known")


def columns_of(row: Row) -> dict[str, Any]:
    """A row as it stands in the CSV file; COLUMNS are its keys."""
    check = row.check
    return {
        "subject": row.subject,
        "case": row.case,
        "part": check.part,
        "what": check.what,
        "error": f"{check.error:.3g}",
        "bound": f"{check.bound:.3g}",
        "verdict": check.verdict,
        "seconds": f"{row.seconds:.2f}",
        "source": check.source,
        "known": check.known,
    }


def write_tables(report: Report, out: Path) -> list[Path]:
    """Write stress.csv, stress.md and a CSV file of each curve; returns their paths."""
    written = [_write_csv(out / "stress.csv", [columns_of(row) for row in report.rows])]
    written += [_write_csv(out / f"{curve.name}.csv", list(curve.rows)) for curve in report.curves]
    write_whole(out / "stress.md", markdown(report).encode())
    return [*written, out / "stress.md"]


def summary(report: Report) -> str:
    """Number of cases and checks by verdict, in one line."""
    counts = [
        f"{len(report.of(verdict))} {verdict}"
        for verdict in (PASS, KNOWN, MENDED, FAIL)
        if report.of(verdict)
    ]
    return f"{report.cases} cases, {len(report.rows)} checks: {', '.join(counts)}; {report.seconds:.0f} s"


def markdown(report: Report) -> str:
    """A table a subject, and the reasons of what is known below."""
    lines = [summary(report), ""]
    for subject in SUBJECTS:
        rows = [row for row in report.rows if row.subject == subject]
        if not rows:
            continue
        lines += [f"### {subject.capitalize()}", ""]
        lines += ["| case | part | error of | error | bound | verdict | s | bound from |"]
        lines += ["| --- | --- | --- | --- | --- | --- | --- | --- |"]
        before = ""
        for row in rows:
            shown = {key: str(value).replace("|", "\\|") for key, value in columns_of(row).items()}
            name = "" if row.case == before else shown["case"]
            verdict = shown["verdict"] if row.check.verdict == PASS else f"**{shown['verdict']}**"
            cells = (name, shown["part"], shown["what"], shown["error"], shown["bound"], verdict)
            lines.append(f"| {' | '.join((*cells, f'{row.seconds:.1f}', shown['source']))} |")
            before = row.case
        lines.append("")
    reasons: dict[str, list[str]] = {}
    for row in report.rows:
        if row.check.known:
            reasons.setdefault(row.check.known, []).append(row.case)
    if reasons:
        lines += ["### Known", ""]
        lines += [f"- {'; '.join(dict.fromkeys(cases))}: {reason}." for reason, cases in reasons.items()]
        lines.append("")
    return "\n".join(lines)


def _write_csv(path: Path, rows: list[dict[str, Any]]) -> Path:
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]) if rows else COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_whole(path, text.getvalue().encode())
    return path
