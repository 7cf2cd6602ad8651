"""Errors of Mitsuba, in terms of the user's files."""

from __future__ import annotations

import re
from pathlib import Path
from xml.sax.saxutils import quoteattr

from gibench.generators.imported.tree import Node


def with_lines(root: Node) -> tuple[str, list[str]]:
    """A scene as XML of a line an element, and where each line comes from."""
    lines: list[str] = []
    places: list[str] = []

    def write(node: Node) -> None:
        attributes = "".join(f" {key}={quoteattr(value)}" for key, value in node.attrib.items())
        children = node.nodes()
        lines.append(f"<{node.tag}{attributes}{'' if children else '/'}>")
        places.append(node.where)
        for child in children:
            write(child)
        if children:
            lines.append(f"</{node.tag}>")
            places.append(node.where)

    write(root)
    return "\n".join(lines), places


def refusal(problem: Exception, places: list[str], file: Path, scratch: str) -> str:
    """One line that says where in the user's file Mitsuba found what, and what to do."""
    text = problem.object.decode("latin-1") if isinstance(problem, UnicodeDecodeError) else str(problem)
    for folder in (scratch, str(file.parent.resolve())):
        text = text.replace(f"{folder}/", "")
    reason = " ".join(text.split())
    place = re.search(r"string \(line (\d+), col \d+\)", reason)
    where = str(file)
    if place is not None and 0 < int(place[1]) <= len(places):
        where = places[int(place[1]) - 1]
    reason = re.sub(r"\[[\w./-]+:\d+\] ", "", reason)
    reason = re.sub(r"(At|While loading|Error while loading) string \(line \d+, col \d+\): ", "", reason)
    reason = re.sub(r"string \(line (\d+), col \d+\)", lambda m: _place(places, int(m[1])), reason)
    unknown = re.match(r'Found \d+ unreferenced propert\w+ in (\w+) plugin of type "(\w+)": (.*)', reason)
    if unknown is not None:
        names = ", ".join(re.findall(r'- \w+ "([^"]*)"', unknown[3])) or unknown[3]
        return f"{where}: the {unknown[1]} {unknown[2]} has no property {names}: remove it"
    return f"{where}: Mitsuba refuses it: {reason.rstrip('.!')}; mend it or leave it out"


def _place(places: list[str], line: int) -> str:
    return places[line - 1] if 0 < line <= len(places) else "the scene"
