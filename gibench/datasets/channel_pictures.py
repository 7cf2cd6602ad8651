"""Channels as pictures for screens: every kind of quantity has its own way to colour."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.generators.materials.color import lch
from gibench.metrics import reference_exposure, tone_map
from gibench.rendering.channels import CUES, Channel

Picture = NDArray[np.float32]


def picture_of(channel: Channel, values: NDArray[Any], exposure: float) -> tuple[Picture, str]:
    """Turn a channel into an sRGB picture and say how its values became colours.

    values: (H, W, C). exposure: for radiance, the same for all parts of a frame, so that they can be
    compared. Returns (H, W, 3) float32 in [0, 1], sRGB-encoded, and a short legend, empty where nothing
    needs saying.
    """
    if channel.name == "color_se":
        own = float(reference_exposure(values))
        return tone_map(values, own), f"exposure x{own / exposure:.0f}"
    if channel.set in ("radiance", "samples") or channel.name in CUES:
        return tone_map(values, exposure), ""
    if channel.dtype == "uint":
        ids = values[..., 0]
        return id_colors(ids), f"{np.unique(ids[ids > 0]).size} of them"
    if channel.components == 1 and channel.unit == "m":
        return _distance(values[..., 0])
    if channel.components == 1:
        return np.repeat(np.clip(values, 0, 1), 3, axis=-1).astype(np.float32), "0 … 1"
    if channel.dtype == "half":
        return tone_map(values, 1.0), ""
    if channel.unit == "m":
        return _positions(values)
    if channel.components == 2:
        return _signed_pair(values, channel.unit)
    return np.where(np.any(values, axis=-1, keepdims=True), 0.5 + 0.5 * values, 0).astype(
        np.float32
    ), "-1 … 1"


def id_colors(ids: NDArray[Any]) -> Picture:
    """Colours that tell neighbouring ids apart; id 0 (a miss) is black.

    ids: (H, W). Returns sRGB (H, W, 3).
    """
    turns = np.arange(1, int(ids.max(initial=0)) + 1)
    # Multiples of the golden angle keep consecutive hues apart; the two others vary lightness, chroma.
    colors = lch(
        0.15 + 0.5 * np.mod(turns * 0.7549, 1), 0.08 + 0.08 * np.mod(turns * 0.5698, 1), turns * 2.39996
    )
    palette = np.concatenate([np.zeros((1, 3)), colors])
    return _srgb(palette[ids])


def scale_colors(shares: NDArray[Any]) -> Picture:
    """Colour scale from dark blue (0) by green to pale yellow (1), even in perceived lightness (Oklab).

    shares: (H, W) in [0, 1]. Returns sRGB (H, W, 3).
    """
    shares = np.clip(np.asarray(shares, np.float64), 0, 1)
    lightness = 0.28 + 0.66 * shares
    return _srgb(lch(lightness**3, 0.13, 4.9 - 3.0 * shares))


def _srgb(linear: NDArray[Any]) -> Picture:
    """Clip colours to the gamut and encode them."""
    return tone_map(np.maximum(linear, 0.0), 1.0).astype(np.float32)


def _distance(values: NDArray[Any]) -> tuple[Picture, str]:
    hit = values > 0
    if not hit.any():
        return np.zeros((*values.shape, 3), np.float32), "no hit"
    near, far = np.percentile(values[hit], (1, 99))
    colors = scale_colors((values - near) / max(far - near, 1e-6))
    return np.where(hit[..., None], colors, 0).astype(np.float32), f"{near:.2f} … {far:.2f} m"


def _positions(values: NDArray[Any]) -> tuple[Picture, str]:
    hit = np.any(values, axis=-1)
    if not hit.any():
        return np.zeros(values.shape, np.float32), "no hit"
    # What is seen through a window can lie a kilometre away and must not flatten the room.
    low, high = np.percentile(values[hit], (3, 97), axis=0)
    colors = np.where(hit[..., None], np.clip((values - low) / np.maximum(high - low, 1e-6), 0, 1), 0)
    return colors.astype(np.float32), "x y z " + " ".join(f"{s:.1f}" for s in high - low) + " m"


def _signed_pair(values: NDArray[Any], unit: str) -> tuple[Picture, str]:
    limit = max(float(np.percentile(np.abs(values), 98)), 1e-6)
    pair = np.clip(0.5 + 0.5 * values / limit, 0, 1)
    return np.concatenate([pair, np.full_like(pair[..., :1], 0.5)], -1).astype(
        np.float32
    ), f"±{limit:.3g} {unit}"
