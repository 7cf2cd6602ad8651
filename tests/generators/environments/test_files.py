"""The maps that ship, and what is said of those that cannot be used."""

import numpy as np
import OpenEXR
import pytest

from gibench.generators.daylight import BadEnvironment
from gibench.generators.environments.files import SETS, environment_files, read_environment
from gibench.generators.environments.shipped import shipped_maps
from gibench.rendering.latlong import mean_luminance


def write_exr(path, image):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(image, np.float32)}).write(str(path))
    return path


def grey(height, value=0.5):
    return np.full((height, 2 * height, 3), value, np.float32)


def test_37_maps_ship_apart_for_training_and_testing():
    maps = shipped_maps()
    assert len({entry.name for entry in maps}) == len(maps) == 37
    counts = {
        (place, split): sum(m.indoor == place and m.split == split for m in maps)
        for place in (True, False)
        for split in ("train", "test")
    }
    assert counts == {(True, "train"): 15, (True, "test"): 8, (False, "train"): 0, (False, "test"): 14}
    assert {entry.path.name for entry in maps} == {
        file.name for file in maps[0].path.parent.iterdir() if file.suffix == ".hdr"
    }
    assert all(entry.source == f"https://polyhaven.com/a/{entry.name}" for entry in maps)


def test_no_place_is_on_both_sides():
    """Maps of one studio show the same walls and lamps."""
    places = {}
    for entry in shipped_maps():
        places.setdefault(entry.name.rstrip("0123456789_"), set()).add(entry.split)
    assert all(len(splits) == 1 for splits in places.values()), places


@pytest.mark.parametrize("entry", shipped_maps(), ids=lambda entry: entry.name)
def test_every_map_can_be_used(entry):
    image = read_environment(entry.path)
    assert image.shape == (128, 256, 3)
    assert np.isfinite(image).all()
    assert 0.1 < mean_luminance(image) < 5


@pytest.mark.parametrize(
    ("name", "count"), [("indoor", 23), ("outdoor", 14), ("train", 15), ("test", 22), ("indoor-test", 8)]
)
def test_sets(name, count):
    assert len(environment_files(name)) == count
    assert set(SETS) >= {name}


def test_a_list_mixes_sets_names_files_and_folders(tmp_path):
    write_exr(tmp_path / "b.exr", grey(8))
    write_exr(tmp_path / "a.EXR", grey(8))
    (tmp_path / "notes.txt").write_text("no map")
    folder = environment_files(tmp_path)
    assert [(entry.name, entry.indoor) for entry in folder] == [("a", None), ("b", None)]
    mixed = environment_files(["esplanade", "train", str(tmp_path), tmp_path / "b.exr"])
    assert [entry.name for entry in mixed] == [
        "esplanade",
        *(e.name for e in environment_files("train")),
        "a",
        "b",
    ]
    assert mixed[0].indoor is True


@pytest.mark.parametrize(
    ("wanted", "says"),
    [
        ("indor", "did you mean indoor"),
        ("esplanada", "did you mean esplanade"),
        ("/no/such/place", "name indoor, outdoor, train, test, indoor-test"),
        ([], "the list names none"),
    ],
)
def test_what_is_not_there(wanted, says):
    with pytest.raises(BadEnvironment, match=says) as caught:
        environment_files(wanted)
    assert "\n" not in str(caught.value)


def test_a_folder_without_a_map_and_two_maps_of_one_name(tmp_path):
    with pytest.raises(BadEnvironment, match=r"holds no \.hdr or \.exr file"):
        environment_files(tmp_path)
    for place in ("one", "two"):
        (tmp_path / place).mkdir()
        write_exr(tmp_path / place / "hall.exr", grey(8))
    with pytest.raises(BadEnvironment, match="both called 'hall'; rename one"):
        environment_files([tmp_path / "one", tmp_path / "two"])


@pytest.mark.parametrize(
    ("image", "says"),
    [
        (np.where(np.arange(16 * 32 * 3).reshape(16, 32, 3) == 5, np.nan, 1.0), "1 values are negative or not finite"),
        (np.where(np.arange(16 * 32 * 3).reshape(16, 32, 3) == 7, -1.0, 1.0), "1 values are negative or not finite"),
        (grey(16)[:, :31], "31 × 16 texels; an equirectangular panorama is twice as wide as high"),
        (grey(16)[:, :16], "16 × 16 texels"),
        (grey(16, 0.0), "it is black"),
    ],
    ids=["nan", "negative", "odd", "square", "black"],
)  # fmt: skip
def test_a_map_that_cannot_be_used(tmp_path, image, says):
    file = write_exr(tmp_path / "map.exr", image)
    with pytest.raises(BadEnvironment, match=says) as caught:
        read_environment(file)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_no_image(tmp_path):
    (tmp_path / "map.hdr").write_bytes(b"not a picture")
    with pytest.raises(BadEnvironment, match="not readable as an") as caught:
        read_environment(tmp_path / "map.hdr")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("height", [32, 300])
def test_maps_of_any_size_come_in_one(tmp_path, height):
    image = np.random.default_rng(height).random((height, 2 * height, 3)).astype(np.float32)
    read = read_environment(write_exr(tmp_path / "map.exr", image))
    assert read.shape == (128, 256, 3)
    assert mean_luminance(read) == pytest.approx(mean_luminance(image), rel=1e-6)
