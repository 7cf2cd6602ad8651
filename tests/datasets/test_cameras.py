"""Rolled, mirrored and off-centre cameras through a dataset and out of it again."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pandas as pd
import pytest

from gibench.cli import run
from gibench.cli.app import make_app
from gibench.datasets import open_dataset
from gibench.datasets.cameras import COLUMNS, camera_of
from gibench.datasets.errors import DatasetError
from gibench.datasets.export import export
from gibench.generators.parts import Camera
from gibench.rendering.camera import PinholeCamera
from tests.datasets.test_export import assert_points_fall_on_their_pixels
from tests.generators.imported.files import room_file

AIM = {"origin": [0.6, -2.2, 1.6], "target": [0, 0.5, 1.1], "fov_degrees": 60}
MIRROR = [[1, 0, 0, 0.5], [0, 0, 1, -2], [0, 1, 0, 1.5], [0, 0, 0, 1]]
GIVEN = [
    {**AIM, "up": [0.4, 0.1, 1]},
    {**AIM, "principal_point": [0.2, -0.1]},
    {"matrix": MIRROR, "fov_degrees": 60},
]


@pytest.fixture(scope="module")
def odd(tmp_path_factory):
    """Four frames of a scene: its own camera, a rolled, an off-centre and a mirrored one."""
    folder = tmp_path_factory.mktemp("odd")
    scene = room_file(folder / "scene")
    (folder / "cameras.json").write_text(json.dumps(GIVEN))
    words = ["--scene", str(scene), "--up", "z", "--cameras", str(folder / "cameras.json"), "--spp", "4"]
    words += ["--resolution", "32x24", "--channels", "radiance,surface", "--out", str(folder / "d")]
    assert run(make_app, words) == 0
    return folder / "d"


def test_they_come_back(odd):
    frames = list(open_dataset(odd))
    cameras = [frame.camera for frame in frames]
    assert len(cameras) == 4
    plain, rolled, shifted, mirrored = cameras
    assert plain == PinholeCamera(plain.position, plain.target, plain.fov)
    assert rolled.up == (0.4, 0.1, 1.0)
    assert shifted.principal_point == (0.2, -0.1)
    assert mirrored.mirrored
    assert (shifted.up, mirrored.up) == (None, None)
    described = json.loads((odd / "rooms/000000/room.json").read_text())["cameras"]
    for camera, record in zip(cameras, described, strict=True):
        assert Camera(**record).pinhole == camera
    for frame in frames:
        assert_points_fall_on_their_pixels(frame.camera_to_world, frame.intrinsics, frame["position"])
        turned = np.linalg.det(frame.camera_to_world)
        assert turned == pytest.approx(-1 if frame.camera.mirrored else 1)


def test_an_older_table_opens(odd, tmp_path):
    new = [name for name in COLUMNS if name.startswith(("up_", "principal_point_", "mirrored"))]
    assert len(new) == 6
    (tmp_path / "dataset.json").write_bytes((odd / "dataset.json").read_bytes())
    table = pd.read_parquet(odd / "frames.parquet")
    table.drop(columns=new).to_parquet(tmp_path / "frames.parquet", index=False)
    older = open_dataset(tmp_path)
    assert list(older.frames) == list(table)
    row = older.frames.iloc[1]
    assert np.isnan(row["up_x"])
    assert (row["principal_point_x"], row["principal_point_y"], row["mirrored"]) == (0, 0, 0)
    columns = [f"camera_{axis}" for axis in "xyz"], [f"target_{axis}" for axis in "xyz"]
    position, target = (tuple(table.iloc[1][names]) for names in columns)
    assert camera_of(row.to_dict()) == PinholeCamera(position, target, row["fov"])


def test_exports_have_them_or_say_that_they_cannot(odd, tmp_path):
    dataset = open_dataset(odd)
    for to in ("nerfstudio", "hypersim-like-hdf5"):
        with pytest.raises(DatasetError, match="room 0, view 3 has a mirrored camera"):
            export(dataset[[0, 3]], to, tmp_path / to)
    with pytest.raises(DatasetError, match="room 0, view 2 has an off-centre camera"):
        export(dataset[[0, 2]], "hypersim-like-hdf5", tmp_path / "off-centre")
    assert list(tmp_path.iterdir()) == []
    folder = export(dataset[[1, 2]], "nerfstudio", tmp_path / "n") / "room-000000"
    entries = json.loads((folder / "transforms.json").read_text())["frames"]
    assert [(entry["cx"], entry["cy"]) for entry in entries] == [(16, 12), pytest.approx((22.4, 9.6))]
    for entry, frame in zip(entries, dataset[[1, 2]], strict=True):
        pose = np.array(entry["transform_matrix"]) @ np.diag([1.0, -1.0, -1.0, 1.0])
        k = [[entry["fl_x"], 0, entry["cx"]], [0, entry["fl_y"], entry["cy"]], [0, 0, 1]]
        assert_points_fall_on_their_pixels(pose, k, frame["position"])
    folder = export(dataset[[1]], "hypersim-like-hdf5", tmp_path / "h")
    (file,) = folder.rglob("camera_keyframe_orientations.hdf5")
    with h5py.File(file) as content:
        np.testing.assert_allclose(
            content["dataset"][0] @ np.diag([1, -1, -1]), dataset[1].camera.frame.T, atol=1e-12
        )
