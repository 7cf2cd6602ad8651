"""Which code made a result: versions, and a digest of the sources that a method's implementation imports.

A method that is edited makes new results, without its version having to change; the results of all others stay.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import gibench
from gibench.benchmarks.registry import Found

#: Of gibench itself, what decides what a method predicts. Scenes enter a result by their content.
DECIDING = ("gibench.rendering", "gibench.baselines")


def code_version(found: Found) -> dict[str, Any]:
    """Keys: gibench, package (name and version), sources (16 hexadecimal digits)."""
    module = found.method.implementation.partition(":")[0]
    content = hashlib.sha256()
    for name, file in sorted(sources(module).items()):
        content.update(name.encode() + b"\0" + hashlib.sha256(file.read_bytes()).digest())
    return {
        "gibench": gibench.__version__,
        "package": f"{found.package} {found.version}".strip(),
        "sources": content.hexdigest()[:16],
    }


def sources(module: str) -> dict[str, Path]:
    """Files that a module and what it imports consist of, by module: of its own package and of `DECIDING`.

    Nothing is imported; imports inside functions count, those for type checkers do not.
    """
    own = module.partition(".")[0]
    found: dict[str, Path] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        file = _file(name)
        if name in found or file is None:
            continue
        found[name] = file
        for imported in _imports(name, file):
            top = imported.partition(".")[0]
            ours = imported.startswith(tuple(f"{part}." for part in DECIDING)) or imported in DECIDING
            if ours if top == "gibench" else top == own:
                waiting.append(imported)
    return found


@cache
def _top(name: str) -> Path | None:
    """The folder of a top-level package, or the file of a top-level module."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return None
    if spec is None:
        return None
    if spec.submodule_search_locations:
        return Path(next(iter(spec.submodule_search_locations)))
    return Path(spec.origin) if spec.origin and spec.origin.endswith(".py") else None


def _file(name: str) -> Path | None:
    top, *rest = name.split(".")
    place = _top(top)
    if place is None or place.is_file():
        return None if rest else place
    place = place.joinpath(*rest)
    for candidate in (place.with_name(f"{place.name}.py") if rest else place, place / "__init__.py"):
        if candidate.is_file():
            return candidate
    return None


@cache
def _imports(name: str, file: Path) -> tuple[str, ...]:
    """Dotted names that may be modules, and the packages that they lie in."""
    package = name.split(".") if file.name == "__init__.py" else name.split(".")[:-1]
    names: set[str] = set()
    for node in _statements(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            stem = ".".join([*base, *([node.module] if node.module else [])])
            names.update([stem, *(f"{stem}.{alias.name}" for alias in node.names)])
    return tuple({".".join(n.split(".")[:k]) for n in names for k in range(1, n.count(".") + 2)} - {""})


def _statements(tree: ast.AST) -> Iterator[ast.AST]:
    """All nodes, but for what stands under `if TYPE_CHECKING`."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            for other in node.orelse:
                yield from (other, *_statements(other))
        else:
            yield node
            yield from _statements(node)
