"""Formulas between dollars become MathML, which browsers draw by themselves: the site loads no script for them."""

from __future__ import annotations

import re
from typing import Any

from latex2mathml.converter import convert

_CODE_OR_FORMULA = re.compile(r"(^```.*?^```$|`[^`\n]*`)|\$([^$\n]+)\$", re.M | re.S)
_PLACE = "⟦formula {}⟧"  # Markdown would take MathML for a block of its own

_formulas: list[str] = []


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Called by MkDocs for every page, before its Markdown is read."""
    _formulas.clear()

    def replaced(match: re.Match[str]) -> str:
        if match[1]:
            return match[1]
        _formulas.append(convert(match[2]))
        return _PLACE.format(len(_formulas) - 1)

    return _CODE_OR_FORMULA.sub(replaced, markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Called by MkDocs with the same page as HTML."""
    for number, formula in enumerate(_formulas):
        html = html.replace(_PLACE.format(number), formula)
    return html
