"""Images for the page: high dynamic range, so that the exposure can be turned, in files that a page on disk may read.

A page opened from disk may not fetch files, and pixels of an <img> from disk may not be read back. It may run scripts
that lie beside it. So each image is a script that calls one function with the image in base64, and is loaded when
the image is looked at.

A value of radiance, exposed as the scene's path is, becomes a whole number of 10 bits: 40 steps an f-stop above
2⁻¹⁰, which is 1.7 %, and even steps below, down to 0. That is as fine as an eye tells apart on a display, and finer
than 8 bits after tone mapping where the picture is dark. Metrics are never computed from it. The numbers of green,
red less green and blue less green are predicted from their neighbours, and what is left is compressed (zlib).
"""

from __future__ import annotations

import base64
import json
import os
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gibench.benchmarks.report.runs import image_part
from gibench.benchmarks.report.source import ReportSource
from gibench.metrics import flip, tone_map

if TYPE_CHECKING:
    import pandas as pd

STEPS_PER_STOP = 40
TOE = 2.0**-10
"""Exposed radiance up to which steps are about even; middle grey is 0.18."""

LARGEST = 1023
"""Reached at 2¹⁵·⁶ times the display's white: only lamps are brighter."""

ESCAPE = 255


def encode(exposed: NDArray[Any]) -> NDArray[np.int32]:
    """Turn exposed radiance ≥ 0 into whole numbers from 0 to `LARGEST`: round(40·log₂(1 + x / 2⁻¹⁰))."""
    steps = STEPS_PER_STOP * np.log2(1 + np.asarray(exposed, np.float64) / TOE)
    return np.minimum(np.rint(steps), LARGEST).astype(np.int32)


def decode(codes: NDArray[Any]) -> NDArray[np.float64]:
    """Turn whole numbers back into exposed radiance, within 1.1 % of it from 0.004 on."""
    return TOE * (np.exp2(np.asarray(codes, np.float64) / STEPS_PER_STOP) - 1)


def pack(codes: NDArray[Any]) -> str:
    """Compress whole numbers (H, W, C) of at most 10 bits without loss, as base64.

    With three channels, red and blue are taken relative to green. Each plane is predicted from the pixels to the left,
    above, and both (Weinberger, Seroussi & Sapiro 2000, The LOCO-I lossless image compression algorithm, section
    III.A); from the one on the left in the first row and the one above in the first column. A difference d is stored
    as 2d, or −2d−1 where it is negative: one byte, or 255 and the number in two bytes at the end.
    """
    planes = np.moveaxis(np.asarray(codes, np.int32), 2, 0).copy()
    if len(planes) == 3:
        planes[[0, 2]] -= planes[1]
    guess = np.zeros_like(planes)
    guess[:, 0, 1:], guess[:, 1:, 0] = planes[:, 0, :-1], planes[:, :-1, 0]
    left, above, both = planes[:, 1:, :-1], planes[:, :-1, 1:], planes[:, :-1, :-1]
    low, high = np.minimum(left, above), np.maximum(left, above)
    guess[:, 1:, 1:] = np.where(both >= high, low, np.where(both <= low, high, left + above - both))
    rest = (planes - guess).ravel()
    unsigned = np.where(rest < 0, -2 * rest - 1, 2 * rest)
    content = np.minimum(unsigned, ESCAPE).astype(np.uint8).tobytes()
    content += unsigned[unsigned >= ESCAPE].astype("<u2").tobytes()
    return base64.b64encode(zlib.compress(content, 6)).decode()


def write_images(source: ReportSource, results: pd.DataFrame, out: Path) -> list[Path]:
    """Write every scored image, its reference and its FLIP map below `out`; give their paths.

    results: those that are done, with columns result and scene. Files are named as `image_name` says.
    """
    done = source.frames[["result", "frame", "part"]].drop_duplicates()
    done = done[done["part"] == done["part"].map(image_part)]
    jobs = done.merge(results[["result", "scene"]], on="result").groupby(["scene", "frame", "part"])["result"]

    def write(job: tuple[Any, Any]) -> list[Path]:
        (scene, frame, part), predictions = job
        exposure = source.exposure(scene, int(frame))
        reference = source.reference(scene, int(frame), part)
        seen = tone_map(reference, exposure)
        written = [_write(out, image_name("images", scene, frame, part), encode(reference * exposure))]
        for result in predictions:
            image = source.prediction(result, int(frame), part)
            error = np.rint(255 * np.asarray(flip(tone_map(image, exposure), seen, map=True)))
            written += [
                _write(out, image_name("images", result, frame, part), encode(image * exposure)),
                _write(out, image_name("errors", result, frame, part), error[..., None]),
            ]
        return written

    return [path for written in _in_threads(write, list(jobs)) for path in written]


def image_name(kind: str, of: str, frame: int, part: str) -> str:
    """Name a file of the page. kind: "images" or "errors"; of: a result, or a scene for its reference."""
    return f"{kind}/{of}/{int(frame):04d}-{part}.js"


def _write(out: Path, name: str, codes: NDArray[Any]) -> Path:
    height, width, channels = codes.shape
    path = out / name
    path.parent.mkdir(parents=True, exist_ok=True)
    text = f"gibenchImage({json.dumps(name)},{width},{height},{channels},{json.dumps(pack(codes))});\n"
    # Whole or not at all; not synced to disk one by one, since the page that names them is written last.
    beside = path.with_suffix(".partial")
    try:
        beside.write_text(text)
        os.replace(beside, path)
    except OSError:
        beside.unlink(missing_ok=True)
        raise
    return path


def _in_threads(work: Callable[[Any], list[Path]], jobs: list[Any]) -> list[list[Path]]:
    # NumPy and zlib let other threads run while they compute.
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        futures = [pool.submit(work, job) for job in jobs]
        try:
            return [future.result() for future in futures]
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
