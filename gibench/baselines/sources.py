"""The sources that a module consists of: its own and those of all that it imports.

What is computed is kept by a digest of them, so that code which is edited computes anew, with no number to be raised.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

#: Of gibench, what does not decide what a method computes: its version, by which results are told apart anyway, and
#: what makes scenes, which enter by their content.
APART = ("gibench", "gibench.generators")


def digest(*modules: str) -> str:
    """16 hexadecimal digits of what the sources of modules do: comments, docstrings and line breaks do not count."""
    files: dict[str, Path] = {}
    for module in modules:
        files |= sources(module)
    content = hashlib.sha256()
    for name, file in sorted(files.items()):
        content.update(f"{name}\0{_read(name, file)[1]}\0".encode())
    return content.hexdigest()[:16]


def module_of(function: Callable[..., Any]) -> str:
    """Module in which a function, a method, a class or a partial of one is written."""
    while isinstance(function, partial):
        function = function.func
    return function.__module__ or ""


def sources(module: str) -> dict[str, Path]:
    """Files of a module and of what it imports, by module: of its own top-level package and of gibench.

    Nothing is imported to find them. Imports inside functions count, those for type checkers do not. Of a package that
    a module merely lies in, its `__init__` counts, but not what that imports: re-exporting changes nothing.
    """
    own = module.partition(".")[0]
    found: dict[str, Path] = {}
    followed: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        file = _file(name)
        if name in followed or file is None or name == APART[0] or name.startswith(APART[1]):
            continue
        followed.add(name)
        found[name] = file
        for package in _packages(name):
            if package != APART[0] and (place := _file(package)) is not None:
                found[package] = place
        waiting += (i for i in _read(name, file)[0] if i.partition(".")[0] in (own, "gibench"))
    return found


def _packages(name: str) -> list[str]:
    """The packages that a module lies in, from the top."""
    parts = name.split(".")
    return [".".join(parts[:k]) for k in range(1, len(parts))]


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
def _read(name: str, file: Path) -> tuple[tuple[str, ...], str]:
    """Imports of a module, dotted names that may be modules, and its syntax tree without docstrings, as text."""
    tree = ast.parse(file.read_bytes())
    package = name.split(".") if file.name == "__init__.py" else name.split(".")[:-1]
    names: set[str] = set()
    for node in _statements(tree):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            stem = ".".join([*base, *([node.module] if node.module else [])])
            names.update([stem, *(f"{stem}.{alias.name}" for alias in node.names)])
        elif isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [line for line in node.body if not _is_remark(line)]
    tree.body = [line for line in tree.body if not _is_remark(line)]
    return tuple(sorted(names - {""})), ast.dump(tree)


def _is_remark(line: ast.stmt) -> bool:
    """A docstring, or another string that stands alone, such as one below a constant."""
    return isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant)


def _statements(tree: ast.AST) -> Iterator[ast.AST]:
    """All nodes, but for what stands under `if TYPE_CHECKING`."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            for other in node.orelse:
                yield from (other, *_statements(other))
        else:
            yield node
            yield from _statements(node)
