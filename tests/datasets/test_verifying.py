import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import OpenEXR
import pandas as pd
import pytest

from gibench.cli import run
from gibench.cli.app import app
from gibench.datasets import open_dataset
from gibench.datasets.exr import encode, layer_names, stored_types
from gibench.datasets.making import make
from gibench.datasets.manifest import gathered, read_manifest, write_manifest, write_table
from gibench.datasets.verifying import frame_faults, verify
from gibench.rendering.channels import CHANNELS, SETS
from gibench.rendering.machine import processor
from tests.datasets.fakes import fake_work, pixels, tiny


@pytest.fixture
def copy(rooms_made, tmp_path) -> Path:
    shutil.copytree(rooms_made, tmp_path / "d")
    return tmp_path / "d"


def broken(root: Path) -> dict[str, str]:
    return {problem.file: problem.what for problem in verify(root)}


def test_a_whole_dataset_has_no_problem(rooms_made):
    seen = []
    assert verify(rooms_made, lambda done, of: seen.append((done, of))) == []
    assert seen == [(done, 12) for done in range(13)]


def test_every_broken_file_is_named(copy):
    rooms = copy / "rooms"
    flipped = rooms / "000001/frames/0000.exr"
    content = bytearray(flipped.read_bytes())
    content[len(content) // 2] ^= 1
    flipped.write_bytes(content)
    short = rooms / "000002/frames/0001.exr"
    short.write_bytes(short.read_bytes()[:-7])
    (rooms / "000003/frames/0000.exr").unlink()
    (rooms / "000004/scene.xml").write_text("other")
    (rooms / "000005/frames.json").write_text("{")
    (rooms / "000006/frames.json").write_text("{}")
    shutil.rmtree(rooms / "000007")
    (copy / "preview.png").unlink()
    shutil.copytree(rooms / "000008", rooms / "000012")
    found = broken(copy)
    assert set(found) == {
        "rooms/000001/frames/0000.exr",
        "rooms/000002/frames/0001.exr",
        "rooms/000003/frames/0000.exr",
        "rooms/000004/scene.xml",
        "rooms/000005/frames.json",
        "rooms/000006/frames.json",
        "rooms/000007",
        "rooms/000012",
        "frames.parquet",
        "preview.png",
    }
    assert "SHA-256 differs" in found["rooms/000004/scene.xml"] or "bytes" in found["rooms/000004/scene.xml"]
    assert "cannot be read" in found["rooms/000003/frames/0000.exr"]
    assert found["rooms/000007"] == "the room is missing"


def test_a_frame_of_the_wrong_kind_is_found_even_where_its_hash_is_right(copy):
    path = copy / "rooms/000000/frames/0000.exr"
    arrays = pixels(tuple(name for name in CHANNELS if name != "motion_valid"), (16, 12), seed=1)
    path.write_bytes(encode(arrays))
    record = json.loads((copy / "rooms/000000/frames.json").read_text())
    record["frames"][0]["bytes"] = path.stat().st_size
    record["frames"][0]["sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
    (copy / "rooms/000000/frames.json").write_text(json.dumps(record))
    found = broken(copy)
    assert found["rooms/000000/frames/0000.exr"] == "channel motion_valid is missing"
    assert "frames.parquet" in found


def test_a_table_that_says_something_else_is_found(copy):
    table = pd.read_parquet(copy / "frames.parquet")
    table.loc[3, "spp"] += 1
    table.to_parquet(copy / "frames.parquet", index=False)
    assert set(broken(copy)) == {"frames.parquet"}
    (copy / "frames.parquet").write_bytes(b"nothing")
    assert "damaged" in broken(copy)["frames.parquet"]
    (copy / "frames.parquet").unlink()
    assert "missing" in broken(copy)["frames.parquet"]


def test_damaged_pages_are_found(copy):
    content = bytearray((copy / "preview.png").read_bytes())
    content[len(content) // 2] ^= 1
    (copy / "preview.png").write_bytes(content)
    (copy / "DATASET.md").unlink()
    found = broken(copy)
    assert set(found) == {"preview.png", "DATASET.md"}
    assert "is damaged: `gibench dataset preview` makes it anew" in found["preview.png"]
    (copy / "preview.png").write_bytes(content[:100])
    assert "is damaged" in broken(copy)["preview.png"]
    assert "run `make-dataset --rooms 12`, which writes both anew" in found["DATASET.md"]
    (copy / "frames.parquet").unlink()
    recipe = tiny(12, channels=tuple(SETS))
    make(copy, recipe, command="make-dataset --rooms 12", work=fake_work(copy, recipe))
    assert broken(copy) == {}


def changed_manifest(root: Path, **changes) -> None:
    path = root / "dataset.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("seed", 5, "seed: 5 in one, 0 in the other"),
        ("max_depth", 3, "max_depth: 3 in one, 8 in the other"),
        ("gloss", "much", 'gloss: "much" in one, null in the other'),
        ("environment", "none", 'environment: "none" in one, "auto" in the other'),
        ("splits", {"validation": 0.1, "train": 0.8, "test": 0.1}, 'order of splits: ["validation", '),
    ],
)
def test_a_recipe_that_contradicts_the_identity_is_found(copy, key, value, says):
    manifest = read_manifest(copy)
    changed_manifest(copy, recipe=manifest["recipe"] | {key: value})
    assert f"its recipe contradicts its identity ({says}" in broken(copy)["dataset.json"]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("frames", 23),
        ("paths", 1),
        ("kernel_seconds", 5.0),
        ("splits", {"train": 24}),
        ("median_error", None),
    ],
)
def test_wrong_totals_are_found(copy, key, value):
    manifest = read_manifest(copy)
    changed_manifest(copy, totals=manifest["totals"] | {key: value})
    found = broken(copy)
    assert set(found) == {"dataset.json"}
    assert found["dataset.json"].startswith(f"its total of {key} is ")
    changed_manifest(copy, totals=None)
    assert "no totals" in broken(copy)["dataset.json"]
    changed_manifest(copy, totals=manifest["totals"], rejections={"view: too dark": 11})
    assert broken(copy) == {"dataset.json": "its rejections are not those of the rooms"}


@pytest.mark.parametrize("names", ["materials", "shapes"])
def test_names_in_another_order_are_found(copy, names):
    path = copy / "rooms/000003/frames.json"
    record = json.loads(path.read_text())
    path.write_text(json.dumps({**record, names: [*record[names], "one more"][::-1]}))
    assert broken(copy) == {
        "dataset.json": "a frames.json of its rooms is not what it was when the dataset was whole"
    }


def test_datasets_of_older_versions_are_whole(copy):
    manifest = read_manifest(copy)
    del manifest["records"], manifest["card"], manifest["rejections"]
    for key in ("processors", "denoise_changes"):
        del manifest["totals"][key]
    write_manifest(copy, manifest)
    (copy / "DATASET.md").unlink()
    assert verify(copy) == []


def faults(**changed: np.ndarray) -> list[str]:
    recipe = tiny(channels=("radiance", "surface"))
    return list(frame_faults({**stored_types(pixels(recipe.channels, (16, 12), seed=9)), **changed}, recipe))


def test_faults_of_frames():
    whole = stored_types(pixels(tiny().channels, (16, 12), seed=9))
    assert faults() == []
    color = whole["color"].copy()
    color[3, 4, 1] = np.nextafter(color[3, 4, 1], color.dtype.type(np.inf))
    assert faults(color=color) == ["color is not the sum of its five parts in 1 pixels"]
    assert faults(normal=whole["normal"] * np.float32(np.nan)) == [
        "channel normal has values that are not finite"
    ]
    assert faults(normal=whole["normal"].astype(np.float16)) == ["channel normal is stored as float16"]
    assert faults(shape_id=whole["shape_id"].astype(np.float32)) == ["channel shape_id is stored as float32"]
    assert faults(color_se=-whole["color_se"]) == ["channel color_se has negative values"]
    assert faults(depth=whole["depth"][:6]) == ["channel depth is 16x6, the recipe asks for 16x12"]
    assert faults(motion=whole["position"][..., :2]) == ["channel motion is none of the recipe's"]


def test_a_sum_that_another_program_rounded_differently_is_found(tmp_path):
    """The identity is checked on the file, not on what the writer remembers."""
    stored = stored_types(pixels(("color", *tiny().channels[1:6]), (16, 12), seed=2))
    stored["color"] = np.nextafter(stored["color"], np.zeros_like(stored["color"]))
    layers = {
        layer: np.ascontiguousarray(values[..., i])
        for name, values in stored.items()
        for i, layer in enumerate(layer_names(CHANNELS[name]))
    }
    OpenEXR.File({"type": OpenEXR.scanlineimage}, layers).write(str(tmp_path / "f.exr"))
    from gibench.datasets.exr import decode

    said = list(frame_faults(decode(tmp_path / "f.exr"), tiny(channels=tuple(stored))))
    assert said == ["color is not the sum of its five parts in 192 pixels"]


def test_rooms_of_several_processors_are_told(copy, capsys):
    here = open_dataset(copy).frames["processor"]
    assert here.nunique() == 1
    assert here[0] == processor() != ""
    assert "processors" not in told(copy, capsys)

    for room, name in (
        (0, "Other CPU 9000"),
        (1, None),
    ):  # another machine's room, and one of an older version
        path = copy / f"rooms/{room:06d}/frames.json"
        record = json.loads(path.read_text())
        for frame in record["frames"]:
            frame["processor"] = name
            if name is None:
                del frame["processor"]
        path.write_text(json.dumps(record))
    manifest, table = gathered(copy, read_manifest(copy))
    write_manifest(copy, manifest)
    write_table(copy, table)
    frames = open_dataset(copy).frames
    assert set(frames.loc[frames["room"] == 0, "processor"]) == {"Other CPU 9000"}
    assert verify(copy) == []
    said = told(copy, capsys)
    assert said.count("processors") == 2
    assert "3 kinds (" in said
    assert "Other CPU 9000 2" in said
    assert "unknown 2 frames" in said


def told(root, capsys) -> str:
    """What `info` and `verify` say."""
    assert run(app, ["dataset", "info", str(root)]) == 0
    assert run(app, ["dataset", "verify", str(root)]) == 0
    return " ".join(capsys.readouterr().out.split())
