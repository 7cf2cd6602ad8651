"""Pictures of a dataset for people: a contact sheet, and one frame with all its channels."""

from __future__ import annotations

import io
import math
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from gibench.datasets.channel_pictures import Picture, picture_of
from gibench.datasets.exr import decode
from gibench.datasets.files import write_whole
from gibench.metrics import reference_exposure, tone_map
from gibench.rendering.channels import CHANNELS

if TYPE_CHECKING:
    import pandas as pd

    from gibench.datasets.loading import Frame

#: Most frames on a contact sheet, and the width of one of them in pixels.
SHEET_FRAMES, SHEET_WIDTH = 40, 240

#: Least width of a channel in a panel: smaller frames are enlarged by whole factors.
PANEL_WIDTH = 256

_BACKGROUND, _INK, _FAINT = (24, 24, 24), (235, 235, 235), (160, 160, 160)


def contact_sheet(root: Path, table: pd.DataFrame) -> Image.Image:
    """Lay out up to `SHEET_FRAMES` frames of a dataset, of as many rooms as can be, each exposed by itself.

    table: as in `frames.parquet`, at least one row. A dataset without `color` shows its first channel.
    """
    chosen = table.sort_values(["view", "room"]).head(SHEET_FRAMES).sort_values(["room", "view"])
    tiles = []
    for row in chosen.to_dict("records"):
        picture = thumbnail(root / str(row["file"]))
        tiles.append((picture, f"room {row['room']}  view {row['view']}", remark_of(row)))
    width, height = tiles[0][0].size
    # As near to a 3:2 sheet as whole columns allow.
    return grid(tiles, columns=max(1, round(math.sqrt(len(tiles) * 1.5 * height / width))))


def remark_of(row: Mapping[Hashable, Any]) -> str:
    """What a sheet says of a frame: its sequence, its environment map, as far as it has them, and its kind.

    All frames of a room have one kind, so that comes last, where a long remark is cut.
    """
    names = (" ".join(str(row.get(column, "")).split()) for column in ("path", "environment", "kind"))
    return ", ".join(name for name in names if name)


def frame_panel(frame: Frame) -> Image.Image:
    """Show one frame with all its channels, each with its name and the meaning of its colours."""
    arrays = frame.read()
    exposure = float(reference_exposure(arrays["color"])) if "color" in arrays else 1.0
    tiles = []
    for name, values in arrays.items():
        picture, legend = picture_of(CHANNELS[name], values, exposure)
        tiles.append((_enlarged(picture), name, legend))
    return grid(tiles, columns=min(len(tiles), 6))


def write_picture(path: Path, picture: Image.Image) -> None:
    """Write a PNG that appears only when whole."""
    content = io.BytesIO()
    picture.save(content, "png", optimize=True)
    write_whole(path, content.getvalue())


def thumbnail(path: Path, exposure: float | None = None) -> Image.Image:
    """A frame at the width of a contact sheet, tone-mapped. exposure: its own unless given."""
    arrays = decode(path, widen=True)
    name = "color" if "color" in arrays else next(iter(arrays))
    values = arrays[name]
    if name == "color":
        picture: Picture = tone_map(values, reference_exposure(values) if exposure is None else exposure)
    else:
        picture, _ = picture_of(CHANNELS[name], values, 1.0)
    image = image_of(picture)
    height = max(1, round(SHEET_WIDTH * image.height / image.width))
    sampling = Image.Resampling.LANCZOS if image.width > SHEET_WIDTH else Image.Resampling.NEAREST
    return image.resize((SHEET_WIDTH, height), sampling)


def image_of(picture: NDArray[Any]) -> Image.Image:
    """Of (H, W, 3) in [0, 1], display-encoded."""
    return Image.fromarray(np.rint(255 * np.clip(picture, 0, 1)).astype(np.uint8), "RGB")


def _enlarged(picture: Picture) -> Image.Image:
    image = image_of(picture)
    factor = max(1, math.ceil(PANEL_WIDTH / image.width))
    return image.resize((image.width * factor, image.height * factor), Image.Resampling.NEAREST)


def grid(tiles: list[tuple[Image.Image, str, str]], columns: int) -> Image.Image:
    """Tiles in reading order, each under its title (left) and a remark; all tiles have one size.

    Remarks stand at the right of the titles, or all of them below, where one is too long for that.
    """
    width, height = tiles[0][0].size
    gap, size = 6, 13
    font = ImageFont.load_default(size)
    below = any(font.getlength(title) + font.getlength(remark) + 12 > width for _, title, remark in tiles)
    line = size + 7
    above = line + size + 4 if below and any(remark for _, _, remark in tiles) else line
    rows = math.ceil(len(tiles) / columns)
    sheet = Image.new(
        "RGB", (gap + columns * (width + gap), gap + rows * (height + above + gap)), _BACKGROUND
    )
    draw = ImageDraw.Draw(sheet)
    for i, (image, title, remark) in enumerate(tiles):
        x, y = gap + i % columns * (width + gap), gap + i // columns * (height + above + gap)
        draw.text((x + 2, y + line / 2), title, _INK, font, anchor="lm")
        if below:
            draw.text(
                (x + 2, y + line / 2 + size + 4), _cut(remark, font, width - 4), _FAINT, font, anchor="lm"
            )
        else:
            draw.text((x + width - 2, y + line / 2), remark, _FAINT, font, anchor="rm")
        sheet.paste(image, (x, y + above))
    return sheet


def _cut(text: str, font: Any, width: float) -> str:
    """As much of a text as has room, with a sign that there is more."""
    if font.getlength(text) <= width:
        return text
    while text and font.getlength(f"{text}…") > width:
        text = text[:-1]
    return f"{text}…"
