"""Predicted frames as OpenEXR: `color` as `R`, `G`, `B`, other parts as layers of their names."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench import gate
from gibench.baselines.method import PARTS, MethodError, Prediction
from gibench.benchmarks.errors import ResultsError
from gibench.datasets.exr import dark_radiance, fits_half
from gibench.datasets.exr_header import read_header

Image = NDArray[np.float32]

LAYERS = {
    "full": ("R", "G", "B"),
    **{part: tuple(f"{part}.{component}" for component in "RGB") for part in PARTS},
}


class BadPrediction(MethodError):
    """A frame that is no image: of the wrong shape, with NaN, infinity or negative radiance."""


def checked(prediction: Prediction, resolution: tuple[int, int]) -> dict[str, Image]:
    """The parts of a prediction, (H, W, 3) float32: "full", and those of PARTS that there are.

    resolution: (width, height) that was asked for. Raises BadPrediction, which says where.
    """
    if not isinstance(prediction, Prediction):
        raise BadPrediction(f"render returned {type(prediction).__name__}, not a Prediction")
    parts = {"full": _checked("color", prediction.color, resolution)}
    for part in PARTS:
        if (image := getattr(prediction, part)) is not None:
            parts[part] = _checked(part, image, resolution)
    return parts


def _checked(name: str, values: Any, resolution: tuple[int, int]) -> Image:
    array = np.asarray(values)
    width, height = resolution
    if array.shape != (height, width, 3):
        raise BadPrediction(f"{name} has shape {array.shape}, asked for was {(height, width, 3)}")
    if array.dtype.kind != "f":
        raise BadPrediction(f"{name} is {array.dtype}, asked for was float32")
    for wrong, what in ((~np.isfinite(array), "not finite"), (array < 0, "negative")):
        if wrong.any():
            row, column = np.argwhere(wrong)[0][:2]
            raise BadPrediction(
                f"{name} is {what} in {int(wrong.any(-1).sum())} of {width * height} pixels, first at row {row}, "
                f"column {column}"
            )
    with np.errstate(over="ignore"):
        single = array.astype(np.float32)
    if not np.isfinite(single).all():
        raise BadPrediction(f"{name} holds values above the largest of float32")
    return single


def encode(parts: dict[str, Image]) -> bytes:
    """The content of one OpenEXR file. Half where it holds the values within 1e-3, else float32; ZIP."""
    import OpenEXR

    layers = {}
    for part, image in parts.items():
        half = fits_half(image, dark_radiance({"color": image}))
        for component, layer in enumerate(LAYERS[part]):
            values = np.ascontiguousarray(image[..., component])
            layers[layer] = values.astype(np.float16) if half else values
    file = OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, layers)
    content = io.BytesIO()
    file.write(content)
    return content.getvalue()


def read(root: Path, id: str, frame: int, known: Mapping[str, Any]) -> dict[str, Image]:
    """The parts that a result says a frame has, (H, W, 3) float32 by part.

    root: folder of the run. known: the fingerprint that the frame was written with. Raises ResultsError for a file that
    is damaged, was changed since, or is none.
    """
    import OpenEXR

    name = f"results/{id}/{frame:04d}.exr"
    try:
        content = gate.read_inside(root, name, limit=int(known["bytes"]))
        if len(content) != known["bytes"] or hashlib.sha256(content).hexdigest() != known["sha256"]:
            raise ValueError("it was changed after the run: its SHA-256 differs")
        read_header(content)
        with OpenEXR.File(io.BytesIO(content), separate_channels=True) as opened:
            layers = {name: layer.pixels for name, layer in opened.channels().items()}
        return {
            part: np.stack([layers[name] for name in names], axis=-1).astype(np.float32)
            for part, names in LAYERS.items()
            if names[0] in layers
        }
    except Exception as problem:  # OpenEXR raises whatever its C++ side threw
        reason = " ".join(str(problem).split())
        remedy = f"remove {root / 'results' / id}.json and run the same command again"
        raise ResultsError(f"{root / name} cannot be read ({reason}): {remedy}") from None
