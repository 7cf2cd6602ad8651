"""Frames from files and from the device are the same, and a camera sees them where they are."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from gibench.baselines.image_to_image.camera_space import in_camera_space, mirrored
from gibench.baselines.image_to_image.device_frames import DeviceFrames, as_image
from gibench.baselines.image_to_image.frames import Frames, held_out, share_of
from gibench.baselines.training.errors import TrainingError
from gibench.baselines.training_set import TrainingSet, training_set
from gibench.datasets import exr
from gibench.datasets.loading import Dataset, open_dataset
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.scene import load_scene

SURFACE = ("position", "normal", "depth", "distance", "albedo")


def test_a_frame_on_the_device_is_the_frame_in_the_file(room, views):
    frames = Frames(views, SURFACE)
    scene = load_scene(open_dataset(room).room_folder(0) / "scene.xml")
    device = DeviceFrames(scene, SURFACE)
    for index in (0, 1):
        file, found = frames[index], device.read(frames.camera(index), (40, 32))
        assert file.keys() == found.keys()
        for name, image in file.items():
            assert found[name].shape == image.shape
            # Files hold single precision for lengths and half precision for the rest.
            torch.testing.assert_close(found[name].cpu(), image, rtol=1e-3, atol=1e-3)
    assert views.handed_out == [0, 1]


def test_points_project_to_their_pixels(views):
    frames = Frames(views, ("position", "depth", "distance", "normal", "albedo"))
    for index in range(len(frames)):
        images, camera = frames[index], frames.camera(index)
        seen = in_camera_space(images, camera)
        assert torch.equal(seen["albedo"], images["albedo"])
        torch.testing.assert_close(seen["position"][2:], images["depth"], rtol=1e-4, atol=1e-4)
        length = seen["position"].norm(dim=0, keepdim=True)
        torch.testing.assert_close(length, images["distance"], rtol=1e-4, atol=1e-4)
        torch.testing.assert_close(
            seen["normal"].norm(dim=0), images["normal"].norm(dim=0), rtol=1e-3, atol=1e-3
        )
        for some in (seen, mirrored(seen)):
            _assert_projected(some["position"], camera)
            # What is seen faces the camera.
            assert ((some["position"] * some["normal"]).sum(0) <= 1e-3).all()


def _assert_projected(position, camera):
    hit = (position[2] > 0).numpy()
    assert hit.any()
    x, y, z = position.numpy()[:, hit]
    focal = camera.focal_length(40)
    rows, columns = np.nonzero(hit)
    np.testing.assert_allclose(x / z * focal + 20, columns + 0.5, atol=2e-2)
    np.testing.assert_allclose(y / z * focal + 16, rows + 0.5, atol=2e-2)


def test_a_room_that_is_moved_and_turned_looks_the_same():
    generator = torch.Generator().manual_seed(0)
    here = PinholeCamera((0, 0, 1), (0, 3, 0.5), 1.0)
    there = PinholeCamera((10, -4, 6), (7, -4, 5.5), 1.0)  # a quarter turn to the left
    images = {
        "position": torch.randn(3, 4, 5, generator=generator),
        "normal": torch.randn(3, 4, 5, generator=generator),
        "depth": torch.rand(1, 4, 5, generator=generator),
    }
    images["position"][:, 0, 0] = 0  # a miss
    turn = torch.tensor([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    moved = {**images, "normal": torch.einsum("ij,jhw->ihw", turn, images["normal"])}
    relative = images["position"] - torch.tensor([0.0, 0, 1])[:, None, None]
    moved["position"] = (
        torch.einsum("ij,jhw->ihw", turn, relative) + torch.tensor([10.0, -4, 6])[:, None, None]
    )
    moved["position"][:, 0, 0] = 0
    first, second = in_camera_space(images, here), in_camera_space(moved, there)
    for name, image in first.items():
        torch.testing.assert_close(second[name], image, atol=1e-5, rtol=1e-5)
    assert not first["position"][:, 0, 0].any()


def test_a_mirror_image_twice_is_the_image():
    images = {"position": torch.randn(3, 4, 5), "direct_diffuse": torch.rand(3, 4, 5)}
    once = mirrored(images)
    assert torch.equal(once["direct_diffuse"], images["direct_diffuse"].flip(-1))
    assert torch.equal(once["position"][0], -images["position"][0].flip(-1))
    for name, image in mirrored(once).items():
        assert torch.equal(image, images[name])


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_number_that_is_none_is_refused_by_name(room, tmp_path, monkeypatch, value):
    root = tmp_path / "damaged"
    shutil.copytree(room, root)
    path = next(root.glob("rooms/000000/frames/0003.exr"))
    images = exr.decode(path)
    images["albedo"][5, 7, 1] = value
    monkeypatch.setattr(exr, "_refuse_impossible", lambda channel, values: None)
    path.write_bytes(exr.encode(images))
    frames = Frames(training_set(root), ("albedo", "depth"))
    assert frames[2]["albedo"].isfinite().all()
    with pytest.raises(
        TrainingError, match=r"rooms/000000/frames/0003.exr holds (nan|inf) in albedo, pixel \(7, 5\)"
    ):
        frames[3]


def test_rooms_are_held_out_whole(views):
    table = pd.DataFrame({"room": [3, 3, 3, 8, 8, 8]})
    two = TrainingSet(Dataset(Path(), {}, table))
    assert held_out(two, 0.1, 8) == ([0, 1, 2], [3, 4, 5])
    assert held_out(two, 0.1, 2) == ([0, 1, 2], [3, 4])
    assert held_out(views, 0.1, 8) == ([0, 1, 2], [3])
    assert held_out(views, 0.5, 8) == ([0, 1], [2, 3])
    with pytest.raises(TrainingError, match="there are 0: ask for more"):
        held_out(TrainingSet(), 0.1, 8)


def test_a_share_is_of_whole_rooms(views):
    rooms = TrainingSet(Dataset(Path(), {}, pd.DataFrame({"room": [1, 1, 2, 2, 5, 5, 7, 7]})))
    assert share_of(rooms, [0, 1, 2, 3, 4, 5], 1) == [0, 1, 2, 3, 4, 5]
    assert share_of(rooms, list(range(8)), 0.5) == [0, 1, 4, 5]
    assert share_of(rooms, [2, 3, 4, 5, 6, 7], 0.33) == [2, 3]
    assert share_of(rooms, [0, 1, 2, 3, 4, 5], 0.01) == [0, 1]
    assert share_of(views, [0, 1, 2, 3], 0.5) == [0, 2]


def test_images_of_lanes_are_means_of_their_cells():
    import mitsuba as mi

    lanes = np.arange(4 * 6, dtype=np.float32)
    expected = lanes.reshape(2, 2, 3, 2).mean(axis=(1, 3))
    one = as_image(mi.Float(lanes), (6, 4), 2)
    three = as_image(mi.Color3f(lanes, 2 * lanes, 0), (6, 4), 2)
    np.testing.assert_allclose(one[0], expected)
    np.testing.assert_allclose(three[1], 2 * expected)
    assert three.shape == (3, 2, 3)
    assert not three[2].any()
