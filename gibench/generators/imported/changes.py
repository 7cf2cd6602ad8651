"""Changes made to a scene, as they are recorded and printed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

Note = Callable[..., None]
"""note(node, what, loss=False)"""


@dataclass(frozen=True)
class Change:
    """A change that a rule made. rule: its name. what: in words. where: "scene.xml:12". loss: the image may differ."""

    rule: str
    what: str
    where: str
    loss: bool = False
