"""Images of textures and environments: checked before Mitsuba opens them, and made anew where it cannot do their part.

Mitsuba 3 picks no channel of an image and multiplies none: the channel, or the product, is written as an image of its
own.
"""

from __future__ import annotations

import io
import re
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gibench.generators.imported.changes import Note
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.files import NamedFile, named_files
from gibench.generators.imported.reading import SceneTree
from gibench.generators.imported.tree import Node, new, replaced
from gibench.generators.imported.upgrading.rules import constant_color
from gibench.generators.imported.upgrading.textures import COLORS_OF, FACTOR

BANDS = {"r": 0, "g": 1, "b": 2, "a": 3}

MOST_PIXELS = 1 << 28
"""Of one image; a file of a hundred bytes can ask for more."""

LONGEST_HEADER = 1 << 16

RADIANCE, FLOAT_MAPS = (b"#?",), (b"PF", b"Pf")

EXR, EXR_NAMES = b"\x76\x2f\x31\x01", ("R", "G", "B", "A", "Y", "X", "Z", "RY", "BY")


def check_images(tree: SceneTree) -> None:
    """Raises SceneFileError, with the place in the scene, for an image that Mitsuba refuses or that is no light."""
    for file in named_files(tree):
        holds_image = file.owner.tag in ("texture", "emitter") or file.owner.type == "heightfield"
        if not holds_image or file.element.tag == "spectrum":
            continue
        if not isinstance(file.source, Path):
            continue
        with file.source.open("rb") as opened:
            start = opened.read(LONGEST_HEADER)
        if start.startswith(EXR):
            _check_exr(file.owner.where, file.source)
        elif start.startswith((*RADIANCE, *FLOAT_MAPS)):
            _check_float_image(file.owner.where, file.source, start)
        else:
            _check_image(file.owner.where, file.source)
        if file.owner.type == "envmap":
            _check_light(file)


def _check_exr(where: str, path: Path) -> None:
    import OpenEXR

    try:
        header = OpenEXR.InputFile(str(path)).header()
    except Exception:  # its errors have no common type of their own
        raise SceneFileError(f"{where}: {path.name} is a damaged OpenEXR file: get it again") from None
    window = header["dataWindow"]
    _check_size(where, path, window.max.x - window.min.x + 1, window.max.y - window.min.y + 1)
    names = sorted(header["channels"])
    if not any(name in EXR_NAMES for name in names):
        layer = names[0].rpartition(".")[0] or names[0]
        raise SceneFileError(
            f"{where}: {path.name} has no channels R, G and B, but those of the layer '{layer}': save that layer as an "
            "image of its own"
        )


def _check_float_image(where: str, path: Path, start: bytes) -> None:
    """Of a Radiance HDR or a portable float map, whose pixels nothing but their headers announce."""
    if start.startswith(RADIANCE):
        found = re.search(rb"\n\s*\n[+-][XY] (\d{1,9}) [+-][XY] (\d{1,9})\s", start)
        height, width = (int(found[1]), int(found[2])) if found is not None else (0, 0)
    else:
        found = re.match(rb"P[Ff]\s+(\d{1,9})\s+(\d{1,9})\s", start)
        width, height = (int(found[1]), int(found[2])) if found is not None else (0, 0)
    if width < 1 or height < 1:
        raise SceneFileError(f"{where}: {path.name} is a damaged image, which states no size: get it again")
    _check_size(where, path, width, height)


def _check_image(where: str, path: Path) -> None:
    try:
        with Image.open(path) as image:
            mode, size, kind = image.mode, image.size, image.format
    except Image.DecompressionBombError:
        raise SceneFileError(
            f"{where}: {path.name} has more than {MOST_PIXELS} pixels: make it smaller"
        ) from None
    except (OSError, ValueError, SyntaxError):
        return  # Mitsuba has its say
    _check_size(where, path, *size)
    if mode in ("CMYK", "YCCK", "LAB"):
        raise SceneFileError(f"{where}: {path.name} is a {kind} of {mode} colours: save it as RGB")


def _check_size(where: str, path: Path, width: int, height: int) -> None:
    if width * height > MOST_PIXELS:
        raise SceneFileError(
            f"{where}: {path.name} has {width} × {height} pixels; more than {MOST_PIXELS} are not read: make it smaller"
        )


def _check_light(file: NamedFile) -> None:
    image = linear(Path(file.source))
    if image is None:
        raise SceneFileError(
            f"{file.owner.where}: {Path(file.source).name} cannot be read as an image: get it again"
        )
    broken = int((~np.isfinite(image)).sum() + (image < 0).sum())
    if broken:
        raise SceneFileError(
            f"{file.owner.where}: {broken} values of {Path(file.source).name} are negative or not finite: mend the "
            "file or use another"
        )


def linear(path: Path, *, raw: bool = False) -> NDArray[np.float32] | None:
    """(H, W, 3) linear values of any image that Mitsuba reads, None of another. raw: its numbers are linear already."""
    from gibench.rendering.backend import select_variant, threads_to_load

    select_variant()
    import mitsuba as mi

    try:
        with threads_to_load():
            bitmap = mi.Bitmap(str(path))
        if raw:
            bitmap.set_srgb_gamma(False)
        bitmap = bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
    except (RuntimeError, UnicodeDecodeError, MemoryError):
        return None
    return np.array(bitmap)


def made_images(tree: SceneTree, note: Note) -> None:
    """Make an image for every bitmap with a `channel` or a FACTOR, in place.

    In files of Mitsuba 0.x opacities are also meant by the alpha channel of their image where it has one; without it,
    the colours of leaves decided where they end.
    """
    made: dict[tuple[Path | str, str], str] = {}
    for node in tree.root.everything():
        name = node.property("filename")
        if node.tag != "texture" or node.type != "bitmap" or name is None:
            continue
        _take_channel(tree, node, name, made, note)
        factor = node.property(FACTOR)
        if factor is not None:
            node.remove(factor)
            color = constant_color(factor, 1.0)
            assert color is not None
            _multiply(tree, node, name, color, made, note)


def plain_roughness(tree: SceneTree, note: Note) -> None:
    """The texture of the roughness of a `roughplastic` of Mitsuba 0.6 becomes its mean: Mitsuba 3 has one number."""
    by_id = {node.get("id"): node for node in tree.root.everything() if node.tag == "texture"}
    for node in tree.root.everything():
        part = node.property("alpha")
        if node.tag != "bsdf" or node.type != "roughplastic" or not node.legacy or part is None:
            continue
        texture = by_id.get(part.get("id"), part) if part.tag == "ref" else part
        if texture.tag != "texture":
            continue
        mean = _mean(tree, texture)
        replaced(node, part, new("float", part, name="alpha", value=repr(round(mean, 6))))
        note(node, f"the texture of a roughplastic's roughness is its mean, {mean:.3g}", loss=True)


def _mean(tree: SceneTree, texture: Node) -> float:
    """Of the values of a texture."""
    name = texture.property("filename")
    if texture.type == "bitmap" and name is not None:
        image = linear(tree.located(name.get("value", ""), name.where), raw=texture.value("raw") == "true")
        if image is not None and np.isfinite(image).all():
            return float(image.mean(dtype=np.float64))
    if texture.type == "checkerboard":
        colors = [constant_color(texture.property(n), d) for n, d in COLORS_OF["checkerboard"].items()]
        return float(np.mean([color for color in colors if color is not None]))
    raise SceneFileError(
        f"{texture.where}: no mean is known of this {texture.type or 'texture'} as a roughness: give a number"
    )


def _take_channel(
    tree: SceneTree, node: Node, name: Node, made: dict[tuple[Path | str, str], str], note: Note
) -> None:
    asked = node.property("channel")
    path = tree.located(name.get("value", ""), name.where)
    channel = None if asked is None else asked.get("value", "")
    if node.legacy and channel is None and node.get("name") == "opacity" and _has_alpha(node, path):
        channel = "a"
        note(node, f"the opacity of {path.name} is its alpha channel", loss=True)
    if channel is None:
        return
    if asked is not None:
        node.remove(asked)
        note(node, f"channel {channel} of {path.name} is an image of its own")
    key = (path.resolve(), channel)
    if key not in made:
        image = _opened(node, path)
        if channel not in BANDS or image is None:
            raise SceneFileError(
                f"{node.where}: channel '{channel}' of {path.name} cannot be read: it must be r, g, b or a of a PNG"
            )
        made[key] = tree.make(
            f"{path.stem}.{channel}", ".png", _png(image.convert("RGBA").getchannel(BANDS[channel]))
        )
    name.set("value", made[key])
    if channel == "a" and node.property("raw") is None:
        node.append(new("boolean", node, name="raw", value="true"))


def _multiply(
    tree: SceneTree,
    node: Node,
    name: Node,
    factor: tuple[float, float, float],
    made: dict[tuple[Path | str, str], str],
    note: Note,
) -> None:
    source = tree.source(name.get("value", ""), name.where)
    raw = node.value("raw") == "true"
    stem = Path(source).stem
    key = (source, f"{factor} {raw}")
    if key not in made:
        image = _opened(node, source if isinstance(source, Path) else io.BytesIO(tree.content(source)))
        if image is None:
            note(
                node,
                f"the scale {factor} of {Path(source).name} is left out: it is no PNG, JPEG, BMP or TGA",
                loss=True,
            )
            return
        alpha = image.getchannel("A") if "A" in image.getbands() else None
        values = np.asarray(image.convert("RGB"), dtype=np.float64) / 255
        product = (values if raw else _decoded(values)) * factor
        if product.max(initial=0) > 1:
            note(node, f"{stem} times {factor} is cut off at 1", loss=True)
        product = np.clip(product, 0, 1)
        pixels = np.round(255 * (product if raw else _encoded(product))).astype(np.uint8)
        result = Image.fromarray(pixels)
        if alpha is not None:
            result.putalpha(alpha)
        made[key] = tree.make(f"{stem}.scaled", ".png", _png(result))
    name.set("value", made[key])


def _decoded(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """From sRGB (IEC 61966-2-1) to linear."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def _encoded(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055)


def as_png(content: bytes) -> bytes:
    """Any image that Mitsuba reads as a PNG in sRGB, cut off at 1; content: of its file."""
    try:
        with Image.open(io.BytesIO(content)) as image:
            return _png(image.convert("RGBA" if "A" in image.getbands() or image.mode == "P" else "RGB"))
    except (OSError, ValueError, SyntaxError):
        pass
    with tempfile.TemporaryDirectory(prefix="gibench-") as scratch:
        file = Path(scratch) / "image"
        file.write_bytes(content)
        values = linear(file)
    if values is None:
        return _png(Image.new("RGB", (1, 1), (188, 188, 188)))
    shown = _encoded(np.clip(np.nan_to_num(values.astype(np.float64)), 0, 1))
    return _png(Image.fromarray(np.round(255 * shown).astype(np.uint8)))


def _png(image: Image.Image) -> bytes:
    content = io.BytesIO()
    image.save(content, "PNG")
    return content.getvalue()


def _opened(node: Node, file: Path | io.BytesIO) -> Image.Image | None:
    """The pixels of an image of 8 bits; None for OpenEXR and its like, which have no transparency that scenes used."""
    name = file.name if isinstance(file, Path) else "the image"
    if isinstance(file, Path):
        _check_image(node.where, file)
    try:
        image = Image.open(file)
    except (OSError, ValueError, SyntaxError):
        return None
    try:
        image.load()
    except (OSError, ValueError, SyntaxError) as problem:
        raise SceneFileError(f"{node.where}: {name} is damaged ({problem}): get it again") from None
    if "transparency" in image.info or image.mode in ("P", "PA"):
        return image.convert("RGBA")
    return image


def _has_alpha(node: Node, path: Path) -> bool:
    image = _opened(node, path)
    return image is not None and "A" in image.getbands() and image.getchannel("A").getextrema()[0] != 255
