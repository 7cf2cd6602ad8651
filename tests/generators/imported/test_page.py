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
from gibench.generators.imported.own_cameras import read_camera_file
from gibench.generators.imported.survey import CLEARANCE
from gibench.generators.imported.upgrading import LEGACY, RULES

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
    assert len(cameras) == len(json.loads(block)) == 2
    for camera in cameras:  # both stand at the same place and look along −z
        np.testing.assert_allclose(camera.position, (0, 1.5, 4.9))
        assert np.subtract(camera.target, camera.position)[2] < 0


def test_the_distance_to_things_is_that_of_the_code():
    assert f"{CLEARANCE} m away" in " ".join(text().split())
