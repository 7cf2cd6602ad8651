"""Speed against error: what each number of samples, each sampler and the denoiser buy, and at what time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from gibench.metrics import reference_exposure, relmse
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.estimate import group_levels
from gibench.rendering.render import render_frame
from gibench.rendering.scene import GUIDED, Scene, load_dict, load_scene
from gibench.stress.answers import Float64, UndecidedError, largest_z
from gibench.stress.registry import Check, Curve, Found, case
from gibench.stress.scenes import small_room
from gibench.stress.views import SMALL_ROOM

ROOM = 0
"""Of seed 0, as the preset `small` begins: a dining kitchen by day."""

FEWEST = 2
"""Frames that an error is averaged over, at least."""

FIRST_TIMED = 64
"""Samples from which on a frame's time is more than what it takes to launch it."""


@dataclass(frozen=True)
class SamplingCase:
    """A way of sampling frames.

    odd: with one sample less than a multiple of 4, so that none are stratified. guided: by what is learned of the scene
    first, once for all frames; their seconds are without it.
    """

    name: str
    odd: bool
    denoise: bool
    guided: bool = False


RAW = SamplingCase("independent", odd=True, denoise=False)
STRATIFIED = SamplingCase("stratified", odd=False, denoise=False)
DENOISED = SamplingCase("stratified, denoised", odd=False, denoise=True)
GUIDED_RAW = SamplingCase("guided", odd=False, denoise=False, guided=True)
GUIDED_DENOISED = SamplingCase("guided, denoised", odd=False, denoise=True, guided=True)


def furnished_room() -> tuple[Scene, PinholeCamera]:
    """The first view of a generated room."""
    from gibench.generators.rooms import sample_room
    from gibench.generators.scene_files import write_room

    room = sample_room(0, ROOM, views=1)
    camera = room.cameras[0]
    with TemporaryDirectory() as folder:
        write_room(room, folder)
        scene = load_scene(Path(folder) / "scene.xml")
    return scene, PinholeCamera(camera.position, camera.target, camera.fov)


@dataclass(frozen=True)
class Place:
    """A scene to render.

    spp: samples from the fewest to the most. samples: in all, of the frames that an error is averaged over, of which
    there are at most `frames`. reference: samples of what they are compared with.
    """

    load: Callable[[], tuple[Scene, PinholeCamera]]
    resolution: tuple[int, int]
    spp: tuple[int, ...]
    samples: int
    frames: int
    reference: int


PLACES = {
    "small room": Place(
        lambda: (load_dict(small_room(glossy=False)), SMALL_ROOM), (48, 36), (4, 16, 64, 256), 4096, 64, 4096
    ),
    "furnished room": Place(furnished_room, (64, 48), (4, 16, 64, 256, 1024), 1024, 16, 4096),
}


@case("speed against error, {where}", where=tuple(PLACES))
def speed_against_error(where: str) -> Found:
    """Variance falls as samples are added, and error with it: relMSE · samples is constant. Guided paths have less."""
    place = PLACES[where]
    plain, camera = place.load()
    guided = replace(plain, sampling=GUIDED)
    given: dict[str, Any] = {"resolution": place.resolution, "channels": ["color", "color_se"]}
    best = render_frame(guided, camera, spp=place.reference, seed=1000, **given).arrays
    exposure = float(reference_exposure(best["color"]))
    reference = best["color"] * np.float32(exposure)
    # What the reference itself is off, in the same measure.
    own = np.square(best["color_se"].astype(float) * exposure) / (np.square(reference.astype(float)) + 0.01)
    rows = []
    errors: dict[tuple[str, int], Float64] = {}
    for setting in (RAW, STRATIFIED, DENOISED, GUIDED_RAW, GUIDED_DENOISED):
        scene = guided if setting.guided else plain
        for wanted in place.spp:
            spp = wanted - 1 if setting.odd else wanted
            assert not setting.odd or group_levels(spp) == 0
            given["channels"] = ["color"]
            found, seconds = [], []
            for seed in range(1 + min(place.frames, max(place.samples // wanted, FEWEST))):
                frame = render_frame(scene, camera, spp=spp, seed=seed, denoise=setting.denoise, **given)
                error = relmse(frame.arrays["color"] * np.float32(exposure), reference)
                found.append(float(error) - float(own.mean()))
                seconds.append(frame.seconds)
            # The first compiles the kernel; the least of the others' times is the least disturbed by other work.
            errors[setting.name, wanted] = np.array(found[1:])
            rows.append(
                {
                    "place": where,
                    "setting": setting.name,
                    "spp": spp,
                    "relmse": float(f"{np.mean(found[1:]):.4g}"),
                    "seconds": float(f"{np.min(seconds[1:]):.4g}"),
                    "frames": len(found) - 1,
                }
            )
    yield Curve(f"speed-{where.replace(' ', '-')}", tuple(rows))
    spread = spread_of(place, errors)
    yield from slopes(place, rows, errors, spread)
    most = place.spp[-1]
    ratio = errors[STRATIFIED.name, most].mean() / errors[RAW.name, most].mean()
    bound = np.exp(largest_z(1) * np.sqrt(2) * spread[-1])
    what = f"relMSE stratified / independent, {most} spp"
    yield Check("light", what, float(ratio), float(bound), "strata take noise away; spread of frames")
    for spp in place.spp:
        ratio = errors[DENOISED.name, spp].mean() / errors[STRATIFIED.name, spp].mean()
        yield Check(
            "denoiser", f"relMSE denoised / raw, {spp} spp", float(ratio), 1.0, "it is there to reduce it"
        )
    ratio = errors[GUIDED_RAW.name, most].mean() / errors[STRATIFIED.name, most].mean()
    what = f"relMSE guided / plain, {most} spp"
    yield Check("light", what, float(ratio), float(bound), "a guide takes noise away; spread of frames")


def spread_of(place: Place, errors: dict[tuple[str, int], Float64]) -> Float64:
    """Relative standard error of the mean error of independent samples, for each number of them.

    A sample's share of the error spreads alike at all numbers of samples, so that all frames tell of it.
    """
    raw = [errors[RAW.name, spp] for spp in place.spp]
    shares = [
        values / values.mean() * np.sqrt(spp)
        for spp, values in zip(place.spp, raw, strict=True)
        if len(values) > FEWEST
    ]
    one = np.sqrt(np.mean([values.var(ddof=1) for values in shares]))
    return np.array([one / np.sqrt(spp * len(values)) for spp, values in zip(place.spp, raw, strict=True)])


def slopes(
    place: Place, rows: list[dict[str, Any]], errors: dict[tuple[str, int], Float64], spread: Float64
) -> Found:
    """The slope of log error of independent samples: −1 against samples, and against time."""
    samples = np.array([row["spp"] for row in rows if row["setting"] == RAW.name], dtype=float)
    seconds = np.array([row["seconds"] for row in rows if row["setting"] == RAW.name])
    mean = np.array([errors[RAW.name, spp].mean() for spp in place.spp])
    slope, uncertain = fitted(np.log(samples), np.log(mean), spread)
    bound = largest_z(1) * uncertain
    if bound > 0.25:
        raise UndecidedError(f"slope {slope:.2f}: noise leaves {bound:.2f} of it open")
    yield Check(
        "light",
        f"slope of relMSE against samples, {slope:.3f}, less −1",
        abs(slope + 1),
        bound,
        "variance / n",
    )
    timed = samples >= FIRST_TIMED - 1
    slope, uncertain = fitted(np.log(seconds[timed]), np.log(mean[timed]), spread[timed])
    bound = largest_z(1) * uncertain + 0.15
    source = "variance / n; 0.15 for the fixed cost of a frame and the clock"
    yield Check(
        "light", f"slope of relMSE against seconds, {slope:.3f}, less −1", abs(slope + 1), bound, source
    )


def fitted(x: Float64, y: Float64, uncertain: Float64) -> tuple[float, float]:
    """Slope of a line through points whose y are uncertain by so much, and how uncertain the slope is."""
    weight = 1 / np.square(uncertain)
    middle = np.average(x, weights=weight)
    share = weight * (x - middle)
    total = float(np.sum(share * (x - middle)))
    return float(np.sum(share * y) / total), float(1 / np.sqrt(total))
