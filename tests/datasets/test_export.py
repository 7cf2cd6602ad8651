"""Each format is opened by what its users open it with, and a point of the scene is found in its pictures."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import trimesh
from PIL import Image
from pydantic import BaseModel, ConfigDict

from gibench.cli import run
from gibench.cli.app import app, make_app
from gibench.datasets import open_dataset
from gibench.datasets.errors import DatasetError, FolderError, UnknownChannel
from gibench.datasets.export import FORMATS, export
from gibench.rendering.channels import CHANNELS


@pytest.fixture(scope="module")
def rooms(tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp("export") / "rooms"
    words = [
        "--preset",
        "smoke",
        "--rooms",
        "2",
        "--views",
        "2",
        "--resolution",
        "40x30",
        "--spp",
        "2",
        "--channels",
        "radiance,surface",
    ]
    assert run(make_app, [*words, "--out", str(root)]) == 0
    return root


def exported(rooms: Path, to: str, tmp_path_factory) -> Path:
    return export(open_dataset(rooms), to, tmp_path_factory.mktemp(to) / "out")


def in_pixels(pose_opencv: np.ndarray, k: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(N, 2) pixels of world points, by the textbook: K [R | t] with world to camera."""
    world_to_camera = np.linalg.inv(pose_opencv)
    camera = points @ world_to_camera[:3, :3].T + world_to_camera[:3, 3]
    homogeneous = camera @ k.T
    return homogeneous[:, :2] / homogeneous[:, 2:]


def assert_points_fall_on_their_pixels(pose_opencv, k, position) -> None:
    position = np.asarray(position, np.float64)
    hit = np.any(position, axis=-1)
    assert hit.mean() > 0.5
    rows, columns = np.nonzero(hit)
    found = in_pixels(np.asarray(pose_opencv), np.asarray(k), position[hit])
    np.testing.assert_allclose(found, np.stack([columns, rows], -1) + 0.5, atol=2e-3)


class NerfstudioFrame(BaseModel):
    """The keys of a frame that docs.nerf.studio names, with intrinsics by frame."""

    model_config = ConfigDict(extra="forbid")
    file_path: str
    depth_file_path: str
    transform_matrix: tuple[tuple[float, float, float, float], ...]
    fl_x: float
    fl_y: float
    cx: float
    cy: float
    w: int
    h: int
    k1: float
    k2: float
    p1: float
    p2: float


class Nerfstudio(BaseModel):
    model_config = ConfigDict(extra="forbid")
    camera_model: Literal["OPENCV", "OPENCV_FISHEYE", "PINHOLE", "SIMPLE_PINHOLE", "EQUIRECTANGULAR"]
    ply_file_path: str
    frames: tuple[NerfstudioFrame, ...]


def test_nerfstudio(rooms, tmp_path_factory):
    out, dataset = exported(rooms, "nerfstudio", tmp_path_factory), open_dataset(rooms)
    frames = iter(dataset)
    for room in (0, 1):
        folder = out / f"room-{room:06d}"
        scene = Nerfstudio.model_validate_json((folder / "transforms.json").read_text("utf-8"))
        assert len(scene.frames) == 2
        cloud = trimesh.load(folder / scene.ply_file_path)
        assert len(cloud.vertices) > 1000
        assert cloud.colors.shape == (len(cloud.vertices), 4)
        for entry in scene.frames:
            frame = next(frames)
            opengl = np.array(entry.transform_matrix)
            opencv = opengl @ np.diag([1, -1, -1, 1])
            k = [[entry.fl_x, 0, entry.cx], [0, entry.fl_y, entry.cy], [0, 0, 1]]
            assert_points_fall_on_their_pixels(opencv, k, frame["position"])
            assert (entry.w, entry.h) == Image.open(folder / entry.file_path).size == (40, 30)
            depth = np.asarray(Image.open(folder / entry.depth_file_path))
            assert depth.dtype == np.uint16
            near = frame["depth"][..., 0] < 65
            np.testing.assert_allclose(depth[near] / 1000, frame["depth"][near, 0], atol=0.00051)
            assert not depth[~near].any()
            # nerfstudio's cameras look along −z: points in view lie there, at the depth of the picture.
            points = frame["position"].reshape(-1, 3).astype(np.float64)
            inside = (points - opengl[:3, 3]) @ opengl[:3, :3]
            hit = np.any(points, axis=1)
            np.testing.assert_allclose(-inside[hit, 2], frame["depth"].reshape(-1)[hit], rtol=1e-4)


def test_webdataset(rooms, tmp_path_factory):
    webdataset = pytest.importorskip("webdataset")
    out, dataset = exported(rooms, "webdataset", tmp_path_factory), open_dataset(rooms)
    shards = sorted(str(path) for path in out.glob("*.tar"))
    assert {Path(shard).name.split("-")[0] for shard in shards} == set(dataset.frames["split"])
    samples = {
        sample["__key__"]: sample
        for sample in webdataset.WebDataset(shards, shardshuffle=False, empty_check=False).decode()
    }
    assert sorted(samples) == [f"{frame.room:06d}_{frame.view:04d}" for frame in dataset]
    for frame in dataset:
        sample = samples[f"{frame.room:06d}_{frame.view:04d}"]
        for name in frame.channels:
            np.testing.assert_array_equal(sample[f"{name}.npy"], frame[name])
        row = sample["json"]
        assert row["split"] == frame.row["split"]
        assert row["seed"] == frame.row["seed"]
        assert "file" not in row
        assert_points_fall_on_their_pixels(row["camera_to_world"], row["intrinsics"], sample["position.npy"])


def test_the_same_shards_every_time(rooms, tmp_path):
    pytest.importorskip("webdataset")
    first, again = (export(open_dataset(rooms), "webdataset", tmp_path / name) for name in ("a", "b"))
    for shard in first.iterdir():
        assert shard.read_bytes() == (again / shard.name).read_bytes()


READER = """
import sys, fsspec, webdataset
from webdataset.gopen import gopen_schemes
gopen_schemes["local"] = lambda url, mode="rb", *_, **__: fsspec.open(url, mode).open()
store, path = fsspec.url_to_fs(sys.argv[1])
urls = [f"local://{name}" for name in sorted(store.glob(f"{path}/*.tar"))]
frames = webdataset.WebDataset(urls, nodesplitter=webdataset.split_by_node, shardshuffle=False).decode()
print(*(frame["__key__"] for frame in frames))
"""


def test_hosts_share_shards_out_among_them(rooms, tmp_path, monkeypatch):
    pytest.importorskip("webdataset")
    pytest.importorskip("fsspec")
    from gibench.datasets.export import web_shards

    monkeypatch.setattr(web_shards, "SHARD_BYTES", 1)  # a frame a shard
    shards = export(open_dataset(rooms), "webdataset", tmp_path / "shards", channels=["color"])
    hosts = [
        subprocess.Popen(
            [sys.executable, "-c", READER, f"file://{shards}"],
            env={**os.environ, "RANK": str(rank), "WORLD_SIZE": "2"},
            stdout=subprocess.PIPE,
            text=True,
        )
        for rank in range(2)
    ]
    first, second = (set(host.communicate(timeout=300)[0].split()) for host in hosts)
    assert len(first) == len(second) == 2
    assert first | second == {f"{frame.room:06d}_{frame.view:04d}" for frame in open_dataset(rooms)}


def test_hypersim_like_hdf5(rooms, tmp_path_factory):
    h5py = pytest.importorskip("h5py")
    out, dataset = exported(rooms, "hypersim-like-hdf5", tmp_path_factory), open_dataset(rooms)

    def read(path: Path) -> np.ndarray:
        with h5py.File(path) as file:
            return file["dataset"][()]

    for frame in dataset:
        scene = out / f"ai_000_{frame.room:03d}"
        final = {
            name: read(scene / f"images/scene_cam_00_final_hdf5/frame.{frame.view:04d}.{name}.hdf5")
            for name in (
                "color",
                "diffuse_illumination",
                "diffuse_reflectance",
                "residual",
                "indirect_specular",
            )
        }
        geometry = {
            name: read(scene / f"images/scene_cam_00_geometry_hdf5/frame.{frame.view:04d}.{name}.hdf5")
            for name in ("depth_meters", "position", "normal_world", "render_entity_id")
        }
        np.testing.assert_array_equal(final["color"], frame["color"])
        np.testing.assert_allclose(
            final["diffuse_illumination"] * final["diffuse_reflectance"] + final["residual"],
            final["color"],
            rtol=1e-3,
            atol=1e-4 * final["color"].max(),
        )
        np.testing.assert_array_equal(geometry["depth_meters"], frame["distance"][..., 0])
        ids = frame["shape_id"][..., 0].astype(int)
        np.testing.assert_array_equal(geometry["render_entity_id"], np.where(ids > 0, ids, -1))
        positions = read(scene / "_detail/cam_00/camera_keyframe_positions.hdf5")
        turns = read(scene / "_detail/cam_00/camera_keyframe_orientations.hdf5")
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turns[frame.view], positions[frame.view]
        assert_points_fall_on_their_pixels(
            pose @ np.diag([1, -1, -1, 1]), frame.intrinsics, geometry["position"]
        )


def test_huggingface(rooms, tmp_path_factory, capsys):
    datasets = pytest.importorskip("datasets")
    out, dataset = exported(rooms, "huggingface", tmp_path_factory), open_dataset(rooms)
    assert capsys.readouterr() == ("", "")
    loaded = datasets.load_dataset(str(out), cache_dir=str(tmp_path_factory.mktemp("cache")))
    assert set(loaded) == set(dataset.frames["split"])
    assert sum(map(len, loaded.values())) == len(dataset)
    for split, table in loaded.items():
        for row, frame in zip(table.with_format("numpy"), dataset.split(split), strict=True):
            assert (row["room"], row["view"]) == (frame.room, frame.view)
            for name in frame.channels:
                assert row[name].dtype.kind == frame[name].dtype.kind.replace("u", "i")
                np.testing.assert_array_equal(row[name], frame[name])
            assert_points_fall_on_their_pixels(row["camera_to_world"], row["intrinsics"], row["position"])
            assert row["image"].shape == (30, 40, 3)
    card = (out / "README.md").read_text("utf-8")
    assert card.startswith("---\nlicense: cc0-1.0\n")
    assert all(f"| `{name}` |" in card for name in dataset[0].channels)
    assert sorted(path.name for path in out.iterdir()) == ["README.md", "data"]


def test_a_split_that_the_library_would_not_load_is_refused(rooms, tmp_path):
    pytest.importorskip("datasets")
    dataset = open_dataset(rooms)
    dataset.frames["split"] = "un-seen"
    with pytest.raises(DatasetError, match="split 'un-seen' cannot be read by the library datasets"):
        export(dataset, "huggingface", tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("to", sorted(FORMATS))
def test_some_channels_of_one_split(rooms, to, tmp_path):
    """A frame without positions or light can be written too."""
    dataset = open_dataset(rooms)
    split = str(dataset.frames["split"][0])
    arguments = ["dataset", "export", str(rooms), "--to", to, "--channels", "depth", "--split", split]
    assert run(app, [*arguments, "--out", str(tmp_path / "out")]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    words = "".join(str(path.relative_to(tmp_path)) for path in (tmp_path / "out").rglob("*"))
    assert "color" not in words
    assert "position." not in words


def test_refusals_leave_nothing_behind(rooms, tmp_path, capsys):
    dataset = open_dataset(rooms)
    with pytest.raises(DatasetError, match="no format 'nerfstudo'; did you mean 'nerfstudio'"):
        export(dataset, "nerfstudo", tmp_path / "out")
    with pytest.raises(DatasetError, match="no frame"):
        export(dataset[[]], "nerfstudio", tmp_path / "out")
    with pytest.raises(UnknownChannel):
        export(dataset, "webdataset", tmp_path / "out", channels=("motion",))
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "out").mkdir()
    with pytest.raises(FolderError, match="exists: choose a new folder"):
        export(dataset, "nerfstudio", tmp_path / "out")
    (tmp_path / "file").write_text("")
    assert (
        run(app, ["dataset", "export", str(rooms), "--to", "nerfstudio", "--out", str(tmp_path / "file/x")])
        == 2
    )
    assert capsys.readouterr().err.startswith("error: ")


@pytest.mark.parametrize(
    ("channel", "says"),
    [
        ("surfaces", "unknown channel or set 'surfaces': did you mean surface"),
        ("motion", "no channel 'motion'"),
    ],
)
@pytest.mark.parametrize("words", [["cache"], ["export", "--to", "webdataset", "--out", "out"]])
def test_channels_that_are_not_there_are_a_mistake(
    rooms, tmp_path, monkeypatch, capsys, words, channel, says
):
    monkeypatch.chdir(tmp_path)
    command, *more = words
    assert run(app, ["dataset", command, str(rooms), "--channels", channel, *more]) == 2
    assert says in " ".join(capsys.readouterr().err.split())
    assert list(tmp_path.iterdir()) == []


def test_an_export_that_is_stopped_leaves_nothing(rooms, tmp_path):
    def stop(done: int, of: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    for to in FORMATS:
        with pytest.raises(KeyboardInterrupt):
            export(open_dataset(rooms), to, tmp_path / "out", tell=stop)
        assert list(tmp_path.iterdir()) == []


def test_a_library_that_is_not_there_is_named(rooms, tmp_path, monkeypatch):
    monkeypatch.setitem(FORMATS, "nerfstudio", "gibench.datasets.export.not_there")
    with pytest.raises(DatasetError, match=r"pip install 'gibench\[export\]'"):
        export(open_dataset(rooms), "nerfstudio", tmp_path / "out")


def test_rows_are_json_and_name_every_column(rooms):
    from gibench.datasets.export.frames import row_of

    frame = open_dataset(rooms)[0]
    row = json.loads(json.dumps(row_of(frame), allow_nan=False))
    assert set(row) == {*frame.row, "camera_to_world", "intrinsics"} - {"file", "bytes", "sha256"}
    assert set(frame.channels) <= set(CHANNELS)
