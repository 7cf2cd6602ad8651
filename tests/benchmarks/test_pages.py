"""What `docs/benchmark.md` says of options and columns is what there is."""

import re
import shlex
from pathlib import Path

import pytest

from gibench.benchmarks.track import load_track
from gibench.cli import run
from gibench.cli.app import app

PAGE = Path(__file__).parents[2] / "docs/benchmark.md"

pytestmark = pytest.mark.skipif(not PAGE.exists(), reason="tests run away from the documentation")


def offered(command: str, capsys, monkeypatch) -> set[str]:
    monkeypatch.setenv("COLUMNS", "120")
    assert run(app, ["bench", command, "--help"]) == 0
    return set(re.findall(r"--[a-z][a-z-]*", capsys.readouterr().out)) - {"--help"}


def test_the_table_of_options_is_that_of_the_help(capsys, monkeypatch):
    table = PAGE.read_text("utf-8").split("| option of `run` |")[1].split("\n\n")[0]
    listed = {o for line in table.splitlines() for o in re.findall(r"--[a-z][a-z-]*", line.split("|")[1])}
    assert listed == offered("run", capsys, monkeypatch)


def test_every_command_is_understood(capsys, monkeypatch):
    blocks = re.findall(r"^```sh\n(.*?)^```$", PAGE.read_text("utf-8"), re.M | re.S)
    commands = [shlex.split(line, comments=True) for block in blocks for line in block.splitlines()]
    assert len(commands) >= 4
    for program, group, command, *rest in commands:
        assert (program, group) == ("gibench", "bench")
        assert {word for word in rest if word.startswith("--")} <= offered(command, capsys, monkeypatch)
        if "--preset" in rest:
            load_track(rest[rest.index("--track") + 1]).preset(rest[rest.index("--preset") + 1])


def test_the_columns_of_the_tables_are_listed(results):
    for name in ("results", "times", "stages", "frames", "sequences", "floor"):
        (row,) = [line for line in PAGE.read_text("utf-8").splitlines() if line.startswith(f"| `{name}` ")]
        assert re.findall(r"`(\w+)`", row.split("|")[3]) == list(getattr(results, name).columns)
