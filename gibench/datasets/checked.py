"""JSON files of somebody else, checked against what they should hold before any of it is used.

A model says what a reader needs; what else a file holds stays as it is, so that a newer gibench may add to it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from gibench import gate

#: Deepest nesting; what gibench writes has a tenth of it.
DEEPEST = 64

#: Most characters of a file's own words that a message repeats.
REPEATED = 80


class Checked(BaseModel):
    """Base of the schemas of files. Types are taken literally: "5" is no number, 1 is no truth value."""

    model_config = ConfigDict(extra="allow", strict=True, frozen=True, allow_inf_nan=False)


def plain_name(text: str) -> str:
    """Return a text that may become part of the name of a file. Raises ValueError for another."""
    if not gate.is_name(text):
        raise ValueError(
            f"{shown(text)} is no name: letters, digits and _ . + : @ = - may follow a letter or digit, "
            f"in all at most {gate.LONGEST_NAME} bytes"
        )
    return text


Name = Annotated[str, AfterValidator(plain_name)]
"""A text that may become part of the name of a file."""

Count = Annotated[int, Field(ge=0, lt=2**63)]
Amount = Annotated[float, Field(ge=0)]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class Fingerprint(Checked):
    """A file as it was written."""

    sha256: Sha256
    bytes: Count


def parsed(content: bytes, model: type[BaseModel]) -> dict[str, Any]:
    """Read JSON that must be what `model` says; what the file holds comes back as it is there.

    Raises ValueError with one line that says what is wrong, and where in the file.
    """
    return checked(plain(content), model)


def checked(value: dict[str, Any], model: type[BaseModel]) -> dict[str, Any]:
    """The same for values that are parsed already."""
    try:
        model.model_validate(value)
    except ValidationError as problems:
        raise ValueError(first_problem(problems)) from None
    return value


def plain(content: bytes) -> dict[str, Any]:
    """Read a JSON object of finite numbers and printable Unicode. Raises ValueError, see `parsed`."""
    try:
        value = json.loads(content.decode("utf-8-sig"), parse_constant=_no_number)
    except (ValueError, RecursionError):
        raise ValueError("it is cut off or no JSON") from None
    if not isinstance(value, dict):
        raise ValueError("it is no table")
    _refuse_strange(value)
    return value


def _no_number(text: str) -> float:
    raise ValueError(text)


def _refuse_strange(value: Any) -> None:
    """Raise ValueError for what would fail later, wherever it stands: depth, infinity, halves of characters."""
    level: list[Any] = [value]
    for _ in range(DEEPEST):
        below: list[Any] = []
        for one in level:
            if isinstance(one, dict):
                below += one.keys()
                below += one.values()
            elif isinstance(one, list):
                below += one
            elif isinstance(one, str):
                if not one.isascii() and any("\ud800" <= letter <= "\udfff" for letter in one):
                    raise ValueError("it holds half of a character")
            elif isinstance(one, float) and not math.isfinite(one):
                raise ValueError("it holds a number beyond those that a computer has")
            elif isinstance(one, int) and abs(one) >= 2**63:
                raise ValueError("it holds an integer of more than 64 bits")
        if not below:
            return
        level = below
    raise ValueError(f"it is nested more than {DEEPEST} deep")


def first_problem(problems: ValidationError) -> str:
    """One line of what a model found wrong: where, and what."""
    problem = problems.errors(include_url=False, include_context=False, include_input=False)[0]
    return f"{_place(problem['loc'])}{problem['msg'].removeprefix('Value error, ')}"


def _place(loc: Iterable[int | str]) -> str:
    place = ".".join(map(str, loc))
    return f"{shown(place)[1:-1]}: " if place else ""


def shown(text: str) -> str:
    """A file's own words in a message: quoted, cut to a length, without control characters."""
    return repr(text if len(text) <= REPEATED else f"{text[:REPEATED]}…")
