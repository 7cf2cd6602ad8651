"""A dataset from anywhere: what its files name and state is checked before it is believed."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from gibench import cli
from gibench.cli import run as command
from gibench.cli.app import app
from gibench.datasets import open_dataset
from gibench.datasets.errors import DatasetError, StorageError
from gibench.datasets.exr import decode, encode
from gibench.datasets.exr_header import HeaderError, read_header
from gibench.datasets.files import as_json
from gibench.datasets.manifest import read_manifest
from gibench.datasets.verifying import verify
from tests.datasets.fakes import pixels
from tests.robustness.samples import edited

ROOM = "rooms/000000"


def problems(root) -> dict[str, str]:
    return {problem.file: problem.what for problem in verify(root)}


def test_the_sample_is_whole(ds):
    assert verify(ds) == []
    assert len(open_dataset(ds)) == 4


@pytest.mark.parametrize(
    "name", ["../../../secret", "/etc/hostname", "/dev/zero", "link", "frames", "pipe", "a\0b"]
)
def test_verify_reads_only_regular_files_of_the_folder(ds, name):
    (ds.parent / "secret").write_text("secret")
    (ds / ROOM / "link").symlink_to(ds.parent / "secret")
    os.mkfifo(ds / ROOM / "pipe")
    record = json.loads((ds / ROOM / "frames.json").read_text())
    record["files"][name] = {"sha256": "0" * 64, "bytes": 6}
    edited(ds / ROOM / "frames.json", files=record["files"])
    found = problems(ds)[f"{ROOM}/{name}"]
    assert "SHA-256" not in found
    assert any(
        words in found for words in ("leads out of", "no regular file", "no name of a file", "No such")
    )


@pytest.mark.parametrize("what", ["room.json", "frames/0000.exr", "frames.json"])
@pytest.mark.parametrize("how", ["pipe", "link", "folder"])
def test_what_lies_in_the_place_of_a_file_is_named(ds, what, how):
    path = ds / ROOM / what
    content = path.read_bytes()
    path.unlink()
    if how == "pipe":
        os.mkfifo(path)
    elif how == "folder":
        path.mkdir()
    else:
        (ds.parent / "copy").write_bytes(content)
        path.symlink_to(ds.parent / "copy")
    found = problems(ds)
    assert f"{ROOM}/{what}" in found or ROOM in found
    if what.endswith(".exr"):
        with pytest.raises((DatasetError, StorageError)):
            open_dataset(ds)[0].read()
        if how == "link":
            with pytest.raises(DatasetError, match="leads out of"):
                open_dataset(ds)[0]


def test_a_link_that_stays_in_the_folder_is_followed(ds):
    path = ds / ROOM / "frames/0000.exr"
    path.rename(path.with_name("0009.exr"))
    path.symlink_to("0009.exr")
    assert verify(ds) == []


@pytest.mark.parametrize("name", ["dataset.json", "frames.parquet"])
def test_a_pipe_for_a_manifest_or_a_table_is_not_waited_for(ds, name):
    (ds / name).unlink()
    os.mkfifo(ds / name)
    with pytest.raises(DatasetError, match="no regular file"):
        open_dataset(ds)


def test_a_table_that_leads_outside_is_refused(ds, tmp_path):
    outside = tmp_path / "outside.exr"
    outside.write_bytes((ds / ROOM / "frames/0000.exr").read_bytes())
    table = pd.read_parquet(ds / "frames.parquet")
    for name in ("../outside.exr", str(outside), "rooms/000000/frames/../../../../outside.exr"):
        table.loc[0, "file"] = name
        table.to_parquet(ds / "frames.parquet", index=False)
        with pytest.raises(DatasetError, match="column file leads to"):
            open_dataset(ds)
        assert "column file leads to" in problems(ds)["frames.parquet"]
        arguments = ["dataset", "preview", str(ds), "--frame", "0", "--out", str(tmp_path / "x.png")]
        assert command(app, arguments) == 2
        assert not (tmp_path / "x.png").exists()


def table_of(ds, rows, **columns) -> pa.Table:
    """The table of a dataset with one row as often as asked for, and other columns in the place of its own."""
    row = pd.read_parquet(ds / "frames.parquet").iloc[[0]]
    table = pa.Table.from_pandas(row, preserve_index=False)
    table = pa.table({name: pa.repeat(table[name][0], rows) for name in table.column_names} | columns)
    return table


@pytest.mark.parametrize(
    ("rows", "says"),
    [(10**7, "states 10000000 frames, the recipe has 2 rooms of at most 2"), (5, "states 5 frames")],
)
def test_rows_are_counted_before_they_are_read(ds, rows, says):
    pq.write_table(table_of(ds, rows), ds / "frames.parquet")
    with pytest.raises(DatasetError, match=says):
        open_dataset(ds)
    assert says.split(",")[0] in problems(ds)["frames.parquet"]


def test_a_recipe_that_allows_for_many_rows_does_not_make_them_believed(ds):
    manifest = json.loads((ds / "dataset.json").read_text())
    edited(ds / "dataset.json", recipe={**manifest["recipe"], "rooms": 10**6, "views": 9999})
    pq.write_table(table_of(ds, 10**6), ds / "frames.parquet")
    with pytest.raises(DatasetError, match="states 1000000 frames, and 4 lie in the folder"):
        open_dataset(ds)


def test_tables_that_say_nonsense_are_named(ds):
    table = pd.read_parquet(ds / "frames.parquet")
    wrong = {
        "no column view": table.drop(columns="view"),
        "column spp holds 'double'": table.assign(spp=0.5),
        "column kind has rows without a value": table.assign(kind=[None, "living", "living", "living"]),
        "column width has a number": table.assign(width=10**9),
        "column fov has an angle": table.assign(fov=np.nan),
        "column room has a number below 0": table.assign(room=-1),
        "column kind holds a text of 100000 bytes": table.assign(kind="x" * 10**5),
    }
    for says, changed in wrong.items():
        changed.to_parquet(ds / "frames.parquet", index=False)
        with pytest.raises(DatasetError, match=says):
            open_dataset(ds)
        assert says in problems(ds)["frames.parquet"]
    pq.write_table(
        pa.Table.from_pandas(table),
        ds / "frames.parquet",
        use_dictionary=False,
        column_encoding={"kind": "DELTA_BYTE_ARRAY"},
    )
    with pytest.raises(DatasetError, match="in an encoding that gibench does not write"):
        open_dataset(ds)


def test_whole_rooms_of_a_dataset_without_a_table_open(ds):
    before = open_dataset(ds).frames
    (ds / "frames.parquet").unlink()
    assert open_dataset(ds).frames.equals(before)
    assert "cut off" in problems(ds)["frames.parquet"]


MANIFESTS = {
    "cut off or no JSON": ["", "{", "[" * 10**5, '{"a": NaN}', "\udcff"],
    "no table": ["[]", "null", "3"],
    "nested more than": ['{"a":' * 100 + "{}" + "}" * 100],
    "more than 64 bits": ['{"a": 1' + "0" * 30 + "}"],
    "beyond those that a computer has": ['{"a": 1e400}'],
    "half of a character": ['{"a": "\\ud800"}'],
    "Field required": ["{}"],
}


@pytest.mark.parametrize(
    ("says", "text"), [(says, text) for says, texts in MANIFESTS.items() for text in texts]
)
@pytest.mark.parametrize("name", ["dataset.json", f"{ROOM}/frames.json"])
def test_no_json_ends_in_a_traceback(ds, name, says, text):
    (ds / name).write_bytes(text.encode(errors="surrogateescape"))
    if name == "dataset.json":
        with pytest.raises(DatasetError, match=says):
            read_manifest(ds)
    else:
        assert says in problems(ds)[name]


@pytest.mark.parametrize(
    "change",
    [
        {"totals": 5},
        {"totals": {}},
        {"versions": None},
        {"versions": {}},
        {"rejections": {"a": "b"}},
        {"rejected_rooms": {"x": "y"}},
        {"rejected_rooms": []},
        {"licence": 3},
        {"recipe": {"rooms": "many"}},
        {"runs": {}},
        {"format": "1"},
        {"format": [1]},
    ],
)
@pytest.mark.parametrize("words", [["verify"], ["info"], ["preview"]])
def test_a_manifest_that_says_something_else_is_named(ds, change, words, capfd):
    edited(ds / "dataset.json", **change)
    assert command(app, ["dataset", *words, str(ds)]) == 2
    assert len(capfd.readouterr().err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    "change",
    [{"camera": "here"}, {"spp": None}, {"seed": -1}, {"fov": {}}, {"view": "0"}, {"file": "../0000.exr"}],
)
def test_a_record_of_a_frame_that_says_something_else_is_named(ds, change):
    record = json.loads((ds / ROOM / "frames.json").read_text())
    record["frames"][0] |= change
    (ds / ROOM / "frames.json").write_bytes(as_json(record))
    assert f"is damaged (frames.0.{next(iter(change))}: " in problems(ds)[f"{ROOM}/frames.json"]


def test_control_characters_of_a_dataset_do_not_reach_the_terminal(ds, capfd):
    edited(ds / "dataset.json", command="make\x1b]0;owned\x07\x1b[2J\nlicence  none", licence="CC0\u202e")
    assert command(app, ["dataset", "info", str(ds)]) == 0
    out = capfd.readouterr().out
    assert all(sign.isprintable() or sign == "\n" for sign in out)
    assert r"make\x1b]0;owned\x07\x1b[2J\nlicence  none" in out
    assert r"CC0\u202e" in out


def test_a_frame_without_any_channel_is_named(ds, capfd, tmp_path):
    for view in ("0000", "0001"):
        for room in ("000000", "000001"):
            path = ds / f"rooms/{room}/frames/{view}.exr"
            OpenEXR.File({}, {"Z": np.zeros((18, 24), np.float32)}).write(str(path))
    for words in (["--frame", "0"], []):
        arguments = ["dataset", "preview", str(ds), *words, "--out", str(tmp_path / "x.png")]
        assert command(app, arguments) == 1
        assert "0000.exr holds no channel of a frame" in capfd.readouterr().err


def with_header(content: bytes, **attributes: bytes) -> bytes:
    """An OpenEXR file with other values in its header, each as long as the one before."""
    for name, value in attributes.items():
        at = content.index(name.encode() + b"\0") + len(name) + 1
        at = content.index(b"\0", at) + 1
        (length,) = struct.unpack("<i", content[at : at + 4])
        assert length == len(value)
        content = content[: at + 4] + value + content[at + 4 + length :]
    return content


def test_an_image_larger_than_its_file_is_refused_by_its_header(tmp_path):
    content = encode(pixels(("color",), (24, 18), 1))
    assert (read_header(content).width, read_header(content).height) == (24, 18)
    assert set(read_header(content).layers) == set("RGB")
    for window, says in (
        ((0, 0, 2**26, 0), "states 67108865x1 pixels"),
        ((-(2**31), 0, 2**31 - 1, 0), "states 4294967296x1"),
        ((0, 0, 30000, 30000), "hold no such image"),
        ((5, 0, 4, 0), "states 0x1"),
    ):
        bomb = with_header(content, dataWindow=struct.pack("<4i", *window))
        with pytest.raises(HeaderError, match=says):
            read_header(bomb)
        (tmp_path / "bomb.exr").write_bytes(bomb)
        with pytest.raises(StorageError, match=r"bomb\.exr cannot be read as OpenEXR: its header"):
            decode(tmp_path / "bomb.exr")
    for method in (8, 9, 77):  # DWAA, DWAB, none at all
        with pytest.raises(HeaderError, match=f"compression number {method}"):
            read_header(with_header(content, compression=bytes([method])))


@pytest.mark.parametrize("cut", [0, 3, 8, 20, 100, 200])
def test_a_header_that_is_cut_off_is_named(cut):
    with pytest.raises(StorageError, match="cannot be read as OpenEXR"):
        decode(encode(pixels(("color",), (24, 18), 1))[:cut])


def test_a_frame_of_another_size_is_not_decompressed(ds):
    (ds / ROOM / "frames/0000.exr").write_bytes(encode(pixels(("color",), (64, 64), 1)))
    assert "the image is 64x64, the recipe asks for 24x18" in [
        problem.what for problem in verify(ds) if problem.file == f"{ROOM}/frames/0000.exr"
    ]


def test_output_to_a_full_disk_and_to_nobody(ds):
    words = [sys.executable, "-m", "gibench", "dataset", "info", str(ds)]
    with open("/dev/full", "w") as full:
        result = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (result.returncode, result.stderr) == (
        1,
        "error: what the command prints: No space left on device\n",
    )
    reader, writer = os.pipe()
    os.close(reader)
    result = subprocess.run(words, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert result.stderr == ""


def test_commands_print_through_one_door():
    for path in Path(cli.__file__).parent.glob("*.py"):
        assert path.name == "output.py" or "typer.echo" not in path.read_text(), (
            f"{path.name}: use output.say"
        )


@pytest.mark.parametrize("split", ["../../escaped", "a/b", "50%", ""])
def test_splits_that_are_no_names_are_refused(ds, split):
    manifest, record = (
        json.loads((ds / name).read_text()) for name in ("dataset.json", f"{ROOM}/frames.json")
    )
    (ds / ROOM / "frames.json").write_bytes(as_json({**record, "split": split}))
    assert f"is damaged (split: {split!r} is no name" in problems(ds)[f"{ROOM}/frames.json"]
    pd.read_parquet(ds / "frames.parquet").assign(split=split).to_parquet(ds / "frames.parquet", index=False)
    with pytest.raises(DatasetError, match=f"its column split holds {split!r}, which is no name"):
        open_dataset(ds)
    edited(ds / "dataset.json", recipe={**manifest["recipe"], "splits": {split: 1.0}})
    with pytest.raises(DatasetError, match=f"splits: {split!r} is no name"):
        open_dataset(ds)


def test_columns_of_later_versions_are_filled(ds):
    table = pd.read_parquet(ds / "frames.parquet").drop(columns="denoise_change")
    table.to_parquet(ds / "frames.parquet", index=False)
    assert open_dataset(ds).frames["denoise_change"].isna().all()
    assert verify(ds) == []
