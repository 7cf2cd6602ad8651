"""Frames out of the cache are those of the files, whole or in part, and whatever is wrong with it is named."""

import pickle
import shutil

import numpy as np
import pytest

from gibench.datasets import cache, open_dataset
from gibench.datasets.cache import FrameCache, make_cache, opened_cache
from gibench.datasets.errors import DatasetError, FolderError, MakingError
from gibench.datasets.exr import stored_types
from gibench.datasets.making import make
from gibench.datasets.verifying import verify
from gibench.rendering.channels import CHANNELS
from tests.datasets.fakes import fake_work, tiny

NAMES = ("color", "direct_diffuse", "position", "shape_id", "roughness")


@pytest.fixture(scope="module")
def cached(rooms_made, tmp_path_factory):
    """Nobody may change it."""
    root = tmp_path_factory.mktemp("cached") / "d"
    shutil.copytree(rooms_made, root)
    done = []
    assert make_cache(root, NAMES, lambda frame, of: done.append((frame, of))) == NAMES
    assert done == [(number, 24) for number in range(1, 25)]
    return root


@pytest.fixture
def copy(cached, tmp_path):
    shutil.copytree(cached, tmp_path / "d")
    return tmp_path / "d"


def test_the_values_of_the_files_whole_or_in_part(cached):
    dataset = open_dataset(cached)
    opened = opened_cache(dataset)
    for frame in (dataset[0], dataset[23], dataset[7]):
        whole = opened.read(frame.row["file"], NAMES)
        part = opened.read(frame.row["file"], NAMES, (2, 3, 5, 4))
        for name, values in frame.read(*NAMES).items():
            expected = np.moveaxis(values, -1, 0)
            assert whole[name].dtype == expected.dtype
            np.testing.assert_array_equal(whole[name], expected)
            np.testing.assert_array_equal(part[name], expected[:, 2:7, 3:7])
    assert verify(cached) == []


def test_torch_reads_it_where_it_has_the_channels(cached):
    pytest.importorskip("torch")
    dataset = open_dataset(cached)
    items, others = dataset.torch(NAMES), dataset.torch(["color", "depth"])
    assert items.cache is not None
    assert others.cache is None
    for index in (0, 11):
        assert (items[index]["color"] == others[index]["color"]).all()
        assert (items.read(index, (1, 2, 3, 4))["color"] == others.read(index, (1, 2, 3, 4))["color"]).all()
    assert items.read(0, (1, 2, 3, 4))["shape_id"].shape == (1, 3, 4)
    # Frames of some rooms find theirs, and what is sent to another process holds no pixels.
    some = dataset[[5, 20]].torch(NAMES)
    assert (some[1]["position"] == items[20]["position"]).all()
    sent = pickle.dumps(some)
    assert len(sent) < 20_000
    assert (pickle.loads(sent)[0]["position"] == items[5]["position"]).all()


def test_channels_are_added_and_nothing_is_made_twice(copy):
    before = (copy / "cache/color.npy").stat().st_mtime_ns
    assert make_cache(copy, NAMES) == ()
    added = make_cache(copy)
    assert set(added) == CHANNELS.keys() - set(NAMES)
    assert (copy / "cache/color.npy").stat().st_mtime_ns == before
    assert opened_cache(open_dataset(copy)).channels == CHANNELS.keys()
    with pytest.raises(DatasetError, match="no channel 'gloss'; it has color, emission"):
        make_cache(copy, ["gloss"])


def test_radiance_beyond_float16(tmp_path):
    """1e-9 to 1e9: relative errors below 2^-11 over 28 powers of two, and what float16 holds comes back exactly."""
    rng = np.random.default_rng(0)
    frames = [
        np.exp2(rng.uniform(low, high, (4, 6, 3))).astype(np.float32)
        for low, high in ((3, 30), (-30, -3), (-28, 0))
    ]
    frames.append(np.zeros((4, 6, 3), np.float32))
    frames.append(rng.uniform(0, 9, (4, 6, 3)).astype(np.float16))
    array = cache._Array(tmp_path, "color", (5, 4, 6))
    for values in frames:
        array.add(values)
    (tmp_path / cache.CACHE).mkdir()
    record = {"channels": {"color": array.finished()}, "count": 5, "size": [6, 4]}
    shutil.move(tmp_path / "color.npy", tmp_path / cache.CACHE / "color.npy")
    opened = FrameCache(tmp_path, record, map(str, range(5)))
    for number, values in enumerate(frames):
        read = np.moveaxis(opened.read(str(number), ["color"])["color"], 0, -1)
        np.testing.assert_allclose(read, values.astype(np.float32), rtol=2**-11, atol=0)
    assert np.array_equal(opened.read("4", ["color"])["color"], np.moveaxis(frames[4], -1, 0))
    # A lamp of 1e6 beside a corner of 1e-6.
    lamp = np.array([1e6, 1.0, 1e-6], np.float32).reshape(1, 1, 3)
    assert stored_types({"color": lamp})["color"].dtype == np.float32
    exponent = cache._exponent(lamp)
    kept = np.ldexp(np.ldexp(lamp, -exponent).astype(np.float16).astype(np.float32), exponent)
    assert (np.abs(kept - lamp) <= np.maximum(2**-11 * lamp, 2**-39 * lamp.max())).all()


def test_a_dataset_that_grew_has_none_until_it_is_made_again(tmp_path):
    root = tmp_path / "d"
    for rooms in (1, 2):
        recipe = tiny(rooms, channels=("color", "albedo"))
        make(root, recipe, command="make-dataset", work=fake_work(root, recipe))
        assert opened_cache(open_dataset(root)) is None
        if rooms == 2:
            assert [problem.what for problem in verify(root)] == [
                "it is of other frames: `gibench dataset cache` makes it anew"
            ]
        assert make_cache(root) == ("color", "albedo")
        assert opened_cache(open_dataset(root)) is not None
    assert verify(root) == []


def test_what_is_wrong_is_named(copy):
    array = copy / "cache/color.npy"
    content = bytearray(array.read_bytes())
    content[-1] ^= 1
    array.write_bytes(content)
    assert [(p.file, p.what) for p in verify(copy)] == [
        ("cache/color.npy", "its content is not what was written")
    ]
    array.write_bytes(content[:5000])
    with pytest.raises(DatasetError, match=r"color\.npy is not what the cache says .* makes it anew"):
        opened_cache(open_dataset(copy)).read("rooms/000000/frames/0000.exr", ["color"])
    (copy / "cache/cache.json").write_text("{")
    with pytest.raises(DatasetError, match=r"cache\.json is damaged"):
        opened_cache(open_dataset(copy))
    assert len(verify(copy)) == 1


def test_a_frame_that_was_changed_is_not_decoded(rooms_made, tmp_path):
    root = tmp_path / "d"
    shutil.copytree(rooms_made, root)
    shutil.copy(root / "rooms/000001/frames/0000.exr", root / "rooms/000000/frames/0001.exr")
    with pytest.raises(DatasetError, match=r"0001\.exr is not what was written"):
        make_cache(root, ["color"])
    assert list((root / "cache").iterdir()) == []


def test_a_disk_without_room_and_a_link(rooms_made, tmp_path, monkeypatch):
    root = tmp_path / "d"
    shutil.copytree(rooms_made, root)
    with monkeypatch.context() as patch:
        patch.setattr(shutil, "disk_usage", lambda path: shutil._ntuple_diskusage(9, 9, 0))
        with pytest.raises(MakingError, match=r"the arrays take .* free some space, or name fewer channels"):
            make_cache(root, ["color"])

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(cache._Array, "add", full)
        with pytest.raises(FolderError, match="No space left on device"):
            make_cache(root, ["color"])
    assert list((root / "cache").iterdir()) == []
    (root / "cache").rmdir()
    (tmp_path / "elsewhere").mkdir()
    (root / "cache").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(FolderError, match="a link or a file"):
        make_cache(root, ["color"])
    assert list((tmp_path / "elsewhere").iterdir()) == []
