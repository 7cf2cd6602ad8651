"""Datasets of scenes: from the command to a folder, what may go on where it stopped, and what is refused."""

from __future__ import annotations

import errno
import json
import os

import numpy as np
import pytest

from gibench.cli import run
from gibench.cli.app import app, make_app
from gibench.datasets import open_dataset
from gibench.datasets.errors import FolderError, RecipeError
from gibench.datasets.manifest import read_manifest, refuse_other
from gibench.datasets.recipes import SCENE_LICENCE, check_recipe, load_recipe
from gibench.datasets.verifying import verify
from tests.generators.imported.files import SQUARE, image, room_file, written

SMALL = ["--resolution", "16x12", "--spp", "4", "--channels", "radiance,depth"]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return room_file(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def made(scene, tmp_path_factory):
    root = tmp_path_factory.mktemp("made") / "d"
    assert run(make_app, ["--scene", str(scene), "--views", "1", *SMALL, "--out", str(root)]) == 0
    return root


def test_a_dataset_of_a_scene_is_one_like_any_other(made, scene):
    assert verify(made) == []
    dataset = open_dataset(made)
    assert len(dataset) == 2
    assert set(dataset.frames["kind"]) == {scene.parent.name}
    np.testing.assert_allclose(dataset.frames[["camera_x", "camera_y", "camera_z"]].iloc[0], (0.6, -2.2, 1.6))
    manifest = read_manifest(made)
    assert manifest["licence"] == SCENE_LICENCE
    assert manifest["recipe"]["rooms"] == 1
    assert dataset[0]["color"].max() > 0


def test_the_command_in_the_manifest_makes_the_same(made, tmp_path):
    import shlex

    words = shlex.split(read_manifest(made)["command"])
    words[words.index("--out") + 1] = str(tmp_path / "again")
    assert run(make_app, words[1:]) == 0
    for file in made.glob("rooms/000000/frames/*.exr"):
        assert (tmp_path / "again" / file.relative_to(made)).read_bytes() == file.read_bytes()


def test_the_same_again_does_nothing_and_info_says_what_was_changed(made, scene, capsys):
    before = {path: path.stat().st_mtime_ns for path in made.rglob("*")}
    assert run(make_app, ["--scene", str(scene), "--views", "1", *SMALL, "--out", str(made)]) == 0
    assert {path: path.stat().st_mtime_ns for path in made.rglob("*")} == before
    assert "already complete" in capsys.readouterr().out
    assert run(app, ["dataset", "info", str(made)]) == 0
    assert f"scene         {scene.parent.name}: z up, 0 changes" in capsys.readouterr().out


def test_two_workers_make_what_one_makes(scene, made, tmp_path):
    scenes = ["--scene", str(scene), "--scene", str(scene)]
    assert (
        run(make_app, [*scenes, "--views", "1", *SMALL, "--out", str(tmp_path / "d"), "--workers", "2"]) == 0
    )
    assert verify(tmp_path / "d") == []
    first = made / "rooms/000000/frames/0001.exr"
    assert (tmp_path / "d/rooms/000000/frames/0001.exr").read_bytes() == first.read_bytes()
    # The same place with samples of its own.
    dataset = open_dataset(tmp_path / "d")
    assert len(set(dataset.frames.query("view == 1")["camera_x"])) == 1
    assert len(set(dataset.frames.query("view == 1")["seed"])) == 2


def test_with_views_0_its_own_cameras_alone_and_with_a_file_those_of_the_file(scene, tmp_path):
    given = ["--scene", str(scene), *SMALL]
    assert run(make_app, [*given, "--views", "0", "--out", str(tmp_path / "own")]) == 0
    assert len(open_dataset(tmp_path / "own")) == 1
    cameras = tmp_path / "cameras.json"
    cameras.write_text('[{"origin": [0, -2, 1.5], "target": [0, 0, 1], "fov_degrees": 70}]')
    assert run(make_app, [*given, "--cameras", str(cameras), "--out", str(tmp_path / "file")]) == 0
    dataset = open_dataset(tmp_path / "file")
    assert len(dataset) == 2
    assert dataset.frames["fov"].iloc[1] == pytest.approx(np.radians(70))


def test_a_dry_run_estimates_scenes_too(scene, tmp_path, capsys):
    words = ["--scene", str(scene), "--views", "2", *SMALL, "--out", str(tmp_path / "d"), "--dry-run"]
    assert run(make_app, words) == 0
    assert "3, about" in capsys.readouterr().out.split("frames")[1].splitlines()[0]
    assert not (tmp_path / "d").exists()


def test_a_recipe_of_scenes(scene, tmp_path):
    (tmp_path / "mine.toml").write_text(
        f'scenes = ["{scene}"]\nup = "y"\nscale = 0.5\nallow_missing = true\n'
    )
    recipe = load_recipe(tmp_path / "mine.toml")
    assert (recipe.rooms, recipe.up, recipe.scale, recipe.licence) == (1, "y", 0.5, SCENE_LICENCE)
    settings = recipe.import_settings()
    assert (settings.up, settings.scale, settings.allow_missing, settings.allow_outside) == (
        "y",
        0.5,
        True,
        False,
    )
    assert list(recipe.rendered_views(2)) == list(range(6))


def test_paths_in_a_recipe_count_from_its_folder(scene):
    file = scene.with_name("mine.toml")
    file.write_text('scenes = ["scene.xml"]\n')
    assert load_recipe(file).scenes == (str(scene.resolve()),)


def test_another_scene_or_scale_is_another_dataset(made, scene, tmp_path):
    manifest = read_manifest(made)
    recipe = check_recipe(manifest["recipe"])
    refuse_other(made, manifest, recipe)
    for change in ({"scale": 2.0}, {"up": "y"}, {"scenes": [str(room_file(tmp_path, extra=SQUARE))]}):
        with pytest.raises(FolderError, match=next(iter(change))):
            refuse_other(made, manifest, check_recipe({**manifest["recipe"], **change}))
    # Where it lies does not matter.
    copy = room_file(tmp_path / "elsewhere")
    refuse_other(made, manifest, check_recipe({**manifest["recipe"], "scenes": [str(copy)]}))


def test_generated_rooms_keep_their_identity():
    assert not {"scenes", "up", "scale", "cameras"} & check_recipe({}).identity().keys()


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"scenes": ["none.xml"]}, r"scenes: there is no scene file none\.xml"),
        ({"scale": 2.0}, "scale is set, but only scenes have it"),
        ({"views": 0}, "views: 0 is not allowed: only scenes have cameras of their own"),
        ({"scenes": ["s.xml"], "environment": "none"}, "environment is set, but scenes bring their own"),
        ({"scenes": ["s.xml"], "scale": -1.0}, r"scale: -1\.0 is not allowed; allowed is a number above 0"),
        ({"scenes": ["s.xml"], "up": "w"}, "up: 'w' is not allowed"),
        ({"scenes": "s.xml"}, "scenes: 's.xml' is not allowed; allowed is a list"),
    ],
)
def test_recipes_that_make_no_sense(values, says):
    with pytest.raises(RecipeError, match=says):
        check_recipe(values)


def refused(capsys, *arguments, to=make_app) -> str:
    assert run(to, [str(argument) for argument in arguments]) == 2
    said = capsys.readouterr()
    assert said.err.startswith("error: ")
    assert said.err.count("\n") == 1
    return said.err


def test_mistakes_end_with_one_line_and_leave_nothing(capsys, tmp_path, scene):
    out = ["--out", tmp_path / "d"]
    assert "--scene: there is no scene file gone.xml" in refused(capsys, "--scene", "gone.xml", *out)
    assert "leave out --rooms and --kind" in refused(capsys, "--scene", scene, "--rooms", 3, *out)
    assert "--up: 'w' is not allowed" in refused(capsys, "--scene", scene, "--up", "w", *out)
    assert "--scale: 0.0 is not allowed" in refused(capsys, "--scene", scene, "--scale", 0, *out)
    assert "there is no camera file" in refused(capsys, "--scene", scene, "--cameras", "gone.json", *out)
    (tmp_path / "page.xml").write_text("<html/>")
    assert "no Mitsuba scene" in refused(capsys, "--scene", tmp_path / "page.xml", *out)
    missing = written(tmp_path / "m", '<shape type="ply"><string name="filename" value="a.ply"/></shape>')
    assert "1 files are missing: a.ply" in refused(capsys, "--scene", missing, *out)
    assert "leave out --rooms" in refused(
        capsys, "bench", "run", "--scene", scene, "--rooms", 1, "--out", tmp_path / "r", to=app
    )
    assert not (tmp_path / "d").exists()
    assert not (tmp_path / "r").exists()


def test_converting_says_what_was_done_and_can_be_done_again(tmp_path, capsys):
    image(tmp_path / "old" / "a.png")
    texture = (
        '<texture type="bitmap" name="diffuseReflectance"><string name="filename" value="a.png"/></texture>'
    )
    look = '<lookAt origin="0,1,5" target="0,0,0" up="0,1,0"/>'
    body = (
        f'<sensor type="perspective"><transform name="toWorld">{look}</transform>'
        '<film type="ldrfilm"><integer name="width" value="64"/></film></sensor>'
        f'<shape type="cube"><bsdf type="phong">{texture}</bsdf></shape>'
        '<emitter type="constant"><spectrum name="radiance" value="2"/></emitter>'
    )
    (tmp_path / "old" / "LICENSE.txt").write_text("CC-BY")
    old = written(tmp_path / "old", body)
    assert run(app, ["convert", str(old), "--out", str(tmp_path / "new")]) == 0
    said = capsys.readouterr().out
    assert "old: y up" in said
    assert "warning: phong is diffuse and a GGX lobe" in said
    assert "a spectrum of 2 is grey" in said
    assert (tmp_path / "new/LICENSE.txt").read_text() == "CC-BY"
    assert json.loads((tmp_path / "new/room.json").read_text())["source"]["changes"]
    assert run(app, ["convert", str(tmp_path / "new/scene.xml"), "--out", str(tmp_path / "again")]) == 0
    assert "new: z up, 0 changes" in capsys.readouterr().out
    assert "is there already" in refused(capsys, "convert", old, "--out", tmp_path / "new", to=app)


@pytest.mark.parametrize(
    ("failure", "code", "says"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), 2, "cannot be written: No space left on device"),
        (KeyboardInterrupt(), 130, ""),
    ],
)
def test_a_conversion_appears_whole_or_not_at_all(scene, tmp_path, capsys, monkeypatch, failure, code, says):
    out = tmp_path / "out" / "new"
    out.parent.mkdir()

    def failing(*_: object) -> None:
        assert not out.exists()  # as it would be found after SIGKILL
        raise failure

    with monkeypatch.context() as patched:
        patched.setattr("gibench.generators.imported.room.write_scene_glb", failing)
        assert run(app, ["convert", str(scene), "--out", str(out)]) == code
    assert says in " ".join(capsys.readouterr().err.split())
    assert list(out.parent.iterdir()) == []
    out.mkdir()  # an empty folder will do as well
    assert run(app, ["convert", str(scene), "--out", str(out)]) == 0
    assert (out / "scene.xml").is_file()
    assert (out / "room.glb").is_file()
    assert list(out.parent.iterdir()) == [out]


def test_a_scene_without_a_place_for_cameras_does_not_stop_the_others(scene, tmp_path, capsys):
    flat = written(tmp_path / "flat", SQUARE + '<emitter type="constant"/>', version="3.0.0")
    words = [
        "--scene",
        str(flat),
        "--scene",
        str(scene),
        "--views",
        "1",
        *SMALL,
        "--out",
        str(tmp_path / "d"),
    ]
    assert run(make_app, words) == 0
    assert "left out      room 0: " in capsys.readouterr().out.replace("\n", " ")
    assert set(open_dataset(tmp_path / "d").frames["room"]) == {1}
    assert run(make_app, ["--scene", str(flat), "--views", "1", *SMALL, "--out", str(tmp_path / "e")]) == 2
    assert "no place for a camera" in capsys.readouterr().err


def test_an_open_scene_that_no_area_light_fits_in_does_not_stop_the_others(scene, tmp_path, capsys):
    """It has a camera of its own, so that nothing but the light asks for its free space."""
    look = '<lookat origin="0, -3, 2" target="0, 0, 0" up="0, 0, 1"/>'
    camera = f'<sensor type="perspective"><transform name="to_world">{look}</transform></sensor>'
    flat = written(tmp_path / "flat", camera + SQUARE + '<emitter type="constant"/>', version="3.0.0")
    words = ["--lighting", "area-light", "--views", "0", *SMALL, "--scene", str(flat)]
    assert run(make_app, [*words, "--scene", str(scene), "--out", str(tmp_path / "d")]) == 0
    manifest = read_manifest(tmp_path / "d")
    assert set(open_dataset(tmp_path / "d").frames["room"]) == {1}
    assert f"{flat}: no place for an area light; nothing is enclosed" in json.dumps(manifest)
    assert "left out      room 0: " in capsys.readouterr().out.replace("\n", " ")
    assert f"{flat}: no place for an area light" in refused(capsys, *words, "--out", tmp_path / "e")


def test_a_scene_that_mitsuba_refuses_is_a_mistake_of_its_author(tmp_path, capsys):
    bad = '<shape type="sphere"><bsdf type="diffuse"><float name="nobody" value="1"/></bsdf></shape>'
    camera = '<sensor type="perspective"><transform name="to_world"><translate z="5"/></transform></sensor>'
    file = written(tmp_path, camera + "\n" + bad, version="3.0.0")
    assert run(make_app, ["--scene", str(file), "--views", "0", *SMALL, "--out", str(tmp_path / "d")]) == 2
    assert "scene.xml:3: the bsdf diffuse has no property nobody: remove it" in " ".join(
        capsys.readouterr().err.split()
    )


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs links and pipes")
def test_licences_that_lead_elsewhere_are_not_copied(tmp_path, capsys):
    scene, secret = tmp_path / "scene", tmp_path / "secret"
    file = written(scene, '<sensor type="perspective"/><shape type="cube"/><emitter type="constant"/>')
    secret.mkdir()
    (secret / "id").write_text("a key")
    (scene / "terms.txt").write_text("CC-BY")
    (scene / "LICENSE").symlink_to("../secret/id")
    (scene / "LICENSE.all").symlink_to("../secret")
    (scene / "LICENSE.gone").symlink_to("nowhere")
    (scene / "LICENCE.md").symlink_to("terms.txt")  # stays in the folder
    os.mkfifo(scene / "LICENSE.pipe")
    assert run(app, ["convert", str(file), "--out", str(tmp_path / "new")]) == 0
    said = capsys.readouterr()
    for name in ("LICENSE", "LICENSE.pipe", "LICENSE.gone"):
        assert f"{name} beside the scene is no file of its folder, and was not copied" in said.out + said.err
    copied = {path.name: path for path in (tmp_path / "new").glob("LICEN*")}
    assert set(copied) == {"LICENCE.md"}
    assert not copied["LICENCE.md"].is_symlink()
    assert copied["LICENCE.md"].read_text() == "CC-BY"
    assert not any(b"a key" in path.read_bytes() for path in (tmp_path / "new").rglob("*") if path.is_file())
