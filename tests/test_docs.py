"""What the documentation says is run: its commands, its Python, its recipes for contributors, its links and tables."""

from __future__ import annotations

import csv
import importlib.util
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gibench import metrics
from gibench.cli import run
from gibench.cli.app import app, make_app
from gibench.datasets import load_preset, load_recipe, open_dataset
from gibench.datasets.manifest import COLUMNS
from gibench.errors import GibenchError
from gibench.generators.furniture import FAMILIES, Family
from gibench.generators.layouts import dressing
from gibench.generators.materials import MATERIALS, SLOTS, MaterialFamily, SlotRule
from gibench.generators.rooms import sample_room
from gibench.metrics import registry
from gibench.stress.registry import all_cases
from gibench.stress.running import Report
from tests.clusters import batch_job, killed, wait_until
from tests.generators import test_furniture as furniture_tests
from tests.generators.materials import test_families as material_tests
from tests.test_house import MAY_IMPORT

ROOT = Path(__file__).parent.parent
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")),
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs/results").glob("*.md")),
]
PROGRAMS = {"gibench": "main", "make-dataset": "make_dataset"}

pytestmark = pytest.mark.skipif(not (ROOT / "docs").is_dir(), reason="tests run away from the documentation")


def blocks(page: str, language: str) -> list[str]:
    """Contents of the fenced blocks of a page."""
    return re.findall(rf"^```{language}\n(.*?)^```$", (ROOT / page).read_text("utf-8"), re.M | re.S)


def command_lines(page: str) -> list[list[str]]:
    """Words of every command in the `sh` blocks of a page, without comments."""
    lines = [line for block in blocks(page, "sh") for line in block.splitlines()]
    commands = [command for line in lines for command in line.split("&&")]
    return [words for words in (shlex.split(command, comments=True) for command in commands) if words]


def commands_of(program: str) -> list[list[str]]:
    pages = ("README.md", "docs/datasets.md", "docs/rooms.md", "docs/cluster.md")
    asked = [words for page in pages for words in command_lines(page) if words[0] == program]
    return [words for words in asked if "--cluster" not in words]


def started(words: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command as a user does, with the console script where gibench is installed."""
    script = Path(sys.executable).with_name(words[0])
    code = f"from gibench.cli import {PROGRAMS[words[0]]} as main\nif __name__ == '__main__':\n    main()"
    program = [str(script)] if script.exists() else [sys.executable, "-c", code]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    return subprocess.run(
        [*program, *words[1:]], cwd=folder, env=environment, capture_output=True, text=True, timeout=900
    )


@pytest.fixture(scope="session")
def home(tmp_path_factory) -> Path:
    """A folder in which `data/rooms` is a small dataset, and the recipe of the documentation is `mine.toml`."""
    folder = tmp_path_factory.mktemp("docs")
    done = started(["make-dataset", "--preset", "smoke", "--out", "data/rooms"], folder)
    assert done.returncode == 0, done.stderr
    (folder / "mine.toml").write_text(blocks("docs/datasets.md", "toml")[0], "utf-8")
    return folder


@pytest.mark.parametrize("words", commands_of("gibench"), ids=shlex.join)
def test_commands_do_what_they_say(home, words):
    done = started(words, home)
    assert done.returncode == 0, done.stderr
    assert done.stdout


@pytest.mark.parametrize("words", commands_of("make-dataset"), ids=shlex.join)
def test_commands_that_make_datasets_are_understood(home, words, monkeypatch):
    """The recipe that each resolves to; making them all would take hours."""
    asked = []
    monkeypatch.chdir(home)
    for target in ("make_and_print", "dry_run"):
        monkeypatch.setattr(f"gibench.cli.making.{target}", lambda *given: asked.append(given))
    assert run(make_app, words[1:]) == 0
    recipe = next(value for value in asked[0] if hasattr(value, "rooms"))
    if "--rooms" in words:
        assert recipe.rooms == int(words[words.index("--rooms") + 1])
    if "--preset" in words:
        preset = load_preset(words[words.index("--preset") + 1])
        assert recipe.identity() == preset.identity()
    if "--out" in words:
        assert asked[0][0] == Path(words[words.index("--out") + 1])


def test_commands_of_the_page_on_clusters_are_understood(tmp_path, monkeypatch):
    """Those of Dask by the options that it has; the benchmark by what it asks for."""
    distributed = pytest.importorskip("distributed.cli.dask_worker")
    from distributed.cli import dask_scheduler, dask_ssh

    known = {
        "worker": distributed.main,
        "scheduler": dask_scheduler.main,
        "ssh": dask_ssh.main,
    }
    said = re.findall(r"dask (worker|scheduler|ssh) ([^`\n]*)", page("cluster"))
    assert {name for name, _ in said} == set(known)
    for name, words in said:
        options = {option for parameter in known[name].params for option in parameter.opts}
        assert set(re.findall(r"--[a-z-]+", words)) <= options, (name, words)

    asked = []

    def instead(root, order, **_):
        asked.append((str(root), order.cluster))
        raise GibenchError("asked")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("gibench.benchmarks.running.run", instead)
    for words in command_lines("docs/cluster.md"):
        if words[:3] == ["gibench", "bench", "run"]:
            run(app, words[1:])
            assert asked[-1] == (words[words.index("--out") + 1], words[words.index("--cluster") + 1])
    assert asked


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="needs process groups")
@pytest.mark.parametrize("system", ["Slurm", "PBS"])
def test_batch_jobs_of_the_page_on_clusters_run_as_they_stand(system, tmp_path, monkeypatch):
    """Up to the last command, by what that asks for. Tests of clusters work on such a job's workers."""
    distributed = pytest.importorskip("distributed")

    asked = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("gibench.cli.making.make_and_print", lambda *given: asked.append(given))
    job = batch_job(system, tmp_path)
    try:
        wait_until((tmp_path / "asked").exists)
        assert run(make_app, (tmp_path / "asked").read_text().splitlines()) == 0
        root, recipe, *_, file = asked[0]
        assert (root, recipe.rooms) == (Path("rooms"), 1500)
        with distributed.Client(scheduler_file=file, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)
            threads = {worker["nthreads"] for worker in client.scheduler_info()["workers"].values()}
            assert threads == {os.cpu_count() or 1}
    finally:
        killed(job)


@pytest.mark.parametrize(
    "words", [*command_lines("docs/stability.md"), *command_lines("docs/presets.md")], ids=shlex.join
)
def test_commands_of_the_stress_suite_are_understood(words, tmp_path, monkeypatch):
    """Running the cases is what tests/stress does."""
    asked = []

    def instead(**given):
        asked.append(given)
        return Report((), (), 0, 0.0)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("gibench.stress.running.run", instead)
    assert run(app, words[1:]) == 0
    assert asked[0]["quick"] == ("--quick" in words)
    assert (tmp_path / words[words.index("--out") + 1] / "stress.csv").is_file()


def test_the_table_of_the_stress_suite_is_that_of_its_cases():
    names = set(re.findall(r"^\| ([^|]+) \| [^|]+ \|(?: [^|]+ \|){6}$", page("stability"), re.M))
    assert names - {"case", "---"} == {case.name for case in all_cases()}


def test_the_tables_of_the_presets_are_the_curve_and_the_recipes():
    with open(ROOT / "docs/stability/speed-furnished-room.csv", newline="") as file:
        measured = {(row["setting"], row["spp"]): row for row in csv.DictReader(file)}
    table = page("presets").split("| samples |")[1].split("\n\n")[0].splitlines()[2:]
    settings = ("stratified", "guided", "stratified, denoised", "guided, denoised")
    for line in table:
        spp, *said = (cell.strip() for cell in line.split("|")[1:-1])
        rows = [measured[setting, spp] for setting in settings]
        numbers = [float(row[column]) for column in ("relmse", "seconds") for row in rows]
        assert [float(cell) for cell in said] == pytest.approx(numbers, rel=0.05)
    for name, (samples, denoised) in {
        name: (int(spp), how == "denoised")
        for name, spp, how in re.findall(r"^\| `(\w+)` \| (\d+), (\w+) \|", page("presets"), re.M)
    }.items():
        assert (load_preset(name).spp, load_preset(name).denoise) == (samples, denoised)


def test_the_recipe_shows_the_defaults(home):
    assert load_recipe(home / "mine.toml") == load_preset("small")


def test_what_the_table_of_options_says_of_the_default(home):
    recipe = load_preset("small")
    said = re.search(r'preset "small": (\d+)×(\d+), (\d+) samples, denoised, (\d+) views', page("datasets"))
    assert said is not None
    assert [*recipe.resolution, recipe.spp, recipe.views] == [int(number) for number in said.groups()]
    assert recipe.denoise


def page(name: str) -> str:
    return (ROOT / f"docs/{name}.md").read_text("utf-8")


def python_blocks() -> list[tuple[str, str]]:
    """Every block, apart from those that are files of a package, which begin with their path."""
    return [
        (str(path.relative_to(ROOT)), block)
        for path in PAGES
        for block in blocks(str(path.relative_to(ROOT)), "python")
        if not re.match(r"# \S+\.py\n", block)
    ]


@pytest.mark.parametrize(("where", "block"), python_blocks(), ids=lambda value: value.splitlines()[0])
def test_python_runs(home, where, block, monkeypatch):
    if "import torch" in block:
        pytest.importorskip("torch")
    monkeypatch.chdir(home)
    if importlib.util.find_spec("torch") is None:
        block = "\n".join(line for line in block.splitlines() if "torch(" not in line)
    reference = open_dataset("data/rooms")[0]["color"]
    exec(compile(block, where, "exec"), {"ref": reference, "pred": reference * np.float32(1.1)})


def added(home: Path, path: str, monkeypatch: pytest.MonkeyPatch, where: str = "docs/rooms.md"):
    """The module that a page tells contributors to write, under the name that it would have."""
    (text,) = [block for block in blocks(where, "python") if block.startswith(f"# {path}\n")]
    name = path.removesuffix(".py").replace("/", ".")
    file = home / Path(path).name
    file.write_text(text, "utf-8")
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, name, module)
    spec.loader.exec_module(module)
    return module


def test_a_new_piece_of_furniture_and_a_new_material_reach_a_room(home, monkeypatch):
    added(home, "gibench/generators/furniture/candle.py", monkeypatch)
    monkeypatch.setitem(FAMILIES, "candle", Family("candle", "surface"))
    assert '`Family("candle", "surface")`' in page("rooms")
    candles = furniture_tests.variants("candle")
    furniture_tests.test_every_part_is_a_closed_solid_of_a_known_slot(candles)
    furniture_tests.test_textures_are_metric(candles)
    furniture_tests.test_the_bounding_box_is_the_one_asked_for(candles)
    furniture_tests.test_pieces_stand_hang_and_lie_where_their_frame_says("candle", candles)

    cork = added(home, "gibench/generators/materials/cork.py", monkeypatch)
    monkeypatch.setitem(MATERIALS, "cork", MaterialFamily(cork.cork, cork.sample_cork))
    material_tests.test_parameters_rebuild_the_material_through_json("cork")
    material_tests.test_textures_are_small_bytes_of_known_size_and_sane_reflectance("cork")
    material_tests.test_textures_have_no_seam("cork")
    material_tests.test_a_fixed_parameter_wins_and_leaves_the_others("cork")
    material_tests.test_unknown_parameters_are_refused("cork")

    for carrier in dressing.SMALL_THINGS:
        monkeypatch.setitem(dressing.SMALL_THINGS, carrier, {"candle": 1.0})
    floor = SLOTS["floor"]
    monkeypatch.setitem(SLOTS, "floor", SlotRule({"cork": 1.0}, floor.luminance, floor.alpha))
    rooms = [sample_room(0, index, kind="office", environment="none", views=1) for index in range(3)]
    assert "candle" in {thing.family for room in rooms for thing in room.objects}
    assert all("cork" in {m.family for m in room.materials.values()} for room in rooms)


def test_a_new_metric_is_one_like_the_others(tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "METRICS", dict(registry.METRICS))
    module = added(tmp_path, "gibench/metrics/log_error.py", monkeypatch, "docs/metrics.md")
    assert "from gibench.metrics.log_error import log_error as log_error" in page("metrics")
    ref = np.random.default_rng(0).random((4, 5, 3))
    twice = 2 * ref + module.EPSILON
    assert metrics.evaluate(twice, ref, metrics=["log_error"])["log_error"] == pytest.approx(np.log(2))
    np.testing.assert_allclose(metrics.metric("log_error")(ref, twice, map=True), np.log(2))


def rows(text: str, first: str) -> dict[str, set[str]]:
    """Words in code type in the second column of the table whose head begins with `first`, by its first column."""
    table = text.split(f"| {first} |")[1].split("\n\n")[0].splitlines()[2:]
    return {line.split("|")[1].strip(): set(re.findall(r"`(\w+)`", line.split("|")[2])) for line in table}


def test_tables_of_furniture_and_slots_are_complete():
    by_mount: dict[str, set[str]] = {}
    for family in FAMILIES.values():
        by_mount.setdefault(family.mount, set()).add(family.name)
    assert rows(page("rooms"), "mount") == by_mount
    assert set.union(*rows(page("rooms"), "slots of").values()) == set(SLOTS)


def test_the_thresholds_of_views_are_those_of_the_code():
    from gibench.generators import cameras, lighting, rooms, view_checks

    said = " ".join(page("rooms").split())
    low, high = view_checks.MEAN_DEPTH
    columns, lines = view_checks.GRID
    near, far = (round(np.degrees(angle)) for angle in cameras.FOV)
    for fact in (
        f"{columns} × {lines} rays",
        f"more than {100 * view_checks.OUTSIDE_SHARE:.0f} % of its rays",
        f"nearer than {view_checks.NEAREST} m",
        f"outside {low} to {high:.0f} m",
        f"below {100 * view_checks.DEPTH_SPREAD:.0f} % of its mean",
        f"fewer than {view_checks.OBJECTS} things",
        f"{cameras.HEIGHTS[0]} to {cameras.HEIGHTS[1]} m high",
        f"field of view of {near}° to {far}°",
        f"fewer than {rooms.LEAST_THINGS} things",
        f"less than {rooms.LEAST_FREE} m² of floor",
        f"up to {rooms.TRIES} times",
        "{:.0f} to {:.0f} lm a bulb".format(*lighting.BULB_LUMENS),
        "{:.0f} to {:.0f} lm a room".format(*lighting.ROOM_LUMENS),
    ):
        assert fact in said
    assert view_checks.LARGEST_SHARE == rooms.GLOSSY_SHARE == 0.5  # "half"


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_and_pictures_exist(path):
    targets = re.findall(r"\]\(([^)#\s]+)[^)]*\)", path.read_text("utf-8"))
    missing = [t for t in targets if "://" not in t and not (path.parent / t).exists()]
    assert missing == []


def test_contributors_are_told_what_holds_the_house_together():
    """The table of who may import whom is the one that is enforced."""
    table = page("contributing").split("| folder of `gibench/` |")[1].split("\n\n")[0].splitlines()[2:]
    listed = {line.split("|")[1].strip(" `"): line.split("|")[3] for line in table}
    assert set(listed) == set(MAY_IMPORT)
    for room in ("rendering", "generators", "baselines"):
        assert set(re.findall(r"`(\w+)`", listed[room])) == MAY_IMPORT[room]


def test_every_page_is_in_the_site():
    listed = set(re.findall(r"[\w/-]+\.md", (ROOT / "mkdocs.yml").read_text("utf-8")))
    there = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")}
    assert listed == there


def test_results_are_pages_their_figures_and_the_leaderboards():
    """All else of a board is packed by `gibench bench report --archive`: it would fill the repository."""
    folder = ROOT / "docs/results"
    files = {path.resolve() for path in folder.rglob("*") if path.is_file()}
    assert sum(path.stat().st_size for path in files) <= 3_000_000
    pages = sorted(folder.glob("*.md"))
    shown = {
        (folder / target).resolve()
        for path in pages
        for target in re.findall(r"\]\(([^)#\s]+)", path.read_text("utf-8"))
    }
    assert files - shown == {(folder / "README.md").resolve()}  # every other page is linked to


def test_the_table_of_options_is_that_of_the_help(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    assert run(make_app, ["--help"]) == 0
    offered = set(re.findall(r"--[a-z][a-z-]*", capsys.readouterr().out)) - {"--help"}
    table = page("datasets").split("| option |")[1].split("\n\n")[0]
    listed = {
        option for line in table.splitlines() for option in re.findall(r"--[a-z][a-z-]*", line.split("|")[1])
    }
    assert listed == offered


def test_every_column_of_the_table_of_frames_is_listed():
    listed = page("datasets").split("The columns of `frames.parquet`:")[1].split("\n\n")[0]
    middles = {"camera_y", "target_y", "up_y"}  # "`camera_x` … `camera_z`"
    assert set(re.findall(r"`(\w+)`", listed)) - {"color"} == set(COLUMNS) - middles


def test_what_the_readme_says_of_installing_is_what_ci_does():
    """The same words in the same order; CI may say less (-q) and runs the smallest preset."""
    script = (ROOT / ".ci/run").read_text("utf-8").replace("pip install -q", "pip install")
    asked = [line.split("#")[0].strip() for block in blocks("README.md", "sh") for line in block.splitlines()]
    test = next(line for line in asked if line.endswith("pytest"))
    assert test in script.splitlines()
    for line in asked:
        for command in line.split("&&"):
            assert re.search(rf"(^|&& ){re.escape(command.split()[0])} ", script, re.M) or "pytest" in command
