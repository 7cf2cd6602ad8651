"""A whole report as one file, to be attached to a release and opened again elsewhere.

A ZIP archive with the page, its images, CSV files, tables and plots, and first `SHA256SUMS`, as `sha256sum --check`
reads it after unpacking. The same report gives the same bytes.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import shutil
import struct
import zipfile
import zlib
from pathlib import Path

from gibench.benchmarks.report.source import ReportError
from gibench.datasets.files import sync_file, whole_folder

SUMS = "SHA256SUMS"
MOST_BYTES = 4 * 2**30
"""Of an archive unpacked; one that claims more is refused before anything is written."""

DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    NotImplementedError,
    EOFError,
    RuntimeError,
    ValueError,
    struct.error,
)
"""Errors that the reader of archives raises for those that are damaged, encrypted, or of another kind."""

_LINE = re.compile(r"([0-9a-f]{64})  (.+)")
_PIECE = 1 << 20


def pack(report: Path, file: Path) -> Path:
    """Pack the folder that `write_report` wrote. Returns the file, which appears when it is whole.

    Raises ReportError where the folder holds no report, OSError.
    """
    if not (report / "index.html").is_file():
        raise ReportError(f"{report} holds no report: write one with `gibench bench report`")
    names = sorted(
        path.relative_to(report).as_posix()
        for path in report.rglob("*")
        if path.is_file() and not path.is_symlink()
    )
    sums = "".join(f"{_sha256(report / name)}  {name}\n" for name in names)
    beside = file.with_name(f".{file.name}.partial-{os.getpid()}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(beside, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(_entry(SUMS), sums)
            for name in names:
                with open(report / name, "rb") as source, archive.open(_entry(name), "w") as target:
                    shutil.copyfileobj(source, target, _PIECE)
        sync_file(beside)
        os.replace(beside, file)
    finally:
        beside.unlink(missing_ok=True)
    return file


def unpack(file: Path, out: Path) -> Path:
    """Put a packed report into a folder that does not exist yet, every file checked against its SHA-256.

    Returns the path of index.html. Raises ReportError: no such archive, damaged, with files that its list of sums
    lacks or that lie elsewhere, too large, or `out` exists. Nothing is left behind then.
    """
    if out.exists():
        raise ReportError(f"{out} exists: choose a new folder with --out")
    try:
        with zipfile.ZipFile(file) as archive:
            listed = _listed(archive, file)
            with whole_folder(out) as partial:
                for name, sha256 in listed.items():
                    path = partial / name
                    path.parent.mkdir(parents=True, exist_ok=True)
                    with archive.open(name) as source, open(path, "wb") as target:
                        shutil.copyfileobj(source, target, _PIECE)
                    if _sha256(path) != sha256:
                        raise ReportError(
                            f"{file} is damaged: {name} is not as it was packed; get the file again"
                        )
    except FileNotFoundError:
        raise ReportError(f"there is no archive {file}") from None
    except OSError as problem:
        if problem.errno not in (
            None,
            errno.EINVAL,
        ):  # what is not the disk's: a place before the begin, bad data
            raise
        raise ReportError(f"{file} is no archive of a report, or a damaged one") from None
    except DAMAGED as problem:
        raise ReportError(f"{file} is no archive of a report, or a damaged one ({problem})") from None
    return out / "index.html"


def _listed(archive: zipfile.ZipFile, file: Path) -> dict[str, str]:
    """Name → SHA-256 of all files but the list itself, checked against what the archive holds."""
    infos = {info.filename: info for info in archive.infolist()}
    if len(infos) != len(archive.infolist()) or SUMS not in infos or infos[SUMS].file_size > 2**24:
        raise ReportError(f"{file} is no archive of a report: it has no {SUMS}, or files twice")
    if (size := sum(info.file_size for info in infos.values())) > MOST_BYTES:
        raise ReportError(
            f"{file} would unpack to {size / 1e9:.0f} GB, more than any report: it is left alone"
        )
    lines = [_LINE.fullmatch(line) for line in archive.read(SUMS).decode("utf-8", "replace").splitlines()]
    sums = {match[2]: match[1] for match in lines if match is not None}
    if None in lines or sums.keys() != infos.keys() - {SUMS} or "index.html" not in sums:
        raise ReportError(f"{file} is damaged: its files are not those of its {SUMS}")
    for name in sums:
        if re.search(r"[\\:\0]|^/|(^|/)\.{0,2}(/|$)", name):
            raise ReportError(
                f"{file}: a file called {name!r} would lie outside of the report: it is left alone"
            )
    return sums


def _entry(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)  # dated 1980, so that the same report gives the same bytes
    info.compress_type = zipfile.ZIP_DEFLATED
    info.external_attr = 0o644 << 16
    return info


def _sha256(path: Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
