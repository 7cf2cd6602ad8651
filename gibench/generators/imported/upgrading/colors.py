"""Colours and spectra."""

from __future__ import annotations

import re

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.reading import Node
from gibench.generators.imported.upgrading.rules import Note, constant_color

_ONE_NUMBER = re.compile(r"\s*[-+.\deE]+\s*")


def srgb_tags(root: Node, note: Note) -> None:
    """`<srgb>` becomes linear `<rgb>`."""
    for node in root.everything():
        if node.tag == "srgb":
            node.tag = "rgb"
            text = node.get("value", "")
            if not text.strip().startswith("#"):
                color = constant_color(node, 0.0)
                assert color is not None
                node.set("value", " ".join(repr(round(_decoded(c), 9)) for c in color))
            note(node, f"<srgb> {text} is linear <rgb> {node.get('value')}")


def hexadecimal_colors(root: Node, note: Note) -> None:
    """#rrggbb, which is sRGB as on web pages, becomes linear numbers."""
    for node in root.everything():
        text = node.get("value", "").strip()
        if node.tag in ("rgb", "spectrum") and text.startswith("#"):
            if not re.fullmatch(r"#[0-9a-fA-F]{6}", text):
                raise SceneFileError(f"{node.where}: '{text}' is no colour: write #rrggbb or three numbers")
            parts = [_decoded(int(text[i : i + 2], 16) / 255) for i in (1, 3, 5)]
            node.tag = "rgb"
            node.set("value", " ".join(repr(round(c, 9)) for c in parts))
            note(node, f"{text} is {node.get('value')}")


def _decoded(value: float) -> float:
    """IEC 61966-2-1."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def scalar_spectra(root: Node, note: Note) -> None:
    """A `<spectrum>` of one number becomes grey.

    Mitsuba 0.x rendered such a light white; Mitsuba 3 takes it for an equal-energy spectrum, which is
    (1.205, 0.948, 0.909) in Rec. 709.
    """
    for node in root.everything():
        if node.tag == "spectrum" and _ONE_NUMBER.fullmatch(node.get("value", "")):
            node.tag = "rgb"
            note(node, f"a spectrum of {node.get('value')} is grey")
