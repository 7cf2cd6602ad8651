"""Every mistake ends with one line that says what to do, exit code 2, and nothing left behind."""

import re

import pytest

from gibench.cli import run
from gibench.cli.app import app, make_app


def refused(capsys, *arguments: str, to=make_app, code: int = 2) -> str:
    assert run(to, [str(argument) for argument in arguments]) == code
    said = capsys.readouterr()
    assert said.err.startswith("error: ")
    assert said.err.count("\n") == 1
    assert "Traceback" not in said.err
    return said.err


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--rooms", "0"], r"--rooms: 0 is not allowed; allowed is an integer from 1"),
        (["--rooms", "-3"], r"--rooms: -3 is not allowed"),
        (["--rooms", "many"], r"--rooms.*integer"),
        (["--views", "0"], r"--views: 0 is not allowed"),
        (["--resolution", "wide"], r"--resolution: 'wide' is no resolution; write WIDTHxHEIGHT"),
        (["--resolution", "0x10"], r"--resolution: \(0, 10\) is not allowed; allowed is two integers"),
        (["--resolution", "256x"], r"--resolution: '256x' is no resolution"),
        (["--spp", "0"], r"--spp: 0 is not allowed"),
        (["--error", "0"], r"--error: 0.0 is not allowed; allowed is a number between 0 and 1"),
        (["--spp", "4", "--error", "0.1"], r"spp and error are both set"),
        (["--seed", "-1"], r"--seed: -1 is not allowed"),
        (["--preset", "smal"], r"no preset 'smal'; did you mean 'small'"),
        (["--preset", "small", "--recipe", "x.toml"], r"--preset and --recipe exclude each other"),
        (["--recipe", "/nowhere.toml"], r"recipe /nowhere.toml cannot be read: No such file"),
        (["--kind", "bed-room"], r"--kind: no kind 'bed-room'; did you mean 'bedroom'"),
        (["--kind", ","], r"--kind: ',' names nothing"),
        (["--channels", "surfaces"], r"--channels: .*'surfaces'.*did you mean surface"),
        (["--variant", "cuda_rgb"], r"--variant: no variant 'cuda_rgb'; did you mean 'cuda_ad_rgb'"),
        (["--workers", "0"], r"--workers: 0 is not allowed; allowed is an integer from 1"),
        (["--romms", "3"], r"No such option.*--romms"),
    ],
)
def test_wrong_options(capsys, tmp_path, arguments, says):
    assert re.search(says, refused(capsys, "--out", tmp_path / "d", *arguments))
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_recipe_is_named_with_file_and_key(capsys, tmp_path):
    (tmp_path / "mine.toml").write_text('views = "two"\n')
    said = refused(capsys, "--recipe", tmp_path / "mine.toml", "--out", tmp_path / "d")
    assert re.search(r"mine\.toml: views: 'two' is not allowed; allowed is an integer from 1", said)


def test_an_environment_that_is_missing(capsys, tmp_path):
    (tmp_path / "mine.toml").write_text('environment = "sky.hdr"\n')
    said = refused(capsys, "--recipe", tmp_path / "mine.toml", "--out", tmp_path / "d")
    assert re.search(r"mine\.toml: environment: there is no file .*/sky\.hdr", said)


def test_folders_that_cannot_be_used(capsys, tmp_path):
    (tmp_path / "thesis.tex").touch()
    assert "holds files but no dataset" in refused(capsys, "--rooms", 1, "--out", tmp_path)
    assert "under a file" in refused(capsys, "--rooms", 1, "--out", tmp_path / "thesis.tex" / "d")
    assert "cannot be written" in refused(capsys, "--rooms", 1, "--out", "/proc/d")


@pytest.mark.parametrize("command", ["verify", "info", "preview"])
def test_what_is_no_dataset(capsys, tmp_path, command):
    said = refused(capsys, "dataset", command, tmp_path, to=app)
    assert "is no dataset: it has no readable dataset.json" in said


def test_unknown_commands(capsys):
    assert "No such command" in refused(capsys, "dataset", "mak", to=app)
