"""What `docs/scenes.md` says of options and rules is what there is."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from gibench.cli import run
from gibench.cli.app import app, make_app
from gibench.datasets.recipes import Recipe
from gibench.generators.imported.analytic import MESHES
from gibench.generators.imported.images import MOST_PIXELS
from gibench.generators.imported.own_cameras import read_camera_file
from gibench.generators.imported.parsing import MOST_ELEMENTS, MOST_INCLUDES
from gibench.generators.imported.scene import import_scene
from gibench.generators.imported.shapes import MOST_SHAPES
from gibench.generators.imported.shipped import shipped
from gibench.generators.imported.survey import CLEARANCE
from gibench.generators.imported.upgrading import LEGACY, RULES

from .files import SQUARE, one, upgraded, written

PAGE = Path(__file__).parents[3] / "docs/scenes.md"

pytestmark = pytest.mark.skipif(not PAGE.exists(), reason="tests run away from the documentation")


def text() -> str:
    return PAGE.read_text("utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", text(), re.M | re.S)


def table(head: str) -> str:
    return text().split(f"| {head} |")[1].split("\n\n")[0]


def options(words: list[str], capsys) -> set[str]:
    assert run(make_app if words == ["make-dataset"] else app, [*words[1:], "--help"]) == 0
    return set(re.findall(r"--[a-z][a-z-]*", capsys.readouterr().out))


def test_every_command_is_understood(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    commands = [shlex.split(line, comments=True) for line in lines if not line.startswith("curl")]
    assert len(commands) == 5
    for words in commands:
        program = words[: {"make-dataset": 1, "gibench": 2}[words[0]]]
        if program == ["gibench", "bench"]:
            program = words[:3]
        asked = {word for word in words if word.startswith("--")}
        assert asked <= options(program, capsys), words


def test_the_options_and_the_keys_of_scenes_are_listed(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    listed = {
        o for line in table("option").splitlines() for o in re.findall(r"--[a-z][a-z-]*", line.split("|")[1])
    }
    own = {"--scene", "--up", "--scale", "--allow-missing", "--allow-outside", "--cameras", "--define"}
    assert listed == own
    assert own <= options(["make-dataset"], capsys)
    assert own - {"--cameras"} <= options(["gibench", "bench", "run"], capsys)
    assert own - {"--cameras", "--scene"} <= options(["gibench", "convert"], capsys)
    said = re.search(r"In a recipe they are (.*?)\. They hold", text(), re.S)
    assert said is not None
    keys = {re.match(r"\w+", word)[0] for word in re.findall(r"`([^`]+)`", said[1])}
    assert keys == {
        option.removeprefix("--").replace("-", "_") for option in own - {"--scene", "--define"}
    } | {
        "scenes",
        "parameters",
    }
    assert keys <= set(Recipe.model_fields)


def test_every_rule_is_in_the_table():
    named = {
        name for line in table("rule").splitlines()[2:] for name in re.findall(r"`(\w+)`", line.split("|")[1])
    }
    assert named == {rule.__name__ for rule in RULES}
    always = {rule.__name__ for rule in RULES} - {rule.__name__ for rule in LEGACY}
    assert {name for name in named if name in always} == always


def test_the_camera_file_is_one(tmp_path):
    (block,) = blocks("json")
    (tmp_path / "cameras.json").write_text(block)
    cameras = read_camera_file(tmp_path / "cameras.json", np.eye(4))
    assert len(cameras) == len(json.loads(block)) == 3
    for camera in cameras:  # all stand at the same place and look along −z
        np.testing.assert_allclose(camera.position, (0, 1.5, 4.9))
        assert np.subtract(camera.target, camera.position)[2] < 0


def test_the_distance_to_things_is_that_of_the_code():
    assert f"{CLEARANCE} m away" in " ".join(text().split())


def cells(row: str) -> list[str]:
    """Cells of a row of the table of what is read, replaced, left out and refused, by the row's first."""
    lines = [line for line in text().splitlines() if line.startswith(f"| {row} |")]
    assert len(lines) == 1, row
    return [cell.strip() for cell in lines[0].strip("|").split("|")]


def names(cell: str) -> set[str]:
    return set(re.findall(r"`(\w+)`", cell))


def test_what_is_said_to_be_replaced_is_what_the_rules_replace(tmp_path):
    """Every plugin of the table that Mitsuba 3 has not comes in, as another one; every one that is left out goes."""
    inner = '<bsdf type="diffuse"/>'
    inside = {
        "coating": inner,
        "roughcoating": inner,
        "mixturebsdf": '<string name="weights" value="1"/>' + inner,
    }
    for name in names(cells("materials")[2]):
        body = f'<shape type="sphere"><bsdf type="{name}">{inside.get(name, "")}</bsdf></shape>'
        root, changes = upgraded(tmp_path, body)
        assert name not in shipped()
        assert name not in {node.type for node in root.everything()}, name
        assert any(name in change.what for change in changes), name
    for name in names(cells("lights")[2]):
        root, changes = upgraded(tmp_path, f'<emitter type="{name}"/>{SQUARE}')
        assert one(root, "emitter").type in shipped()
        assert any(name in change.what for change in changes), name
    for name in names(cells("textures")[2]) - {"scale", "channel"}:
        body = f'<shape type="sphere"><bsdf type="diffuse"><texture type="{name}" name="reflectance"/></bsdf></shape>'
        root, changes = upgraded(tmp_path, body)
        assert name not in {node.type for node in root.everything()}, name
        assert any(name in change.what for change in changes), name
    for name in names(cells("media")[3]):
        body = f'<shape type="sphere"><{name} type="homogeneous"/></shape>'
        root, changes = upgraded(tmp_path, body, version="3.0.0")
        assert name not in {node.tag for node in root.everything()}
        assert [change.loss for change in changes] == [True]


def test_what_is_said_of_shapes_is_what_the_import_makes(tmp_path):
    files = {"sdfgrid", "obj", "heightfield", "hair"}  # see test_old_shapes and test_room
    replaced = names(cells("shapes")[2]) - files - {"instance", "shapegroup", "merge"}
    assert replaced == set(MESHES)
    for name in replaced:
        scene = import_scene(written(tmp_path, f'<shape type="{name}"/>', version="3.0.0"))
        assert one(scene.tree.root, "shape").type == "ply"


def test_the_limits_are_those_of_the_code():
    said = " ".join(cells("files")[4].replace("a million", "1000000").split())
    for limit in (MOST_INCLUDES, MOST_ELEMENTS, MOST_SHAPES):
        assert str(limit) in said, limit
    assert f"{MOST_PIXELS // 10**6} million pixels" in cells("textures")[4]
