"""The header of an OpenEXR file, read before any library makes room for it.

A header of 500 bytes may ask for any number of pixels. Only what frames are written as is read: one part of scan lines,
compressed without loss by methods that hold at most `EXPANSION` bytes in one.

Source: OpenEXR file layout, https://openexr.com/en/latest/OpenEXRFileLayout.html
"""

from __future__ import annotations

import io
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from gibench import gate
from gibench.datasets.checked import shown

MAGIC = 20000630

#: Compressions by their number in a header: what each stands for and the most bytes that one byte becomes. Deflate
#: reaches 1032; run lengths of 128 bytes take 2; PIZ codes 16 bits in 1 at least, and runs of 255 of them in 9 or more.
EXPANSION = {0: ("none", 1), 1: ("RLE", 64), 2: ("ZIPS", 1032), 3: ("ZIP", 1032), 4: ("PIZ", 1032)}

TYPES = {0: 4, 1: 2, 2: 4}
"""Bytes of a value: unsigned, half, float."""

#: Largest width or height.
LARGEST_SIDE = 2**15

#: Most bytes of a header, and of what each scan line or block adds to a file at least.
LARGEST_HEADER, BLOCK_BYTES = 2**20, 8

#: Scan lines that are compressed together.
LINES = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32}


class HeaderError(ValueError):
    """A header that cannot be read, or asks for more than its file can hold."""


@dataclass(frozen=True)
class Header:
    """Size of the image in pixels, and its layers by name with the bytes of a value."""

    width: int
    height: int
    layers: dict[str, int]

    @property
    def bytes(self) -> int:
        """Bytes of the pixels once they are read."""
        return self.width * self.height * sum(self.layers.values())


def read_header(source: Path | bytes) -> Header:
    """Read and check the header of a file or its content. Raises HeaderError; `gate.GateError` where no file is."""
    if isinstance(source, bytes):
        return _checked(io.BytesIO(source), len(source))
    with gate.opened(source) as file:
        size = file.seek(0, 2)
        file.seek(0)
        return _checked(file, size)


def _checked(file: BinaryIO, size: int) -> Header:
    try:
        attributes = _attributes(file)
        left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
        method = attributes["compression"][0]
        layers = _layers(attributes["channels"])
    except (KeyError, struct.error, IndexError, UnicodeDecodeError):
        raise HeaderError("its header is cut off or damaged") from None
    width, height = right - left + 1, bottom - top + 1
    if not (0 < width <= LARGEST_SIDE and 0 < height <= LARGEST_SIDE):
        raise HeaderError(
            f"its header states {width}x{height} pixels, {LARGEST_SIDE} a side are read at most"
        )
    if method not in EXPANSION:
        raise HeaderError(f"compression number {method} is none that frames are written with")
    name, most = EXPANSION[method]
    header = Header(width, height, layers)
    if header.bytes > most * size or BLOCK_BYTES * (height / LINES[method]) > size:
        raise HeaderError(
            f"its header states {header.bytes} bytes of pixels, {size} bytes of {name} hold no such image"
        )
    return header


def _attributes(file: BinaryIO) -> dict[str, bytes]:
    magic, version = struct.unpack("<iI", file.read(8))
    if magic != MAGIC:
        raise HeaderError("it is no OpenEXR file")
    if version & 0xFF != 2 or version & 0x1A00:  # tiles, deep pixels, several parts
        raise HeaderError("it holds tiles, deep pixels or several parts, which frames do not")
    found: dict[str, bytes] = {}
    while (name := _text(file)) != b"":
        _text(file)
        (length,) = struct.unpack("<i", file.read(4))
        if not 0 <= length <= LARGEST_HEADER or file.tell() > LARGEST_HEADER:
            raise HeaderError(f"its header is larger than {LARGEST_HEADER} bytes")
        value = file.read(length)
        if len(value) < length:
            raise HeaderError("its header is cut off or damaged")
        found[name.decode()] = value
    return found


def _text(file: BinaryIO) -> bytes:
    text = bytearray()
    while (letter := file.read(1)) != b"\0":
        if not letter or len(text) > 255:
            raise HeaderError("its header is cut off or damaged")
        text += letter
    return bytes(text)


def _layers(content: bytes) -> dict[str, int]:
    layers: dict[str, int] = {}
    file = io.BytesIO(content)
    while (name := _text(file)) != b"":
        kind, _, across, down = struct.unpack("<iIii", file.read(16))
        if kind not in TYPES or (across, down) != (1, 1):
            raise HeaderError(f"its layer {shown(name.decode())} is no whole image of numbers")
        layers[name.decode()] = TYPES[kind]
    return layers
