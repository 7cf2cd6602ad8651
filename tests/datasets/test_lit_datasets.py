"""Datasets whose frames have light of their own: an area light each, or an environment."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from gibench.cli import run
from gibench.cli.app import make_app
from gibench.datasets import open_dataset
from gibench.datasets.errors import RecipeError
from gibench.datasets.lightings import COLUMNS, columns_of, lighting_of
from gibench.datasets.recipes import Recipe, check_recipe, load_recipe
from gibench.datasets.verifying import verify
from gibench.generators.scene_files import lighting_record
from gibench.rendering.lighting import AreaLight, EnvironmentMap, Lighting
from gibench.rendering.panoramas import Panorama
from tests.datasets.test_real_dataset import frames_of
from tests.generators.imported.files import room_file

TINY = ["--resolution", "16x12", "--spp", "2"]
MOVING = """
rooms = 2
views = 1
kinds = ["office"]
denoise = false
lighting = "area-light"
channels = ["radiance", "shape_id", "motion"]
[sequences.light]
views = 2
moves = "light"
[sequences.camera]
views = 2
"""


def panorama_file(path: Path, pixels: np.ndarray) -> Path:
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"RGB": pixels.astype(np.float32)}).write(
        str(path)
    )
    return path


@pytest.fixture(scope="module")
def moving(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("moving")
    (folder / "moving.toml").write_text(MOVING)
    root = folder / "data"
    assert (
        run(make_app, ["--recipe", str(folder / "moving.toml"), *TINY, "--workers", "2", "--out", str(root)])
        == 0
    )
    return root


def test_every_still_has_a_light_and_sequences_move_what_they_say(moving):
    assert verify(moving) == []
    dataset = open_dataset(moving)
    assert set(COLUMNS) <= set(dataset.frames.columns)
    for room in (0, 1):
        frames = [frame for frame in dataset if frame.room == room]
        assert [frame.row["path"] for frame in frames] == ["", "light", "light", "camera", "camera"]
        lights = [frame.lighting.area for frame in frames]
        assert lights[1] != lights[2]
        assert (lights[1].width, lights[1].radiance) == (lights[2].width, lights[2].radiance)
        assert frames[1].camera == frames[2].camera
        assert lights[3] == lights[4]
        assert frames[3].camera != frames[4].camera
        assert len(set(lights)) == 4
        described = json.loads((moving / f"rooms/00000{room}/room.json").read_text())
        assert len(described["lightings"]) == 5
        for record, area in zip(described["lightings"], lights, strict=True):
            np.testing.assert_allclose(record["centre"], area.centre, rtol=1e-12)
            np.testing.assert_allclose(record["radiance"], area.radiance, rtol=1e-12)
    assert dataset.names(0)[1][-1] == "area_light"


def test_a_frame_is_what_its_shot_gives(moving):
    from gibench.rendering.light_rig import LightRig
    from gibench.rendering.render import render_frame
    from gibench.rendering.scene import load_scene

    frame = open_dataset(moving)[2]
    rig = LightRig(load_scene(moving / "rooms/000000/scene.xml", share_kernels=True), panoramas=False)
    rig.set(frame.shot.lighting)
    again = render_frame(
        rig.scene,
        frame.shot.camera,
        resolution=(16, 12),
        spp=2,
        seed=int(frame.row["seed"]),
        channels=("radiance",),
    )
    np.testing.assert_array_equal(again.arrays["color"].astype(np.float16), frame["color"].astype(np.float16))


def test_one_worker_makes_a_lost_room_again_as_two_made_it(moving, tmp_path):
    root = shutil.copytree(moving, tmp_path / "data")
    shutil.rmtree(root / "rooms/000001")
    assert run(make_app, ["--recipe", str(moving.parent / "moving.toml"), *TINY, "--out", str(root)]) == 0
    assert frames_of(root) == frames_of(moving)
    assert verify(root) == []


@pytest.fixture(scope="module")
def maps(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("maps")
    rng = np.random.default_rng(0)
    for name in "ab":
        panorama_file(folder / f"{name}.exr", rng.random((128, 256, 3)) ** 3)
    return folder


@pytest.fixture(scope="module")
def lit(maps, tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp("lit") / "data"
    words = ["--rooms", "1", "--views", "4", *TINY, "--channels", "color,depth", "--environments", str(maps)]
    assert run(make_app, [*words, "--out", str(root)]) == 0
    return root


def test_environments_lie_beside_the_rooms_and_come_with_the_frames(lit, maps, capsys):
    assert verify(lit) == []
    dataset = open_dataset(lit)
    lights = [frame.lighting.environment for frame in dataset]
    assert {light.panorama.name for light in lights} <= {"a", "b"}
    assert len({light.rotation for light in lights}) == 4
    with OpenEXR.File(str(maps / f"{lights[0].panorama.name}.exr")) as file:
        np.testing.assert_array_equal(lights[0].panorama.pixels, file.channels()["RGB"].pixels)
    assert len(list((lit / "environments").iterdir())) == len({light.panorama for light in lights})
    assert run(make_app, ["--help"]) == 0
    assert "area-light" in capsys.readouterr().out


def test_other_maps_are_another_dataset(lit, tmp_path, maps, capsys):
    folder = shutil.copytree(maps, tmp_path / "maps")
    panorama_file(folder / "a.exr", np.ones((128, 256, 3)))
    words = ["--rooms", "1", "--views", "4", *TINY, "--channels", "color,depth"]
    assert run(make_app, [*words, "--environments", str(folder), "--out", str(lit)]) == 2
    assert "holds another dataset (environments:" in capsys.readouterr().err
    # The same maps elsewhere are the same dataset.
    assert (
        run(
            make_app,
            [*words, "--environments", str(shutil.copytree(maps, tmp_path / "moved")), "--out", str(lit)],
        )
        == 0
    )


def test_verify_finds_a_map_that_was_lost_or_changed(lit, tmp_path):
    root = shutil.copytree(lit, tmp_path / "data")
    one, *_ = sorted((root / "environments").iterdir())
    panorama_file(one, np.ones((128, 256, 3)))
    problems = verify(root)
    assert [problem.file for problem in problems] == [f"environments/{one.name}"]
    one.unlink()
    assert "cannot be read" in verify(root)[0].what


@pytest.mark.parametrize(
    ("pixels", "says"),
    [
        (np.full((4, 8, 3), np.nan), "negative or not finite"),
        (-np.ones((4, 8, 3)), "negative or not finite"),
        (np.ones((6, 8, 3)), "twice as wide as high"),
        (np.zeros((4, 8, 3)), "black"),
        (None, "holds no .hdr or .exr file"),
    ],
)
def test_a_folder_that_lights_nothing_ends_in_one_line_and_leaves_nothing(tmp_path, capsys, pixels, says):
    (tmp_path / "maps").mkdir()
    if pixels is not None:
        panorama_file(tmp_path / "maps/a.exr", pixels)
    words = ["--rooms", "1", "--views", "1", *TINY, "--environments", str(tmp_path / "maps")]
    assert run(make_app, [*words, "--out", str(tmp_path / "data")]) == 2
    error = capsys.readouterr().err.strip()
    assert says in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "data").exists()


def test_frames_of_a_scene_file_have_a_light_each_too(tmp_path, maps):
    """Its lamp is dark, so that all light is that of the frame: through the open ceiling, or from the rectangle."""
    scene = room_file(tmp_path / "scene")
    words = ["--scene", str(scene), "--views", "1", *TINY, "--channels", "radiance"]
    area, sky = tmp_path / "area", tmp_path / "sky"
    assert run(make_app, [*words, "--lighting", "area-light", "--out", str(area)]) == 0
    lit = ["--environments", str(maps), "--opened", "ceiling"]
    assert run(make_app, [*words, *lit, "--out", str(sky)]) == 0
    for root in (area, sky):
        assert verify(root) == []
        frames = list(open_dataset(root))
        assert len(frames) == 2  # the scene's own camera, and the view
        assert len({frame.lighting for frame in frames}) == 2
        assert all(frame["color"].any() for frame in frames)
    dataset = open_dataset(area)
    assert [frame.lighting.kind for frame in dataset] == ["area-light"] * 2
    assert dataset.names(0)[1][-1] == "area_light"
    for frame in dataset:
        x, y, z = frame.lighting.area.centre
        assert abs(x) < 2.5
        assert abs(y) < 3
        assert 0 < z < 2.7
    assert {frame.lighting.environment.panorama.name for frame in open_dataset(sky)} <= {"a", "b"}


def test_lights_survive_the_table(tmp_path):
    panorama = Panorama.of("a", np.ones((4, 8, 3)))
    for lighting in (
        Lighting(AreaLight((1, 2, 3), (1, 1, -1), 0.3, 0.4, (5, 6, 7))),
        Lighting(environment=EnvironmentMap(panorama, 1.25)),
        Lighting(),
    ):
        row = columns_of(json.loads(json.dumps(lighting_record(lighting))))
        assert list(row) == list(COLUMNS)
        back = lighting_of(row, tmp_path)
        if lighting.area is None:
            assert back == lighting
        else:
            np.testing.assert_allclose(back.area.corners, lighting.area.corners, atol=1e-12)
    assert lighting_of({}, tmp_path) == Lighting()


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"lighting": "moon"}, "'moon' is not allowed"),
        ({"environments": ["indoor"]}, "set lighting"),
        ({"lighting": "environments", "environments": ["indor"]}, "did you mean indoor"),
        ({"lighting": "area-light", "kinds": ["still-life"]}, "kinds has still-life, which an environment"),
        ({"lighting": "area-light", "kinds": ["office", "still-life"]}, "set lighting to .environments"),
        (
            {"lighting": "area-light", "sampling": "guided"},
            "sampling is .guided., but .* holds for one light",
        ),
        ({"lighting": "environments", "sampling": "guided"}, "set lighting to .own."),
        ({"path": "walk", "path_moves": "light"}, "keeps its own"),
        ({"lighting": "area-light", "path_moves": "light"}, "needs a path"),
        ({"lighting": "area-light", "path": "walk", "sequences": {"a": {"views": 2}}}, "both set"),
        ({"lighting": "area-light", "sequences": {"a": {"views": 0}}}, "sequences"),
        ({"lighting": "area-light", "sequences": {"a": {"frames": 2}}}, "sequences"),
    ],
)
def test_recipes_of_light_that_make_no_sense(values, says):
    with pytest.raises(RecipeError, match=says) as caught:
        check_recipe(values)
    assert "\n" not in str(caught.value)


def test_recipes_of_light_that_make_sense(tmp_path, maps):
    (tmp_path / "a.toml").write_text(f'lighting = "environments"\nenvironments = "{maps.name}"\n')
    shutil.copytree(maps, tmp_path / maps.name)
    assert load_recipe(tmp_path / "a.toml").environments == (str(tmp_path / maps.name),)
    indoor = check_recipe({"lighting": "environments"})
    assert indoor.environments == ("indoor",)
    assert len(indoor.identity()["environments"]) == 23
    assert Recipe.model_validate(indoor.model_dump(mode="json")) == indoor
    plain = check_recipe({})
    assert not {"lighting", "environments", "sequences", "path_moves"} & plain.identity().keys()
    both = check_recipe(
        {"lighting": "area-light", "sequences": {"a": {"views": 3}, "b": {"views": 2, "moves": "both"}}}
    )
    assert list(both.rendered_views()) == list(range(9))
    assert both.moves() == {"a": "camera", "b": "both"}
    assert check_recipe({"lighting": "area-light", "path": "walk", "path_moves": "both"}).moves() == {
        "walk": "both"
    }
