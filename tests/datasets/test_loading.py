import base64
import io
import pickle
import re

import numpy as np
import pytest
from PIL import Image

from gibench.datasets import loading, open_dataset
from gibench.datasets.errors import DatasetError, StorageError, UnknownChannel
from gibench.datasets.exr import decode
from gibench.datasets.manifest import new_manifest, write_manifest
from gibench.rendering.channels import CHANNELS
from tests.datasets.fakes import FACTS, tiny


def test_a_dataset_is_a_sequence_of_frames(rooms_made):
    dataset = open_dataset(str(rooms_made))
    assert len(dataset) == len(dataset.frames) == 24
    frame = dataset[5]
    assert (frame.room, frame.view) == (2, 1)
    assert frame.path == rooms_made / "rooms/000002/frames/0001.exr"
    assert frame.row["kind"] == dataset.frames.iloc[5]["kind"]
    assert (dataset[-1].room, dataset[-1].view) == (11, 1)
    assert [f.room for f in dataset] == sorted([*range(12)] * 2)
    for index in (24, -25):
        with pytest.raises(IndexError):
            dataset[index]


def test_channels_come_as_float32_and_ids_as_uint32(rooms_made):
    frame = open_dataset(rooms_made)[0]
    assert frame.channels == tuple(CHANNELS)
    for name, channel in CHANNELS.items():
        values = frame[name]
        assert values.shape == (12, 16, channel.components)
        assert values.dtype == (np.uint32 if channel.dtype == "uint" else np.float32)
    stored = decode(frame.path, ["color", "depth"])
    read = frame.read("color", "depth")
    assert list(read) == ["color", "depth"]
    for name in read:
        np.testing.assert_array_equal(read[name], stored[name])
    assert set(frame.read()) == set(CHANNELS)


def test_nothing_is_read_before_it_is_asked_for(rooms_made, monkeypatch):
    asked = []
    monkeypatch.setattr(
        loading, "decode", lambda path, channels, widen: asked.append(channels) or {"depth": 0}
    )
    frame = open_dataset(rooms_made)[3]
    assert asked == []
    assert frame["depth"] == 0
    assert asked == [("depth",)]


def test_unknown_channels_name_their_neighbours(rooms_made):
    frame = open_dataset(rooms_made)[0]
    with pytest.raises(KeyError) as caught:
        frame["normals"]
    assert isinstance(caught.value, UnknownChannel)
    assert "has no channel 'normals'; did you mean 'normal' or " in str(caught.value)


def test_splits_divide_the_rooms(rooms_made):
    dataset = open_dataset(rooms_made)
    parts = {name: dataset.split(name) for name in ("train", "validation", "test")}
    rooms = {name: set(part.frames["room"]) for name, part in parts.items()}
    assert sum(len(part) for part in parts.values()) == len(dataset)
    assert set.union(*rooms.values()) == set(range(12))
    assert sum(map(len, rooms.values())) == 12
    assert parts["test"][0].row["split"] == "test"
    with pytest.raises(DatasetError, match="no split 'training'; did you mean 'train'"):
        dataset.split("training")


def test_what_ids_mean_and_where_a_room_lies(rooms_made):
    dataset = open_dataset(rooms_made)
    assert dataset.names(3) == (["oak"], ["floor.0"])
    assert (dataset.room_folder(3) / "scene.xml").is_file()


def test_folders_that_are_no_datasets_or_not_finished(tmp_path):
    with pytest.raises(DatasetError, match=r"is no dataset: it has no readable dataset\.json"):
        open_dataset(tmp_path)
    write_manifest(tmp_path, new_manifest(tiny(), FACTS, {}, "make-dataset --out x"))
    with pytest.raises(
        DatasetError, match=r"has no frames\.parquet.*to continue it run `make-dataset --out x`"
    ):
        open_dataset(tmp_path)
    (tmp_path / "frames.parquet").write_bytes(b"no table")
    with pytest.raises(DatasetError, match=r"frames\.parquet is damaged"):
        open_dataset(tmp_path)


def test_a_frame_that_is_gone_is_named(rooms_made):
    dataset = open_dataset(rooms_made)
    frame = loading.Frame(rooms_made / "rooms/000000/frames/0099.exr", dataset[0].row)
    with pytest.raises(StorageError, match=r"0099\.exr cannot be read"):
        frame["color"]


def test_without_torch_the_error_says_what_to_install(rooms_made, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "gibench.datasets.torch_frames", None)
    with pytest.raises(DatasetError, match=r"torch is not installed: pip install 'gibench\[bench\]'"):
        open_dataset(rooms_made).torch(["color"])


def test_torch_gets_tensors_channels_first(rooms_made):
    torch = pytest.importorskip("torch")
    from torch.utils.data import DataLoader

    dataset = open_dataset(rooms_made)
    frames = dataset.torch(["color", "depth", "shape_id"])
    assert len(frames) == len(dataset)
    item = frames[5]
    assert item["color"].shape == (3, 12, 16)
    assert (item["color"].dtype, item["shape_id"].dtype) == (torch.float32, torch.int64)
    np.testing.assert_array_equal(item["color"].numpy(), np.moveaxis(dataset[5]["color"], -1, 0))
    assert torch.equal(pickle.loads(pickle.dumps(frames))[5]["depth"], item["depth"])
    (batch,) = DataLoader(frames, batch_size=24, num_workers=1)
    assert batch["color"].shape == (24, 3, 12, 16)


def test_several_frames_at_once(rooms_made):
    dataset = open_dataset(rooms_made)
    views = [(frame.room, frame.view) for frame in dataset]
    for index in (slice(3, 9), slice(None, None, -5), slice(30, 40), [0, -1, 7], np.array([5, 5]), []):
        part = dataset[index]
        expected = [
            views[i] for i in np.arange(24)[index if isinstance(index, slice) else np.array(index, int)]
        ]
        assert [(frame.room, frame.view) for frame in part] == expected
    mask = (dataset.frames["view"] == 1).to_numpy()
    assert {frame.view for frame in dataset[mask]} == {1}
    assert dataset[2:4][0].path == dataset[2].path
    for wrong, message in (([24], "frame 24 of 24"), ([0.5], "whole numbers"), (mask[:3], "a mask of 3")):
        with pytest.raises(IndexError, match=message):
            dataset[wrong]
    with pytest.raises(TypeError):
        dataset[1.5]


def test_a_number_of_any_library_is_an_index(rooms_made):
    torch = pytest.importorskip("torch")
    dataset = open_dataset(rooms_made)
    for index in (np.int64(5), np.uint8(5), torch.tensor(5), torch.tensor(-19)):
        assert dataset[index].path == dataset[5].path
    assert len(dataset[torch.tensor([1, 2])]) == 2


def test_the_matrices_of_a_frame_project_as_its_camera_does(rooms_made):
    frame = open_dataset(rooms_made)[0]
    points = np.random.default_rng(0).uniform(-1, 1, (50, 3)) + frame.camera.target
    matrix = frame.camera_to_world
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1)
    inside = np.linalg.inv(matrix) @ np.vstack([points.T, np.ones(50)])
    pixels = frame.intrinsics @ inside[:3]
    x, y, depth = frame.camera.project(points, (16, 12))
    np.testing.assert_allclose(pixels[2], depth, rtol=1e-9)
    np.testing.assert_allclose(pixels[:2] / pixels[2], [x, y], rtol=1e-9)


def test_a_notebook_shows_a_frame(rooms_made):
    frame = open_dataset(rooms_made)[0]
    shown = frame._repr_html_()
    picture = re.search(r'src="data:image/png;base64,([^"]+)"', shown)
    assert picture is not None
    image = Image.open(io.BytesIO(base64.b64decode(picture[1])))
    assert image.size[0] > 6 * 256
    assert "room 0, view 0" in shown
