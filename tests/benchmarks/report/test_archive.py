import hashlib
import zipfile

import pytest

from gibench.benchmarks.report import ReportError, archive
from gibench.benchmarks.report.archive import SUMS, pack, unpack


@pytest.fixture
def site(tmp_path):
    folder = tmp_path / "site"
    for name, content in (
        ("index.html", b"<p>"),
        ("plots/a.png", bytes(range(256))),
        ("leaderboard.csv", b"a,b\n"),
    ):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


def content_of(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()
    }


def test_what_was_packed_comes_back(site, tmp_path):
    file = pack(site, tmp_path / "deep" / "board.zip")
    assert unpack(file, tmp_path / "again") == tmp_path / "again" / "index.html"
    assert content_of(tmp_path / "again") == content_of(site)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["again", "deep", "site"]
    with zipfile.ZipFile(file) as packed:
        for line in packed.read(SUMS).decode().splitlines():
            sha256, name = line.split("  ")
            assert hashlib.sha256(content_of(site)[name]).hexdigest() == sha256
    assert pack(site, tmp_path / "twice.zip").read_bytes() == file.read_bytes()


def rewritten(file, out, change):
    with zipfile.ZipFile(file) as packed, zipfile.ZipFile(out, "w") as other:
        for name, content in change({info.filename: packed.read(info) for info in packed.infolist()}).items():
            other.writestr(name, content)
    return out


def listed(files):
    """The same files with a list of sums that fits them."""
    others = {name: content for name, content in files.items() if name != SUMS}
    lines = [f"{hashlib.sha256(content).hexdigest()}  {name}\n" for name, content in others.items()]
    return {SUMS: "".join(lines).encode(), **others}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda files: {**files, "plots/a.png": b"other"}, "plots/a.png is not as it was packed"),
        (lambda files: {**files, "more.html": b"x"}, "not those of its SHA256SUMS"),
        (lambda files: {name: c for name, c in files.items() if name != "leaderboard.csv"}, "not those of"),
        (lambda files: {name: c for name, c in files.items() if name != SUMS}, "no SHA256SUMS"),
        (lambda files: {**files, SUMS: b"\xff\xfe nonsense"}, "not those of"),
        (lambda files: listed({**files, "../out.txt": b"x"}), "outside of the report"),
        (lambda files: listed({**files, "a/../../out.txt": b"x"}), "outside of the report"),
        (lambda files: listed({**files, "/tmp/out.txt": b"x"}), "outside of the report"),
        (lambda files: listed({**files, "C:x": b"x"}), "outside of the report"),
        (
            lambda files: listed({name: c for name, c in files.items() if name != "index.html"}),
            "not those of",
        ),
    ],
)
def test_archives_that_are_not_as_they_were(site, tmp_path, change, message):
    file = rewritten(pack(site, tmp_path / "board.zip"), tmp_path / "other.zip", change)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(ReportError, match=message):
        unpack(file, tmp_path / "out")
    assert sorted(tmp_path.rglob("*")) == before


def test_no_archive_too_large_and_places_that_are_taken(site, tmp_path, monkeypatch):
    with pytest.raises(ReportError, match="holds no report"):
        pack(tmp_path, tmp_path / "board.zip")
    with pytest.raises(ReportError, match="there is no archive"):
        unpack(tmp_path / "none.zip", tmp_path / "out")
    (tmp_path / "text.zip").write_text("hello")
    with pytest.raises(ReportError, match="no archive of a report"):
        unpack(tmp_path / "text.zip", tmp_path / "out")
    file = pack(site, tmp_path / "board.zip")
    with pytest.raises(ReportError, match="exists: choose a new folder"):
        unpack(file, site)
    monkeypatch.setattr(archive, "MOST_BYTES", 100)
    with pytest.raises(ReportError, match="more than any report"):
        unpack(file, tmp_path / "out")
    (tmp_path / "cut.zip").write_bytes(file.read_bytes()[:-60])
    with pytest.raises(ReportError, match="no archive of a report"):
        unpack(tmp_path / "cut.zip", tmp_path / "out")
