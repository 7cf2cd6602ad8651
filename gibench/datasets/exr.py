"""Frames as multi-channel OpenEXR files, with the stored types that the channel contract asks for.

Names in the file. `color` is the unnamed layer `R`, `G`, `B`, which every viewer shows first; all other
channels are layers called by the channel's name: `direct_diffuse.R` … for colours, `position.X`, `.Y`, `.Z`
for vectors, `depth.V` for single values.

Compression is ZIP (deflate over 16 scan lines, lossless). Measured on a 256×192 frame with the sets
`radiance` and `surface` (5.3 MB raw), one thread: ZIP 1.5 MB, 56 ms to write, 12 ms to read `color` +
`surface`; ZIPS 1.6 MB, 57 ms, 15 ms; PIZ 2.0 MB, 81 ms, 25 ms; RLE 2.2 MB, 31 ms, 11 ms; none 5.3 MB, 8 ms,
3 ms.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from gibench.datasets.errors import StorageError, UnknownChannel, nearest
from gibench.datasets.exr_header import HeaderError, read_header
from gibench.gate import GateError
from gibench.rendering.channels import CHANNELS, CUES, PARTS, Channel

#: Largest relative error that storing a value as half may bring, on any pixel.
HALF_TOLERANCE = 1e-3

#: Share of a frame's typical value below which an error counts against that share, not against the value.
#: Sampling and denoising leave values like 1e-12 in the dark corners of almost every channel: taken at their word
#: they would make all radiance float32, double the files and the time to read them, and keep nothing but dust.
DARK = 0.01

_SUFFIXES = {"color": ("R", "G", "B"), "vector": ("X", "Y", "Z"), "value": ("V",)}


def layer_names(channel: Channel) -> tuple[str, ...]:
    """Names in the file of the components of a channel, in their order."""
    if channel.name == "color":
        return _SUFFIXES["color"]
    if channel.components == 1:
        suffixes = _SUFFIXES["value"]
    else:
        suffixes = _SUFFIXES["color" if channel.dtype == "half" else "vector"][: channel.components]
    return tuple(f"{channel.name}.{suffix}" for suffix in suffixes)


def fits_half(values: NDArray[np.float32], dark: float = 0.0) -> bool:
    """Whether float16 holds every value within `HALF_TOLERANCE`, relative to the value or to `dark`; any shape.

    Half overflows above 65504. From 6e-5 to there its relative error is below 5e-4; below, its steps are 6e-8 wide.
    """
    with np.errstate(over="ignore"):
        half = values.astype(np.float16).astype(np.float32)
    return bool(
        np.all(np.abs(half - values) <= HALF_TOLERANCE * np.maximum(np.abs(values), np.float32(dark)))
    )


def dark_radiance(arrays: Mapping[str, NDArray[Any]]) -> float:
    """Radiance that counts as dark in a frame: `DARK` times the median of its brightest radiance channel.

    0 where half of the image is black, so that such a frame is held to the relative error alone.
    """
    medians = [float(np.median(values)) for name, values in arrays.items() if is_radiance(CHANNELS[name])]
    return DARK * max(medians, default=0.0)


def total_of_parts(stored: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
    """Sum of the five radiance parts as stored, in float32 and in the order of the contract. (H, W, 3).

    The one definition of the identity between `color` and its parts: `color` is this sum, rounded to the type
    that it is stored as. Anybody who adds the stored parts in this order gets it back, bit by bit.
    """
    total = stored[PARTS[0]].astype(np.float32)
    for name in PARTS[1:]:
        total += stored[name].astype(np.float32)
    return total


def stored_types(arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Round every channel to the type that it is stored as.

    arrays: channel → (H, W, C) float32 or uint32, as rendered. Returns channel → (H, W, C) float16, float32 or
    uint32. Half is taken where `fits_half` says so for the whole channel. Where `color` comes with its five parts
    it is the sum of the parts *as stored* (`total_of_parts`); otherwise it is stored as it came. Raises
    `StorageError` for a value that is not finite or a negative radiance.
    """
    stored: dict[str, NDArray[Any]] = {}
    dark = dark_radiance(arrays)
    for name, values in arrays.items():
        channel = CHANNELS[name]
        if channel.dtype == "uint":
            stored[name] = values.astype(np.uint32)
            continue
        _refuse_impossible(channel, values)
        if channel.dtype == "half":
            # Other half channels are ratios up to 1.
            stored[name] = _rounded(values, dark if is_radiance(channel) else DARK)
        else:
            stored[name] = values.astype(np.float32)
    if "color" in stored and stored.keys() >= set(PARTS):
        stored["color"] = _rounded(total_of_parts(stored), dark)
    return stored


def is_radiance(channel: Channel) -> bool:
    """Whether the channel holds light, which is never negative."""
    return channel.set in ("radiance", "samples") or channel.name in CUES


def _refuse_impossible(channel: Channel, values: NDArray[Any]) -> None:
    wrong = ~np.isfinite(values)
    what = "not finite"
    if is_radiance(channel) and not wrong.any():
        wrong, what = values < 0, "negative"
    if wrong.any():
        row, column = np.argwhere(wrong)[0][:2]
        raise StorageError(
            f"channel {channel.name} is {what} in {int(wrong.any(-1).sum())} pixels, "
            f"first at row {row}, column {column}"
        )


def _rounded(values: NDArray[Any], dark: float) -> NDArray[Any]:
    values = values.astype(np.float32)
    return values.astype(np.float16) if fits_half(values, dark) else values


def encode(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Encode a frame as the content of one single-part OpenEXR file.

    arrays: channel → (H, W, C), as rendered; see `stored_types` for how they are rounded. Raises
    `StorageError`.
    """
    layers = {}
    for name, values in stored_types(arrays).items():
        for i, layer in enumerate(layer_names(CHANNELS[name])):
            layers[layer] = np.ascontiguousarray(values[..., i])
    file = OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, layers)
    content = io.BytesIO()
    file.write(content)
    return content.getvalue()


def decode(
    source: Path | bytes, channels: Iterable[str] | None = None, *, widen: bool = False
) -> dict[str, NDArray[Any]]:
    """Read channels of a frame.

    source: a file or its content. channels: names of the contract, or None for all that the file holds.
    Returns channel → (H, W, C) float16, float32 or uint32 as stored; widen: float32 in place of float16. The
    file interleaves its layers within blocks of 16 lines, so everything is decompressed either way; only
    what is asked for is put together. Raises `UnknownChannel` for a channel that the file lacks,
    `StorageError` for a broken file, for one that states more than it can hold, and for one without any channel.
    """
    present = present_channels(source)
    if not present:
        raise StorageError(f"{_place(source)} holds no channel of a frame")
    layers = {name: layer.pixels for name, layer in _opened(source).items()}
    names = tuple(channels) if channels is not None else present
    for name in names:
        if name not in present:
            raise UnknownChannel(f"{_place(source)} has no channel '{name}'; {nearest(name, present)}")
    return {name: _put_together([layers[n] for n in layer_names(CHANNELS[name])], widen) for name in names}


def present_channels(source: Path | bytes) -> tuple[str, ...]:
    """Names of the channels that a file holds, read from its header. Raises `StorageError`."""
    try:
        return _channels_in(read_header(source).layers)
    except (HeaderError, GateError) as problem:
        raise StorageError(f"{_place(source)} cannot be read as OpenEXR: {problem}") from None


def _channels_in(layers: Iterable[str]) -> tuple[str, ...]:
    layers = set(layers)
    return tuple(c.name for c in CHANNELS.values() if layers.issuperset(layer_names(c)))


def _opened(source: Path | bytes) -> dict[str, Any]:
    try:
        file = io.BytesIO(source) if isinstance(source, bytes) else str(source)
        with OpenEXR.File(file, separate_channels=True) as opened:
            return dict(opened.channels())
    except Exception as problem:  # OpenEXR raises whatever its C++ side threw
        reason = " ".join(str(problem).split())
        raise StorageError(f"{_place(source)} cannot be read as OpenEXR: {reason}") from None


def _place(source: Path | bytes) -> str:
    return "this frame" if isinstance(source, bytes) else str(source)


def _put_together(layers: list[NDArray[Any]], widen: bool) -> NDArray[Any]:
    dtype = np.dtype(np.float32) if widen and layers[0].dtype == np.float16 else layers[0].dtype
    values = np.empty((*layers[0].shape, len(layers)), dtype)
    for i, layer in enumerate(layers):
        values[..., i] = layer
    return values
