"""The film of a sensor: its size, and the window of it that is an image."""

from __future__ import annotations

from dataclasses import dataclass

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.tree import Node

DEFAULT_SIZE = (768, 576)
"""Mitsuba's, of a film."""

LARGEST = 16384
"""Pixels along a side."""

SIDES = ("width", "height")
CROP = ("crop_offset_x", "crop_offset_y", "crop_width", "crop_height")


@dataclass(frozen=True)
class Film:
    """size: (width, height). corner, window: upper left corner and size of the part that becomes the image; pixels."""

    size: tuple[int, int] = DEFAULT_SIZE
    corner: tuple[int, int] = (0, 0)
    window: tuple[int, int] = DEFAULT_SIZE


def film_of(sensor: Node) -> Film:
    """The film of a sensor, Mitsuba's where it has none. Raises SceneFileError for one that Mitsuba refuses too."""
    for film in sensor.nodes("film")[:1]:
        size = tuple(_length(film, name, default) for name, default in zip(SIDES, DEFAULT_SIZE, strict=True))
        x, y, width, height = (
            whole_number(film, name, default) for name, default in zip(CROP, (0, 0, *size), strict=True)
        )
        if min(x, y) < 0 or min(width, height) < 1 or x + width > size[0] or y + height > size[1]:
            raise SceneFileError(
                f"{film.where}: the crop window {width}x{height} at {x}, {y} is not within the film of "
                f"{size[0]}x{size[1]}"
            )
        return Film((size[0], size[1]), (x, y), (width, height))
    return Film()


def _length(film: Node, name: str, default: int) -> int:
    value = whole_number(film, name, default)
    if not 1 <= value <= LARGEST:
        raise SceneFileError(f"{film.where}: a film has a {name} from 1 to {LARGEST}, not {value}")
    return value


def whole_number(node: Node, name: str, default: int) -> int:
    """A property that is a whole number, within what 32 bits hold. Raises SceneFileError."""
    text = node.value(name, str(default))
    try:
        value = int(text)
    except ValueError:
        raise SceneFileError(f"{node.where}: {name} '{text[:40]}' is no whole number") from None
    return max(-(2**31), min(value, 2**31 - 1))
