"""Statistics of the samples: no bias, honest error bars, and a denoiser that takes error away."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import t

from gibench.metrics import relmse
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.estimate import group_levels
from gibench.rendering.render import render_frame
from gibench.rendering.scene import GUIDED, Scene, load_dict
from gibench.stress.answers import Float64, largest_z
from gibench.stress.lights import BELOW, behind_a_gap, floor, lamp
from gibench.stress.registry import Check, Found, case
from gibench.stress.scenes import (
    area,
    closed_answer,
    closed_box,
    constant,
    metal,
    rectangle,
    rgb,
    small_room,
)
from gibench.stress.views import INSIDE, SMALL_ROOM, render_path

SEEDS = 64

RESOLUTION = (16, 12)

DEPTH = 8


def replicates(
    scene: Scene, camera: PinholeCamera, spp: int, *, depth: int = DEPTH
) -> tuple[Float64, Float64]:
    """Color and color_se of SEEDS independent frames, (SEEDS, pixels, 3) each."""
    given: dict[str, Any] = {"resolution": RESOLUTION, "channels": ["color", "color_se"], "max_depth": depth}
    frames = [render_frame(scene, camera, spp=spp, seed=seed, **given).arrays for seed in range(SEEDS)]
    color, error = (
        np.array([frame[name] for frame in frames], dtype=np.float64).reshape(SEEDS, -1, 3)
        for name in ("color", "color_se")
    )
    return color, error


def coverage(
    color: Float64, error: Float64, truth: Float64 | float, spp: int, *, shared: bool, known: str = ""
) -> Check:
    """Coverage of the 95 % interval of a pixel.

    shared: whether the truth is the mean of all frames, this one among them, which is nearer to it than the truth.
    """
    groups = spp // 4 ** group_levels(spp)
    reach = t.ppf(0.975, groups - 1) * error
    off = np.abs(color - truth) / (np.sqrt(1 - 1 / SEEDS) if shared else 1)
    noisy = error.mean(axis=0) > 0
    share = float((off <= reach)[:, noisy].mean())
    what = f"coverage of the 95 % interval at {spp} spp: {100 * share:.1f} % (absolute)"
    return Check(
        "error bars", what, abs(share - 0.95), 0.03, "92 to 98 %, Student's t over the groups", known
    )


@case("64 seeds of a furnace, {spp} spp", spp=(16, 64, 256), quick=(64,))
def seeds_of_a_furnace(spp: int) -> Found:
    """Every pixel against the series; groups of 1, 4 and 16 samples."""
    yield from _against(closed_answer(0.8, 1.0, DEPTH), load_dict(closed_box(0.8, 1.0)), spp)


@case("64 seeds of a furnace, guided")
def seeds_of_a_guided_furnace() -> Found:
    """The same of paths that follow what was learned."""
    yield from _against(closed_answer(0.8, 1.0, DEPTH), guided(load_dict(closed_box(0.8, 1.0))), 64)


@case("64 seeds of a furnace with a mirror, guided")
def seeds_of_a_mirrored_furnace() -> Found:
    """A mirror that takes nothing changes nothing, also where walls are sampled by their images in it.

    Every other event at least is one of a wall, of which the series with 32 has but 2 · 10⁻¹⁰ left to come.
    """
    mirror = {"type": "conductor", "material": "none", "specular_reflectance": rgb(1.0)}
    scene = closed_box(0.5, 1.0) | {"mirror": rectangle([-0.99, 0, 0], [1, 0, 0], (0.9, 0.9), bsdf=mirror)}
    yield from _against(closed_answer(0.5, 1.0, 64), guided(load_dict(scene)), 64, depth=64)


def guided(scene: Scene) -> Scene:
    """The scene with a guide."""
    scene = replace(scene, sampling=GUIDED)
    assert scene.guide is not None
    return scene


def _against(answer: float, scene: Scene, spp: int, *, depth: int = DEPTH) -> Found:
    color, error = replicates(scene, INSIDE, spp, depth=depth)
    grey = color[..., 0]
    z = (grey.mean(axis=0) - answer) / (grey.std(axis=0, ddof=1) / np.sqrt(SEEDS))
    bound = largest_z(z.size, SEEDS - 1)
    source = "Student's t, Bonferroni over 192 pixels"
    yield Check("light", "bias, largest z-score", float(np.abs(z).max()), bound, source)
    yield coverage(color, error, answer, spp, shared=False)
    claimed, spread = np.square(error).mean(), color.var(axis=0, ddof=1).mean()
    # Relative error of a variance of 63 degrees of freedom, over pixels of one component.
    bound = largest_z(1) * np.sqrt(2 / (SEEDS - 1) / z.size + 2 / (SEEDS * z.size * 15))
    source = "χ² of as many degrees of freedom"
    yield Check(
        "error bars", "mean of color_se² against the variance", abs(claimed / spread - 1), bound, source
    )


SKEWED = (
    "samples are skewed: most frames miss what is rare and bright, so that their intervals are short of it; the "
    "variance that they state is right in the mean"
)


@case("64 seeds of a {kind} room, beside path", kind=("matt", "glossy"))
def seeds_against_path(kind: str) -> Found:
    """Every pixel of a room against Mitsuba's own integrator, 64 seeds of each; then its error bars."""
    yield from _against_path(load_dict(small_room(glossy=kind == "glossy")), glossy=kind == "glossy")


@case("64 seeds of a {kind} room, guided, beside path", kind=("matt", "glossy"))
def guided_seeds_against_path(kind: str) -> Found:
    """The same of paths that follow what was learned."""
    scene = guided(load_dict(small_room(glossy=kind == "glossy")))
    yield from _against_path(scene, glossy=kind == "glossy")


def _against_path(scene: Scene, *, glossy: bool) -> Found:
    spp = 64
    color, error = replicates(scene, SMALL_ROOM, spp)
    given: dict[str, Any] = {"spp": spp, "max_depth": DEPTH}
    theirs = np.array(
        [
            render_path(scene.mi_scene, SMALL_ROOM, RESOLUTION, seed=SEEDS + seed, **given)
            for seed in range(SEEDS)
        ],
        dtype=np.float64,
    ).reshape(SEEDS, -1, 3)
    first, second = color.mean(axis=-1), theirs.mean(axis=-1)
    spread = (first.var(axis=0, ddof=1) + second.var(axis=0, ddof=1)) / SEEDS
    z = (first.mean(axis=0) - second.mean(axis=0)) / np.sqrt(spread)
    source = "Welch's t, Bonferroni over 192 pixels"
    yield Check(
        "light", "difference, largest z-score", float(np.abs(z).max()), largest_z(z.size, SEEDS - 1), source
    )
    for count in (16, 64, 256):
        found = (color, error) if count == spp else replicates(scene, SMALL_ROOM, count)
        known = SKEWED if glossy else ""
        yield coverage(*found, found[0].mean(axis=0), count, shared=True, known=known)


def lit_floor(**light: Any) -> Scene:
    """A floor below a light."""
    return load_dict({"type": "scene", "floor": floor(), **light})


ABOVE = PinholeCamera((0.0, -1.6, 1.2), (0.0, 0.0, 0.0), 0.9)

BELOW_WIDE = PinholeCamera(BELOW.position, BELOW.target, 1.0)

DENOISED: dict[str, Callable[[], tuple[Scene, PinholeCamera]]] = {
    "a small room": lambda: (load_dict(small_room()), SMALL_ROOM),
    "a furnace": lambda: (load_dict(closed_box(0.8, 1.0)), INSIDE),
    "a lamp of 1 mm": lambda: (lit_floor(lamp=lamp((0, 0, 1.5), (5e-4, 5e-4), 1e6)), ABOVE),
    "a gap of 1 cm": lambda: (behind_a_gap(lamp=lamp((0, 0, 2), (1.2, 0.2), 10.0)), BELOW_WIDE),
    "a near-mirror": lambda: (
        load_dict(
            {
                "type": "scene",
                "sky": constant(0.2),
                "lamp": rectangle([0, 1, 0.5], [0, -1, 0], (0.5, 0.2), emitter=area(5.0)),
                "floor": rectangle([0, 0, 0], [0, 0, 1], (1, 1), bsdf=metal(1e-3)),
            }
        ),
        ABOVE,
    ),
    "light without noise": lambda: (load_dict(closed_box(0.0, 1.0)), INSIDE),
}

BLUR = (
    "little noise is left in the direct light, and OIDN blurs what a mirror shows of a lamp; in a furnished room by "
    "day it takes more than nine tenths of the error away"
)

UNGAINFUL = {("a lamp of 1 mm", 64)}
"""Cases in which the denoiser's blur is more than the noise."""


@case("denoising {what}", what=tuple(DENOISED), quick=("a gap of 1 cm",))
def denoising(what: str) -> Found:
    """Error with the denoiser over error without, at 16 and 64 samples a pixel."""
    scene, camera = DENOISED[what]()
    given: dict[str, Any] = {"resolution": (64, 48), "channels": ["color"], "max_depth": DEPTH}
    reference = render_frame(scene, camera, spp=4096, seed=1, **given).arrays["color"]
    for spp in (16, 64):
        raw, clean = (
            float(
                relmse(
                    render_frame(scene, camera, spp=spp, denoise=denoise, **given).arrays["color"], reference
                )
            )
            for denoise in (False, True)
        )
        ratio = clean / raw if raw > 0 else float(np.inf if clean > 0 else 0)
        known = BLUR if (what, spp) in UNGAINFUL else ""
        yield Check(
            "denoiser", f"relMSE denoised / raw, {spp} spp", ratio, 1.0, "it is there to reduce it", known
        )
