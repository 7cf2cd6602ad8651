import json
import os
import subprocess
import sys

import pytest
from PIL import Image

from gibench import __version__
from gibench.cli import dataset as commands
from gibench.cli import doctor, progress, run
from gibench.cli.app import app, make_app
from gibench.datasets.making import Progress, make
from tests.datasets.fakes import fake_work, tiny


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    root = tmp_path_factory.mktemp("cli") / "d"
    make(root, tiny(2), command="make-dataset --rooms 2", work=fake_work(root, tiny(2)))
    return root


def test_help_loads_nothing_heavy():
    code = (
        "import sys\nfrom gibench.cli import run\nfrom gibench.cli.app import make_app\n"
        "assert run(make_app, ['--help']) == 0\n"
        "heavy = {'mitsuba', 'drjit', 'torch', 'numpy', 'pandas', 'pydantic', 'PIL', 'OpenEXR', 'scipy'}\n"
        "print('loaded:', *sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "loaded:"
    assert "--rooms" in done.stdout
    assert "--dry-run" in done.stdout


def test_version(capsys):
    assert run(app, ["--version"]) == 0
    assert capsys.readouterr().out.strip() == __version__


def test_verify_says_that_all_is_well_or_names_every_broken_file(made, capsys, tmp_path):
    assert run(app, ["dataset", "verify", str(made)]) == 0
    assert "is whole" in capsys.readouterr().out
    broken = made / "rooms/000001/frames/0001.exr"
    content = broken.read_bytes()
    broken.write_bytes(content[:-1])
    missing = made / "rooms/000000/scene.xml"
    text = missing.read_text()
    missing.unlink()
    assert run(app, ["dataset", "verify", str(made)]) == 1
    said = capsys.readouterr()
    assert str(broken) in said.out
    assert str(missing) in said.out
    assert "in 2 files" in said.err
    broken.write_bytes(content)
    missing.write_text(text)


def test_info_fits_a_narrow_terminal(made, capsys):
    assert run(app, ["dataset", "info", str(made)]) == 0
    said = capsys.readouterr().out
    for fact in ("rooms         2", "frames        4", "16x12, 4 spp", "CC0-1.0", "make-dataset --rooms 2"):
        assert fact in said


def test_preview_draws_a_sheet_or_a_frame(made, capsys, tmp_path):
    assert run(app, ["dataset", "preview", str(made), "--out", str(tmp_path / "s.png")]) == 0
    assert run(app, ["dataset", "preview", str(made), "--frame", "3", "--out", str(tmp_path / "f.png")]) == 0
    assert Image.open(tmp_path / "s.png").width > 400
    assert Image.open(tmp_path / "f.png").width > 1000
    assert run(app, ["dataset", "preview", str(made), "--frame", "4"]) == 2
    assert "there is no frame 4" in capsys.readouterr().err
    assert run(app, ["dataset", "preview", str(made), "--out", "/proc/s.png"]) == 1


def test_the_recorded_command_makes_the_same_again(monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr("gibench.cli.making.make_and_print", lambda *given: asked.append(given))
    words = ["--preset", "smoke", "--seed", "5", "--resolution", "32x24", "--kind", "office,living"]
    words += [
        "--channels",
        "color,surface",
        "--spp",
        "8",
        "--workers",
        "2",
        "--out",
        str(tmp_path / "my data"),
    ]
    assert run(make_app, words) == 0
    root, recipe, variant, workers, command, cluster = asked[0]
    assert cluster is None
    assert (root, variant, workers) == (tmp_path / "my data", "auto", 2)
    assert (recipe.seed, recipe.resolution, recipe.kinds, recipe.spp) == (
        5,
        (32, 24),
        ("living", "office"),
        8,
    )
    import shlex

    assert run(make_app, shlex.split(command)[1:]) == 0
    assert asked[1] == asked[0]


def test_the_folder_is_named_after_the_recipe(monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr("gibench.cli.making.make_and_print", lambda *given: asked.append(str(given[0])))
    (tmp_path / "mine.toml").write_text("rooms = 1\n")
    for words in ([], ["--preset", "paper"], ["--recipe", str(tmp_path / "mine.toml")]):
        assert run(make_app, words) == 0
    assert asked == ["data/small", "data/paper", "data/mine"]
    assert commands.app is not None


def test_what_goes_wrong_inside_gibench_keeps_its_traceback_when_asked_for(monkeypatch, tmp_path):
    from gibench.datasets.errors import DatasetError

    monkeypatch.setenv("GIBENCH_DEBUG", "1")
    with pytest.raises(DatasetError):
        run(app, ["dataset", "info", str(tmp_path)])


def test_ctrl_c_outside_of_making_is_no_traceback(monkeypatch, capsys, tmp_path):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("gibench.cli.making.make_and_print", interrupted)
    assert run(make_app, ["--out", str(tmp_path)]) == 130


def test_doctor_says_what_it_found(capsys):
    assert run(app, ["doctor"]) == 0
    said = capsys.readouterr().out
    for name in (
        "variant",
        "LLVM",
        "GPU",
        "denoiser",
        "cores",
        "memory",
        "Python",
        "numpy",
        "LPIPS",
        "to mend",
    ):
        assert name in said
    paths = [line for line in said.splitlines() if "/" in line]
    assert all(len(line) <= 80 for line in said.splitlines() if line not in paths)


def test_doctor_keeps_the_commands_that_mend_in_one_piece(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("GIBENCH_CACHE", str(tmp_path))
    assert run(app, ["doctor"]) == 0
    said = capsys.readouterr().out
    assert "LPIPS weights missing\n" in said
    assert "the LPIPS weights are missing, which only LPIPS needs:\n" in said
    assert " " * 14 + "python -m gibench.metrics.lpips_weights\n" in said


def test_doctor_for_programs(capsys):
    assert run(app, ["doctor", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["variant"] in ("cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb")
    assert facts["machine"]["cores"] == os.cpu_count()
    assert isinstance(facts["notes"], list)


def test_doctor_survives_a_renderer_that_aborts(monkeypatch):
    monkeypatch.setattr(doctor, "_PROBE", "import os; os.abort()")
    facts = doctor.examine()
    assert facts["variant"] is None
    assert "ended with code -6" in facts["problem"]
    assert any("pip install" in note for note in facts["notes"])


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.04, "0.0 s"), (59.4, "59.4 s"), (90, "2 min"), (3600, "1 h 00 min"), (11100, "3 h 05 min")],
)
def test_durations(seconds, text):
    assert progress.duration(seconds) == text


@pytest.mark.parametrize(
    ("number", "unit", "text"), [(0, "B", "0 B"), (999, "B", "999 B"), (1.27e6, "paths/s", "1.27 Mpaths/s")]
)
def test_amounts(number, unit, text):
    assert progress.amount(number, unit) == text


def test_progress_on_no_terminal_is_plain_lines(monkeypatch, capsys):
    monkeypatch.setattr(progress, "QUIET_SECONDS", 0.0)
    with progress.making() as show:
        show(Progress(rooms=200, frames=800, rooms_done=20, frames_done=81, frames_before=40, paths=10**9))
    said = capsys.readouterr().err
    assert said.startswith("rooms 20/200 frames 81/800, ")
    assert "paths/s" in said
    assert said.rstrip().endswith("left")
    assert "\x1b" not in said


def test_progress_fits_eighty_columns(monkeypatch):
    import io

    from rich.console import Console

    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=80, color_system=None)
    monkeypatch.setattr(progress, "Console", lambda stderr: console)
    with progress.making() as show:
        show(Progress(rooms=200, frames=4000, rooms_done=199, frames_done=3999, paths=10**12))
    lines = [line for part in screen.getvalue().split("\n") for line in part.split("\r")]
    shown = [line for line in lines if "3999/4000" in line]
    assert shown
    assert "rooms 199/200" in shown[0]
    assert "paths/s" in shown[0]
