"""Output of the commands: text that may stem from anybody's files, and must not steer the terminal."""

from __future__ import annotations

import typer


def say(text: str, *, err: bool = False, nl: bool = True) -> None:
    """Print a text, on stderr where `err`; signs that steer a terminal or turn the reading are spelt out."""
    typer.echo(harmless(text), err=err, nl=nl)


def harmless(text: str) -> str:
    r"""The text with control characters as \x1b and the like. Line breaks and tabs stay."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(sign if sign.isprintable() or sign in "\n\t" else ascii(sign)[1:-1] for sign in text)


def one_line(text: str) -> str:
    """The same for one line of a table: its breaks are spelt out too."""
    return harmless(text).replace("\n", "\\n").replace("\t", " ")


def cut(text: str, width: int) -> str:
    """The text on one line, its end left out where it is longer."""
    text = one_line(text)
    return text if len(text) <= width else text[: width - 1] + "…"
