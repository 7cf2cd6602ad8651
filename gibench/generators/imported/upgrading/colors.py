"""Colours and spectra."""

from __future__ import annotations

import re
import warnings

import numpy as np

from gibench.generators.imported.changes import Note
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.tree import Node
from gibench.generators.imported.upgrading.rules import constant_color, number, old

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")


def intents(root: Node, note: Note) -> None:
    """What a colour is for (`intent`) is left out: where it stands tells."""
    for node in old(root):
        if node.tag in ("rgb", "srgb", "spectrum") and node.attrib.pop("intent", None) is not None:
            note(node, "the intent of a colour is left out")


def srgb_tags(root: Node, note: Note) -> None:
    """`<srgb>` becomes linear `<rgb>`."""
    for node in old(root):
        if node.tag == "srgb":
            node.tag = "rgb"
            text = node.get("value", "")
            if not text.strip().startswith("#"):
                color = constant_color(node, 0.0)
                # No display shows more than a few times its white; powers of what is huge would overflow.
                if color is None or max(map(abs, color)) > 1e6:
                    raise SceneFileError(
                        f"{node.where}: '{text}' is no colour: write #rrggbb or three numbers"
                    )
                node.set("value", " ".join(repr(round(_decoded(c), 9)) for c in color))
            note(node, f"<srgb> {text} is linear <rgb> {node.get('value')}")


def hexadecimal_colors(root: Node, note: Note) -> None:
    """#rrggbb, which is sRGB as on web pages, becomes linear numbers."""
    for node in root.everything():
        text = node.get("value", "").strip()
        if node.tag in ("rgb", "srgb", "spectrum") and text.startswith("#"):
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
    """A `<spectrum>` of one number becomes grey, one of three is RGB, as it was where Mitsuba was built for RGB.

    Mitsuba 0.x rendered such a light white; Mitsuba 3 takes it for an equal-energy spectrum, which is
    (1.205, 0.948, 0.909) in Rec. 709.
    """
    for node in old(root):
        words = re.split(r"[\s,]+", node.get("value", "").strip())
        if node.tag == "spectrum" and all(_NUMBER.fullmatch(word) for word in words):
            if len(words) == 1:
                node.tag = "rgb"
                note(node, f"a spectrum of {node.get('value')} is grey")
            elif len(words) == 3:
                node.tag = "rgb"
                note(node, f"a spectrum of the three numbers {node.get('value')} is RGB")


def black_bodies(root: Node, note: Note) -> None:
    """`<blackbody>` becomes its colour: Planck's law, W·m⁻²·sr⁻¹·nm⁻¹, averaged by the CIE 1931 observer."""
    for node in old(root):
        if node.tag != "blackbody":
            continue
        text = node.get("temperature", "")
        kelvin = number(node, text.strip().removesuffix("K"))
        if kelvin <= 0:
            raise SceneFileError(f"{node.where}: '{text}' is no temperature: write kelvin above 0")
        scale = number(node, node.get("scale", "1"))
        node.tag = "rgb"
        node.attrib = {"name": node.get("name", "")}
        node.set("value", " ".join(repr(round(scale * c, 9)) for c in black_body(kelvin)))
        note(node, f"a black body of {kelvin:g} K is {node.get('value')}")


def black_body(kelvin: float) -> tuple[float, float, float]:
    """Radiance of a black body, linear Rec. 709, W·m⁻²·sr⁻¹·nm⁻¹ of an equal-energy spectrum; negative values are 0.

    kelvin: above 0. Source: Planck's law; CIE 1931 colour matching functions over the integral of ȳ (colour-science).
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message='"Matplotlib" related API')
        import colour

    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    metres = observer.wavelengths * 1e-9
    with np.errstate(over="ignore"):
        radiance = (
            2e-9 * PLANCK * LIGHT**2 / metres**5 / np.expm1(PLANCK * LIGHT / (metres * BOLTZMANN * kelvin))
        )
    xyz = radiance @ observer.values / observer.values[:, 1].sum()
    red, green, blue = np.maximum(colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB @ xyz, 0.0)
    return float(red), float(green), float(blue)


PLANCK, LIGHT, BOLTZMANN = 6.62607015e-34, 2.99792458e8, 1.380649e-23
"""Of the SI since 2019: J·s, m/s, J/K."""
