"""Textures of one channel of an image, which Mitsuba 3 cannot pick: the channel is written as an image of its own."""

from __future__ import annotations

import io
from pathlib import Path

from PIL import Image, UnidentifiedImageError

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.reading import Node, SceneTree, new
from gibench.generators.imported.upgrading.rules import Note

BANDS = {"r": 0, "g": 1, "b": 2, "a": 3}


def single_channels(tree: SceneTree, note: Note, *, legacy: bool) -> None:
    """Make an image for every bitmap with a `channel`, in place.

    legacy: opacities are also meant by the alpha channel of their image where it has one;
    without it, the colours of leaves decided where they end.
    """
    names: dict[tuple[Path, str], str] = {}
    for node in tree.root.everything():
        name = node.property("filename")
        if node.tag != "texture" or node.type != "bitmap" or name is None:
            continue
        asked = node.property("channel")
        path = tree.located(name.get("value", ""), name.where)
        channel = None if asked is None else asked.get("value", "")
        if legacy and channel is None and node.get("name") == "opacity" and _has_alpha(path):
            channel = "a"
            note(node, f"the opacity of {path.name} is its alpha channel", loss=True)
        if channel is None:
            continue
        if asked is not None:
            node.remove(asked)
            note(node, f"channel {channel} of {path.name} is an image of its own")
        made = names.setdefault((path.resolve(), channel), f"{path.stem}.{channel}.{len(names)}.png")
        content = io.BytesIO()
        _band(node, path, channel).save(content, "PNG")
        tree.made[made] = content.getvalue()
        name.set("value", made)
        if channel == "a" and node.property("raw") is None:
            node.append(new("boolean", node, name="raw", value="true"))


def _opened(path: Path) -> Image.Image | None:
    try:
        image = Image.open(path)
    except (UnidentifiedImageError, OSError):
        return None  # OpenEXR and its like, which have no transparency that old scenes used
    return image.convert("RGBA") if "transparency" in image.info or image.mode == "P" else image


def _has_alpha(path: Path) -> bool:
    image = _opened(path)
    return image is not None and image.mode == "RGBA" and image.getchannel("A").getextrema()[0] != 255


def _band(node: Node, path: Path, channel: str) -> Image.Image:
    image = _opened(path)
    if channel not in BANDS or image is None:
        raise SceneFileError(
            f"{node.where}: channel '{channel}' of {path.name} cannot be read: it "
            "must be r, g, b or a of a PNG"
        )
    return image.convert("RGBA").getchannel(BANDS[channel])
