"""XML as elements, parsed so that a file from the web can do no harm."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

from gibench import gate
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.tree import Node

DEEPEST = 100
"""Of elements in one another, and of includes: Mitsuba's own scenes have about ten."""

MOST_ELEMENTS = 1_000_000
MOST_INCLUDES = 1000
MOST_BYTES = 1 << 28
"""Of one file."""

MOST_TEXT = 1 << 26
"""Characters that parameters may expand to, all together."""


@dataclass
class Budget:
    """Budget of a scene's parsing: a kilobyte of includes or parameters can stand for terabytes."""

    elements: int = 0
    includes: int = 0
    text: int = 0

    def element(self, where: str) -> None:
        """Count one. Raises SceneFileError."""
        self.elements += 1
        if self.elements > MOST_ELEMENTS:
            raise SceneFileError(
                f"{where}: more than {MOST_ELEMENTS} elements, with what is included: no scene needs that"
            )

    def include(self, where: str) -> None:
        """Count one. Raises SceneFileError."""
        self.includes += 1
        if self.includes > MOST_INCLUDES:
            raise SceneFileError(
                f"{where}: more than {MOST_INCLUDES} files are included: no scene needs that"
            )

    def expand(self, characters: int, where: str) -> None:
        """Count what a parameter becomes. Raises SceneFileError."""
        self.text += characters
        if self.text > MOST_TEXT:
            raise SceneFileError(
                f"{where}: parameters expand to more than {MOST_TEXT} characters: no scene needs that"
            )


def parsed(file: Path, name: str, budget: Budget, *, legacy: bool | None = None) -> Node:
    """The first element of a file. legacy: of the file that includes it, for one without a version of its own.

    Raises SceneFileError for what cannot be read, is no XML, or is too much of it. Document type declarations are
    refused altogether: scenes have none, and entities are what XML bombs are made of.
    """
    content = _content(file)
    parser = expat.ParserCreate()
    stack: list[Node] = []
    roots: list[Node] = []
    old = legacy

    def refuse(*_: object) -> None:
        raise SceneFileError(
            f"{name}:{parser.CurrentLineNumber}: it has a document type declaration, which scenes do not need "
            "and which can make a small file expand without end: remove <!DOCTYPE …>"
        )

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal old
        node = Node(tag, attributes)
        node.where = f"{name}:{parser.CurrentLineNumber}"
        budget.element(node.where)
        if len(stack) >= DEEPEST:
            raise SceneFileError(
                f"{node.where}: more than {DEEPEST} elements in one another: no scene needs that"
            )
        if stack:
            stack[-1].append(node)
        else:
            roots.append(node)
            if tag == "scene" and node.get("version") is not None:
                old = _is_legacy(node)
        node.legacy = bool(old)
        stack.append(node)

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = start
    parser.EndElementHandler = lambda tag: stack.pop()
    try:
        parser.Parse(content, True)
    except expat.ExpatError as problem:
        raise SceneFileError(
            f"{file}: it is no XML: {expat.ErrorString(problem.code)} in line {problem.lineno}"
        ) from None
    except (LookupError, ValueError):
        raise SceneFileError(
            f"{name}:1: it declares an encoding that cannot be read: save it as UTF-8, and say so in its first line"
        ) from None
    root = roots[0]
    if root.tag == "scene" and old is None:
        raise SceneFileError(
            f'{root.where}: <scene> has no version such as "0.5.0" or "3.0.0": add the one it is for'
        )
    return root


def _content(file: Path) -> bytes:
    try:
        return gate.read_regular(file, MOST_BYTES)
    except gate.GateError as problem:
        raise SceneFileError(f"scene file {problem}"[:500]) from None


def _is_legacy(root: Node) -> bool | None:
    """Whether a scene was written for Mitsuba 0.x; None for a version that is none."""
    version = re.fullmatch(r"(\d{1,9})(\.\d+)*", root.get("version", "").strip())
    return None if version is None else int(version[1]) < 2
