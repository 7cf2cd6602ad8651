"""Who may import whom: the table of the house, checked on the source."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import gibench

PACKAGE = Path(gibench.__file__).parent

MAY_IMPORT = {
    "metrics": set(),
    "rendering": set(),
    "generators": {"rendering"},
    "datasets": {"rendering", "generators", "metrics"},
    "baselines": {"rendering", "datasets", "metrics"},
    "benchmarks": {"rendering", "generators", "metrics", "datasets", "baselines"},
    "stress": {"rendering", "generators", "metrics", "datasets", "baselines", "benchmarks"},
    "cli": {"rendering", "generators", "metrics", "datasets", "baselines", "benchmarks", "stress"},
}


def rooms():
    return sorted(p.name for p in PACKAGE.iterdir() if (p / "__init__.py").exists())


def imports(path):
    """Dotted names of what a file imports from gibench, relative imports resolved."""
    package = ("gibench", *path.relative_to(PACKAGE).parent.parts)
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            stem = ".".join(filter(None, (base, node.module)))
            yield from (f"{stem}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("room", rooms())
def test_no_import_runs_up_the_table(room):
    allowed = MAY_IMPORT[room] | {room, "errors", "gate", "llvm", "processes", "__version__"}
    for path in (PACKAGE / room).rglob("*.py"):
        for name in imports(path):
            parts = name.split(".")
            if parts[0] == "gibench" and len(parts) > 1:
                assert parts[1] in allowed, f"{path.relative_to(PACKAGE)} imports {name}"


@pytest.mark.parametrize("room", rooms())
def test_importing_a_room_loads_neither_mitsuba_nor_torch(room):
    code = f"import sys, gibench.{room}; print(sorted({{'mitsuba', 'drjit', 'torch', 'colour'}} & set(sys.modules)))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert result.stdout.strip() == "[]", result.stdout + result.stderr


def test_a_command_on_datasets_starts_without_what_builds_and_lights_rooms():
    """Each takes a third of a second to two, and every process of a run and every reader of a dataset would pay it."""
    slow = {"scipy", "skimage", "colour", "pandas", "mitsuba"}
    code = f"import sys, gibench.datasets.making, gibench.generators.rooms; print(sorted({slow} & set(sys.modules)))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert result.stdout.strip() == "[]", result.stdout + result.stderr


def test_what_networks_share_needs_no_renderer():
    room = PACKAGE / "baselines" / "training"
    allowed = ("gibench.metrics", "gibench.errors", "gibench.baselines.training")
    names = ["gibench.baselines.training"]
    for path in room.rglob("*.py"):
        names += (
            []
            if path.stem == "__init__"
            else [".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)]
        )
        for name in imports(path):
            assert name.startswith(allowed) or not name.startswith("gibench"), f"{path.name} imports {name}"
    code = f"import sys, {', '.join(names)}; print(sorted({{'mitsuba', 'drjit'}} & set(sys.modules)))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert result.stdout.strip() == "[]", result.stdout + result.stderr


def test_importing_a_module_needs_no_variant():
    modules = [
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")
        for path in sorted(PACKAGE.rglob("*.py"))
        if path.stem != "__main__"
    ]
    code = (
        f"import importlib, mitsuba\nfor m in {modules}: importlib.import_module(m)\nprint(mitsuba.variant())"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert result.stdout.strip() == "None", result.stdout + result.stderr


NOT_THE_FIELDS = (
    "LAST_WORDS",
    "MUTE",
    "_heard",
    "_hired",
    "_room_of_the_dead",
    "_telling",
    "dearest_within",
    "judge",
    "later",
    "only_so",
)
"""Names that say nothing to people of this field: no function, class, argument or variable is called so."""


def names_in(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
            yield node.name
        elif isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, ast.arg):
            yield node.arg


def test_names_are_the_fields():
    found = [
        f"{path.relative_to(PACKAGE)}: {name}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for name in sorted({*names_in(path), path.stem})
        if name in NOT_THE_FIELDS or name.endswith("_telling")
    ]
    assert found == []


def test_lights_are_sampled_in_one_place():
    """Methods and references share `rendering.light_sampling`; one that samples by itself has other noise than they."""
    own = {"light_sampling.py", "guide.py"}
    asks = {
        "portal_share.py"
    }  # for the densities of shares that it compares; its samples are those of the others
    for path in PACKAGE.rglob("*.py"):
        calls = {
            node.func.attr
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
        }
        found = calls & {"sample_emitter_direction", "pdf_emitter_direction"}
        if path.name in asks:
            found -= {"pdf_emitter_direction"}
        assert not found or path.name in own, f"{path.relative_to(PACKAGE)} calls {found}"


def test_processes_are_started_in_one_place():
    """`gibench.processes` says how one is heard, given up and ended; those of torch's loader are torch's."""
    for path in PACKAGE.rglob("*.py"):
        spawns = [
            node
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Attribute) and node.attr in ("get_context", "Process", "Popen", "fork")
            if isinstance(node.value, ast.Name) and node.value.id in ("multiprocessing", "subprocess", "os")
        ]
        assert not spawns or path.name == "processes.py", f"{path.relative_to(PACKAGE)} starts processes"


def test_torch_computes_where_the_variant_does():
    """Whether there is a GPU decides nothing by itself, or methods of one board would run on two devices."""
    for path in (PACKAGE / "baselines").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.IfExp) and "is_available" in ast.unparse(node.test):
                raise AssertionError(f"{path.relative_to(PACKAGE)}: {ast.unparse(node)}")
